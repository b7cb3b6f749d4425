// "Explore" of a model without memory: the output along one input, at values of the others.
(() => {
  "use strict";
  const { element, button, span, numberText, words, withUnit, axisLabel, wider, evenly } = mapmore;
  const POINTS = 401, NEAR = 0.06, MOST_DOTS = 1200;

  /** Half of the width of the interval at inputs; NaN where the study has none. */
  function halfWidth(interval, x) {
    if (!interval) return NaN;
    const { at, half, of } = interval;
    if (of === null || at.length < 2) return half[0] ?? NaN;
    const place = ((x[of] - at[0]) / (at[at.length - 1] - at[0])) * (at.length - 1);
    const k = Math.floor(place);
    if (!(place >= 0 && place <= at.length - 1)) return NaN;
    const low = half[k], high = half[Math.min(k + 1, at.length - 1)];
    return low === null || high === null ? NaN : low + (place - k) * (high - low);
  }

  function explore(box, study) {
    const model = mapmore.models[study.key], { inputs, output, samples, spans } = study;
    const { columns, held } = samples, measured = columns[output.name];
    const names = inputs.map((one) => one.name), quantity = (name) => inputs[names.indexOf(name)];
    const inOrder = (x) => names.map((name) => x[name]);
    const valueAt = (x, one = model) => one.evaluate(...one.INPUTS.map((name) => x[name]));
    const outside = (x) => model.outsideRange(...inOrder(x));
    const sampleAt = (k) => Object.fromEntries(names.map((name) => [name, columns[name][k]]));
    const known = (k) => [...names, output.name].every((name) => columns[name][k] !== null);
    const rows = [...held.keys()].filter(known), heldRows = rows.filter((k) => held[k]);

    const again = () => changed();
    const knobs = Object.fromEntries(inputs.map(({ name, unit }) => {
      const [low, high] = spans[name], ends = wider(spans[name], 0.15);
      return [name, mapmore.knob(words(name), unit, ends, (low + high) / 2, again)];
    }));
    const options = names.map((name) => [name, words(name)]);
    const axis = mapmore.choice("Along", options, names[study.along], again);
    const others = mapmore.competitors(study.others, again);
    const reading = element("output", { className: "reading" });
    const moved = (k) => {
      names.forEach((name) => knobs[name].set(columns[name][k]));
      changed();
    };

    let turn = 0;
    function heldOutCurve() {
      const groups = [...new Set(heldRows.map((k) => samples.curve[k]))];
      if (!groups.length) return;
      const of = heldRows.filter((k) => samples.curve[k] === groups[turn % groups.length]);
      turn += 1;
      moved(of[of.length >> 1]);
    }
    function worstSample() {
      let worst = -1, most = -1;
      for (const k of heldRows.length ? heldRows : rows) {
        const error = Math.abs(valueAt(sampleAt(k)) - measured[k]);
        if (error > most) [worst, most] = [k, error];
      }
      if (worst >= 0) moved(worst);
    }
    const buttons = element("div", { className: "buttons" });
    if (heldRows.length) buttons.append(button("Held-out curve", heldOutCurve));
    const worst = heldRows.length ? "Worst held-out sample" : "Worst sample";
    buttons.append(button(worst, worstSample));

    const legend = element("div", { className: "legend" },
      span("key", "model, dashed where it is extrapolated"), span("key grey", "measured, trained"),
      span("key held", heldRows.length ? "measured, held out" : ""), ...others.rows);
    const sliders = element("div", { className: "knobs" }, ...names.map((name) => knobs[name].row));
    box.append(axis.row, sliders, reading, span("note", study.no_interval), buttons, legend);
    const summary = `${words(output.name)} by the model along an input, beside measured samples`;
    const view = mapmore.chart(box, summary);
    const followers = [];

    const at = () => Object.fromEntries(names.map((name) => [name, knobs[name].value]));

    function near(x, along, which) {
      const rest = names.filter((name) => name !== along);
      const reach = rest.map((name) => NEAR * (spans[name][1] - spans[name][0]) + 1e-12);
      const found = rows.filter((k) => Boolean(held[k]) === which
        && rest.every((name, j) => Math.abs(columns[name][k] - x[name]) <= reach[j]));
      const some = found.filter((_, k) => k % Math.ceil(found.length / MOST_DOTS || 1) === 0);
      return { x: some.map((k) => columns[along][k]), y: some.map((k) => measured[k]) };
    }

    /** Layers of the model along an axis: solid within the training range, dashed beyond. */
    function lines(x, along, ends) {
      const xs = evenly(ends, POINTS);
      const places = xs.map((place) => ({ ...x, [along]: place }));
      const ys = places.map((place) => valueAt(place)), beyond = places.map(outside);
      const half = places.map((place, k) => (beyond[k] ? NaN : halfWidth(study.interval, place)));
      const at = [...half.keys()].filter((k) => Number.isFinite(half[k]));
      const [y, y2] = [-1, 1].map((side) => at.map((k) => ys[k] + side * half[k]));
      const band = { kind: "band", color: "--model", x: at.map((k) => xs[k]), y, y2 };
      const drawn = others.on.map(({ look, code }) => (
        { ...look, x: xs, y: places.map((place) => valueAt(place, code)) }));
      return [...(at.length ? [band] : []), ...drawn, ...mapmore.byRange(xs, ys, beyond)];
    }

    function changed() {
      const x = at(), along = axis.value, beyond = outside(x), half = halfWidth(study.interval, x);
      const slope = model.derivatives(...inOrder(x))[names.indexOf(along)], value = valueAt(x);
      const per = quantity(along).unit, unit = per ? `${output.unit || "1"}/${per}` : output.unit;
      const sure = !beyond && Number.isFinite(half);
      reading.replaceChildren(
        element("strong", {}, `${words(output.name)} = ${withUnit(value, output)}`),
        sure ? ` ± ${numberText(half)} (${100 * study.interval.level} %)` : "",
        span("slope", `slope along ${words(along)}: ${numberText(slope)} ${unit}`.trim()),
        beyond ? span("beyond", "beyond the training range: the model is extrapolated") : "");
      reading.dataset.value = String(value);
      const ends = wider(spans[along], 0.15);
      view.show(axisLabel(quantity(along)), axisLabel(output), ends, [
        { kind: "dots", ...near(x, along, false), color: "--trained" },
        { kind: "dots", ...near(x, along, true), color: "--held" },
        ...lines(x, along, ends),
        { kind: "at", x: x[along], color: "--ink", width: 1, dash: [2, 3] },
      ]);
      for (const follow of followers) follow();
    }

    if (heldRows.length) heldOutCurve(); else changed();
    if (study.pieces) {
      const held = { rows: heldRows, sampleAt, measured };
      const frame = { study, at, along: () => axis.value, held, inOrder, quantity };
      followers.push(mapmore.explorePieces(box, frame));
    }
  }

  mapmore.exploreFixed = explore;
})();
