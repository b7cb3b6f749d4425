// The pieces of a model: their functions and weights along a curve, and other ways to join them.
(() => {
  "use strict";
  const { element, button, span, words, withUnit, axisLabel, wider, evenly, choice } = mapmore;
  const { zonesOf, weightsAt, joinedCurve } = mapmore;
  const POINTS = 301, PALETTE = ["--piece1", "--piece2", "--piece3", "--piece4"];
  const SIDES = [["continue"], ["continue_linear", "continue straight"], ["saturate"], ["zero"]];
  const AS_FITTED = "fitted", GO_ON = ["continue", "continue"];
  const ABOUT = "The pieces stay as they were fitted; only the way they are joined changes here. "
    + "Run the study with the line below to make it the model.";

  function explorePieces(box, { study, at, along, held, inOrder, quantity }) {
    const { spans, pieces } = study, { variables, joint, curves, level } = pieces;
    const model = mapmore.models[study.key], code = mapmore.models[pieces.key];
    const names = study.inputs.map((one) => one.name).filter((name) => name !== level);

    let count = 0;
    const functionsOf = new Map(curves.map((curve) => {
      const own = [count, (count += curve.segments.length)];
      return [curve, { f: code.segments.slice(...own), slopes: code.slopes.slice(...own) }];
    }));

    const again = () => changed();
    const zs = mapmore.knob("z_s", "", [0, 0.5], joint.z_s, again);
    const ways = Object.keys(mapmore.TRANSITIONS).map((one) => [one, one]);
    const transition = choice("transition", ways, joint.transition, again);
    const sides = Object.fromEntries(variables.map((name) => {
      const [below, above] = joint.extrapolation[name] ?? GO_ON;
      const known = below === above && SIDES.some(([word]) => word === below);
      const options = SIDES.map(([word, title]) => [word, title ?? word]);
      if (!known) options.unshift([AS_FITTED, "as fitted"]);
      const start = known ? below : AS_FITTED;
      return [name, choice(`extrapolation of ${words(name)}`, options, start, again)];
    }));
    const score = element("output", { className: "reading small" });
    const yaml = element("code", { className: "yaml" });
    const copy = mapmore.copier(yaml);
    const list = element("div", { className: "segments" });
    const equation = element("p", { className: "equation" });
    const row = element("div", { className: "two" });
    box.append(element("details", { className: "pieces", open: true },
      element("summary", {}, "Pieces, and other ways to join them"),
      element("p", { className: "note" }, ABOUT),
      element("div", { className: "choices" }, transition.row,
        ...variables.map((name) => sides[name].row)),
      element("div", { className: "knobs" }, zs.row), score, element("p", {}, yaml, " ", copy),
      list, row, equation));
    const functions = mapmore.chart(row, "The pieces, and the curve that they are joined to", 300);
    const weights = mapmore.chart(row, "The weights of the pieces", 300);

    const sidesOf = (name) => {
      const side = sides[name]?.value ?? AS_FITTED;
      return side === AS_FITTED ? joint.extrapolation[name] ?? GO_ON : [side, side];
    };
    function chosen() {
      const own = Object.fromEntries(names.map((name) => [name, sidesOf(name)]));
      const extrapolation = { ...joint.extrapolation, ...own };
      return { ...joint, z_s: zs.value, transition: transition.value, extrapolation };
    }

    /** The model, joined in another way: the code of the model has the levels and the backbone. */
    function joined(how) {
      code.rejoin(curves.map((curve) => {
        const { f, slopes } = functionsOf.get(curve);
        return joinedCurve(curve, f, slopes, variables, names, how);
      }));
      return (x) => code.evaluate(...inOrder(x));
    }

    /** The section of a spec that joins pieces in this way. */
    function yamlOf(how) {
      const word = ([below, above]) => (
        below === above ? below : `{below: ${below}, above: ${above}}`);
      const sides = Object.entries(how.extrapolation);
      const beyond = sides.map(([name, ends]) => `${name}: ${word(ends)}`);
      return `fuse: {transition: ${how.transition}, z_s: ${Number(how.z_s.toPrecision(4))}, `
        + `levels: ${how.levels}, hold: ${how.hold}, extrapolation: {${beyond.join(", ")}}}`;
    }

    function errorOf(value) {
      const { rows, sampleAt, measured } = held;
      const errors = rows.map((k) => value(sampleAt(k)) - measured[k]).filter(Number.isFinite);
      return { rmse: mapmore.rootMeanSquare(errors), count: errors.length };
    }
    const before = errorOf((x) => model.evaluate(...inOrder(x)));

    function showScore(value, how) {
      const { rmse, count: samples } = errorOf(value), all = study.samples.all_held;
      const of = samples < all ? `${samples} of ${all}` : samples;
      const fitted = withUnit(before.rmse, study.output);
      score.replaceChildren(...(samples ? [
        element("strong", {}, `RMSE ${withUnit(rmse, study.output)}`),
        span("slope", `on ${of} held-out samples; as fitted ${fitted}`),
      ] : ["no held-out samples"]));
      score.dataset.rmse = String(rmse);
      yaml.textContent = yamlOf(how);
      copy.textContent = "Copy";
    }

    /** The curve whose level is the nearest, and its segments along an axis at the other inputs. */
    function segmentsAt(x, axis, how) {
      const away = curves.map((curve) => (level === null ? 0 : Math.abs(curve.level - x[level])));
      const curve = curves[away.indexOf(Math.min(...away))], place = variables.indexOf(axis);
      const zones = curve.boundaries.map((ends) => zonesOf(ends, how.z_s));
      const cells = variables.map((name, j) => weightsAt(x[name], zones[j], how.transition)[0][0]);
      const here = (cell, j) => j === place || cell === cells[j];
      const segments = curve.segments.filter((one) => one.cell.every(here));
      return { curve, place, zones: zones[place], segments };
    }

    function show(segment) {
      equation.replaceChildren(element("strong", {}, `${segment.id}: `), segment.equation);
    }

    function draw(value, how, axis) {
      const { curve, place, zones, segments } = segmentsAt(at(), axis, how);
      row.hidden = place < 0;
      if (place < 0) {
        const which = variables.map(words).join(" or ");
        list.replaceChildren(`Choose ${which} above to see the pieces along it.`);
        equation.replaceChildren();
        return;
      }
      const x = { ...at(), ...(level === null ? {} : { [level]: curve.level }) };
      const ends = wider(spans[axis], 0.15), xs = evenly(ends, POINTS);
      const order = level === null ? names : [...names, level];
      const inputs = (one) => order.map((name) => (name === axis ? one : x[name]));
      const parts = [], shares = [];
      segments.forEach((segment, k) => {
        const color = PALETTE[k % PALETTE.length], cell = segment.cell[place];
        const weight = (one) => new Map(weightsAt(one, zones, how.transition)).get(cell) ?? 0;
        const share = xs.map(weight);
        const f = functionsOf.get(curve).f[curve.segments.indexOf(segment)];
        const y = xs.map((one, j) => (share[j] > 0 ? f(...inputs(one)) : null));
        parts.push({ kind: "line", x: xs, y, color, width: 4, free: true });
        shares.push({ kind: "line", x: xs, y: share, color });
      });
      const label = axisLabel(quantity(axis));
      const joinedTo = xs.map((one) => value({ ...x, [axis]: one }));
      const whole = { kind: "line", x: xs, y: joinedTo, color: "--ink", width: 1.2 };
      functions.show(label, axisLabel(study.output), ends, [...parts, whole]);
      weights.show(label, "Weight (–)", ends, shares);
      const at_ = level === null ? "" : withUnit(curve.level, quantity(level));
      const where = at_ && ` at ${words(level)} ${at_}`;
      list.replaceChildren(`Segments${where}:`, ...segments.map((segment, k) => {
        const made = button(segment.id, () => show(segment));
        made.style.borderColor = `var(${PALETTE[k % PALETTE.length]})`;
        return made;
      }));
      functions.whenClicked((one) => {
        const [[cell]] = weightsAt(one, zones, how.transition).sort((a, b) => b[1] - a[1]);
        const segment = segments.find((other) => other.cell[place] === cell);
        if (segment) show(segment);
      });
    }

    function changed() {
      const how = chosen(), value = joined(how);
      showScore(value, how);
      draw(value, how, along());
    }
    changed();
    return changed;
  }

  mapmore.explorePieces = explorePieces;
})();
