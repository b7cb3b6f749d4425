// The parts of both views of "Explore": controls, numbers as text, and competitors.
import { element } from "./elements.js";

const POINTS = 400;

/**
 * Return the controls in a box: their `values` by name (numbers, words or switches), and `set`,
 * which changes one. A slider and a number field with the same name show the same value.
 */
export function controls(box, changed) {
  const all = [...box.querySelectorAll("[name]")], values = {};
  const valueOf = (one) => (
    one.type === "checkbox" ? one.checked : one.valueAsNumber ?? one.value);
  const set = (name, value, typedIn = null) => {
    values[name] = value;
    for (const one of all) if (one.name === name && one !== typedIn) one.value = String(value);
  };
  for (const one of all) values[one.name] = valueOf(one);
  box.addEventListener("input", ({ target }) => {
    const value = valueOf(target);
    if (Number.isNaN(value)) return;
    set(target.name, value, target);
    changed();
  });
  return { values, set };
}

export const span = (className, text) => element("span", { className }, text);

/** Show a number in large digits with remarks; a test reads the number with all its digits. */
export function read(output, value, text, ...words) {
  output.replaceChildren(element("strong", {}, text), ...words.filter(Boolean));
  output.dataset.value = String(value);
}

/** Return a number with four digits, without an exponent if it is readable without one. */
export function numberText(x) {
  if (!Number.isFinite(x)) return "no value";
  const size = Math.abs(x);
  let text = String(Number(x.toPrecision(4)));
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) text = x.toExponential(3);
  else if (size >= 1000) text = x.toFixed(0);
  return text.replace("-", "−");
}

export const withUnit = (x, quantity) => `${numberText(x)} ${quantity.unit}`.trim();
export const evenly = ([low, high]) => (
  Array.from({ length: POINTS + 1 }, (_, k) => low + ((high - low) * k) / POINTS));
export const rootMeanSquare = (errors) => (
  Math.sqrt(errors.reduce((sum, one) => sum + one * one, 0) / errors.length));

/** Return the result of a function of a model's code for inputs by name. */
export const ask = (code, what, x) => code[what](...code.INPUTS.map((name) => x[name]));

/** Return layers of the competitors that are switched on; `course` returns the values of one. */
export function competitors(others, values, course) {
  return others.filter(({ key }) => values[`other:${key}`]).map(({ key, color, dash }) => (
    { kind: "line", color, dash, width: 1.6, free: true, ...course(mapmore.models[key]) }));
}

/** Return layers of the model: solid within the training range, dashed outside. */
export function byRange(x, y, beyond, width = 2) {
  const inside = y.map((one, k) => (beyond[k] ? null : one));
  const near = (k) => beyond[k] || beyond[k - 1] || beyond[k + 1];
  const outside = y.map((one, k) => (near(k) ? one : null));
  const look = { kind: "line", x, color: "--model", width };
  return [{ ...look, y: outside, dash: [5, 5] }, { ...look, y: inside }];
}
