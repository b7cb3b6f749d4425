// "Explore" for a model without memory: the output along one input, with the others fixed.
import { chart } from "./chart.js";
import { ask, byRange, competitors, controls, evenly, numberText, read, span, withUnit }
  from "./controls.js";
import { explorePieces } from "./pieces.js";

/** Return half the width of the interval at some inputs; NaN if the study has no intervals. */
function halfWidth(interval, x) {
  if (!interval) return NaN;
  const { of, low, step, half } = interval;
  const place = of === null ? 0 : Number(((x[of] - low) / step).toFixed(6));
  const [below, above] = [Math.floor(place), Math.ceil(place)].map((k) => half[k] ?? NaN);
  return below + (place % 1) * (above - below);
}

export function exploreFixed(box, study) {
  const model = mapmore.models[study.key], { inputs, output, samples, interval } = study;
  const { values, set } = controls(box, () => changed());
  const reading = box.querySelector(".reading"), view = chart(box.querySelector(".chart"));
  const at = () => Object.fromEntries(inputs.map(({ name }) => [name, values[`input:${name}`]]));
  const pieces = study.pieces && explorePieces(box, study, values);

  /** Move all inputs to the next sample of a button. */
  for (const button of box.querySelectorAll("[data-samples]")) {
    const rows = JSON.parse(button.dataset.samples);
    button.addEventListener("click", () => {
      inputs.forEach(({ name }, j) => set(`input:${name}`, rows[0][j]));
      rows.push(rows.shift());
      changed();
    });
  }

  /** Return the samples with nearly the chosen values of the other inputs, as dots. */
  function near(columns, x, along, color) {
    const others = inputs.filter((one) => one !== along);
    const rows = [...columns[output.name].keys()].filter((k) => others.every((one) => (
      Math.abs(columns[one.name][k] - x[one.name]) <= one.near)));
    const [xs, y] = [along, output].map(({ name }) => rows.map((k) => columns[name][k]));
    return { kind: "dots", color, x: xs, y };
  }

  /** Return layers of the model with its interval, and of competitors, along an input. */
  function lines(x, along) {
    const xs = evenly(along.ends), places = xs.map((one) => ({ ...x, [along.name]: one }));
    const course = (code) => ({ x: xs, y: places.map((place) => ask(code, "evaluate", place)) });
    const { y: ys } = course(model);
    const beyond = places.map((place) => ask(model, "outsideRange", place));
    const half = places.map((place, k) => (beyond[k] ? NaN : halfWidth(interval, place)));
    const rows = [...half.keys()].filter((k) => Number.isFinite(half[k]));
    const [y, y2] = [-1, 1].map((side) => rows.map((k) => ys[k] + side * half[k]));
    const band = { kind: "band", color: "--model", x: rows.map((k) => xs[k]), y, y2 };
    return [...(rows.length ? [band] : []), ...competitors(study.others, values, course),
      ...byRange(xs, ys, beyond)];
  }

  function readAt(x, along) {
    const value = ask(model, "evaluate", x), beyond = ask(model, "outsideRange", x);
    const slope = ask(model, "derivatives", x)[inputs.indexOf(along)];
    const half = beyond ? NaN : halfWidth(interval, x);
    const unit = along.unit ? `${output.unit || "1"}/${along.unit}` : output.unit;
    read(reading, value, `${output.title} = ${withUnit(value, output)}`,
      Number.isFinite(half) ? ` ± ${numberText(half)} (${100 * interval.level} %)` : "",
      span("slope", `slope along ${along.title}: ${numberText(slope)} ${unit}`.trim()),
      beyond && span("beyond", "beyond the training range: the model is extrapolated"));
    return value;
  }

  function changed() {
    const x = at(), along = inputs.find(({ name }) => name === values.along);
    view(along.label, output.label, along.ends, [
      near(samples.trained, x, along, "--trained"), near(samples.held, x, along, "--held"),
      ...lines(x, along),
      { kind: "dots", color: "--ink", width: 4, x: [x[along.name]], y: [readAt(x, along)] },
    ]);
    pieces?.(x, along);
  }
  changed();
}
