// The pieces of a model: their functions and weights along a curve, and other ways to join them.
import { chart } from "./chart.js";
import { ask, evenly, read, rootMeanSquare, span, withUnit } from "./controls.js";
import { button } from "./elements.js";
import { joinedCurve, weightsAt, zonesOf } from "./joining.js";

/** Return the function that shows the pieces along an input, joined in the chosen way. */
export function explorePieces(box, study, values) {
  const { inputs, output, pieces, samples } = study, { variables, joint, curves, level } = pieces;
  const model = mapmore.models[study.key], code = mapmore.models[pieces.key];
  const free = inputs.map((one) => one.name).filter((name) => name !== level);
  const measured = samples.held[output.name];
  const [functions, weights] = [...box.querySelectorAll(".pieces .chart")].map(chart);
  const [score, yaml, list, equation] = ["output", ".yaml", ".segments", ".equation"]
    .map((place) => box.querySelector(`.pieces ${place}`));

  /** Return the chosen way to join pieces. */
  function chosen() {
    const sides = free.map((name) => [name, JSON.parse(values[`sides:${name}`])]);
    const extrapolation = { ...joint.extrapolation, ...Object.fromEntries(sides) };
    return { ...joint, z_s: values.z_s, transition: values.transition, extrapolation };
  }

  /** Return the joined model; the code of the model adds the levels and the backbone. */
  function joined(how) {
    const transition = code.transitions[how.transition];
    code.rejoin(curves.map((curve, k) => (
      joinedCurve(curve, code.segments[k], code.slopes[k], variables, free, how, transition))));
    return (x) => ask(code, "evaluate", x);
  }

  /** Return the section of a spec that joins pieces in this way, as JSON, which is also YAML. */
  function yamlOf(how) {
    const word = ([below, above]) => (below === above ? below : { below, above });
    const sides = Object.entries(how.extrapolation).map(([name, ends]) => [name, word(ends)]);
    const fuse = { ...how, extrapolation: Object.fromEntries(sides) };
    return `fuse: ${JSON.stringify(fuse, null, 1).replace(/\s+/g, " ")}`;
  }

  /** Return the RMSE on held-out samples, and their number. */
  function errorOf(value) {
    const errors = measured.map((one, k) => (
      value(Object.fromEntries(inputs.map(({ name }) => [name, samples.held[name][k]]))) - one));
    const known = errors.filter(Number.isFinite);
    return [rootMeanSquare(known), known.length];
  }
  const [fitted] = errorOf((x) => ask(model, "evaluate", x));

  function showScore(value, how) {
    const [rmse, count] = errorOf(value), all = samples.all_held;
    const of = count < all ? `${count} of ${all}` : count;
    read(score, rmse, count ? `RMSE ${withUnit(rmse, output)}` : "",
      span("slope", `on ${of} held-out samples; as fitted ${withUnit(fitted, output)}`));
    yaml.textContent = yamlOf(how);
  }

  /** Draw the segments along an input of the curve with the nearest level. */
  function draw(value, how, at, along) {
    const away = curves.map((curve) => (level === null ? 0 : Math.abs(curve.level - at[level])));
    const of = away.indexOf(Math.min(...away)), curve = curves[of];
    const x = level === null ? at : { ...at, [level]: curve.level };
    const zones = curve.boundaries.map((ends) => zonesOf(ends, how.z_s));
    const place = variables.indexOf(along.name);
    const shares = (j, one) => weightsAt(one, zones[j], code.transitions[how.transition]);
    const cells = variables.map((name, j) => shares(j, x[name]).findIndex((one) => one > 0) + 1);
    const here = curve.segments.filter(({ cell }) => (
      cell.every((one, j) => j === place || one === cells[j])));

    const xs = evenly(along.ends), weightsThere = xs.map((one) => shares(place, one));
    const order = level === null ? free : [...free, level];
    const parts = here.map((segment) => {
      const f = code.segments[of][curve.segments.indexOf(segment)], cell = segment.cell[place];
      const look = { kind: "line", x: xs, color: `--piece${((cell - 1) % 4) + 1}` };
      const share = weightsThere.map((one) => one[cell - 1]);
      const inputsAt = (one) => order.map((name) => (name === along.name ? one : x[name]));
      const y = xs.map((one, k) => (share[k] > 0 ? f(...inputsAt(one)) : null));
      return { segment, share: { ...look, y: share }, own: { ...look, y, width: 4, free: true } };
    });
    const show = ({ segment }) => { equation.textContent = `${segment.id}: ${segment.equation}`; };

    /** A click shows that one of the pieces with a weight there whose line is nearest. */
    const nearest = (lineOf) => (at, height) => {
      const k = Math.min(xs.filter((one) => one < at).length, xs.length - 1);
      const away = parts.map((part) => (
        part.share.y[k] > 0 ? Math.abs(lineOf(part).y[k] - height) : Infinity));
      show(parts[away.indexOf(Math.min(...away))]);
    };
    const y = xs.map((one) => value({ ...x, [along.name]: one }));
    const whole = { kind: "line", x: xs, y, color: "--ink", width: 1.2 };
    functions(along.label, output.label, along.ends,
      [...parts.map(({ own }) => own), whole], nearest(({ own }) => own));
    weights(along.label, "Weight (–)", along.ends, parts.map(({ share }) => share),
      nearest(({ share }) => share));

    const quantity = inputs.find(({ name }) => name === level);
    const where = quantity ? ` at ${quantity.title} ${withUnit(curve.level, quantity)}` : "";
    const choice = (part) => button(part.segment.id, () => show(part),
      { style: `border-color: var(${part.own.color})` });
    list.replaceChildren(`Segments${where}:`, ...parts.map(choice));
  }

  return (at, along) => {
    const how = chosen(), value = joined(how), drawn = variables.includes(along.name);
    box.querySelector(".pieces .two").hidden = !drawn;
    showScore(value, how);
    if (drawn) return draw(value, how, at, along);
    equation.replaceChildren();
    return list.replaceChildren(pieces.choose);
  };
}
