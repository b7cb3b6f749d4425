// "Explore" of a model without memory: the output along one input, at values of the others.
(() => {
    "use strict";
    const { element, span, numberText, words, withUnit, axisLabel, wider, evenly, knob, choice, tick, button } = mapmore;
    const POINTS = 401, NEAR = 0.06, MOST_DOTS = 1200;
    const PALETTE = ["--other1", "--other2", "--other3", "--other4", "--other5"];

    /** Half of the width of the interval at inputs; NaN where the study has none. */
    function halfWidth(interval, x) {
        if (!interval) return NaN;
        const { at, half, of } = interval;
        if (of === null || at.length < 2) return half[0] ?? NaN;
        const place = ((x[of] - at[0]) / (at[at.length - 1] - at[0])) * (at.length - 1), k = Math.floor(place);
        if (!(place >= 0 && place <= at.length - 1)) return NaN;
        const low = half[k], high = half[Math.min(k + 1, at.length - 1)];
        return low === null || high === null ? NaN : low + (place - k) * (high - low);
    }

    function explore(box, study) {
        const model = mapmore.models[study.key], { inputs, output, samples } = study, { columns, held } = samples;
        const measured = columns[output.name], names = inputs.map((one) => one.name);
        const spans = Object.fromEntries(names.map((name) => [name, study.spans[name]]));
        const inOrder = (x) => names.map((name) => x[name]);
        const valueAt = (x, one = model) => one.evaluate(...one.INPUTS.map((name) => x[name]));
        const outside = (x) => model.outsideRange(...inOrder(x));
        const sampleAt = (k) => Object.fromEntries(names.map((name) => [name, columns[name][k]]));
        const complete = (k) => measured[k] !== null && names.every((name) => columns[name][k] !== null);
        const rows = [...held.keys()].filter(complete), heldRows = rows.filter((k) => held[k]);

        const knobs = Object.fromEntries(inputs.map((one) => {
            const ends = wider(spans[one.name], 0.15), start = (spans[one.name][0] + spans[one.name][1]) / 2;
            return [one.name, knob(words(one.name), one.unit, ends, start, () => changed())];
        }));
        const options = inputs.map((one) => [one.name, words(one.name)]);
        const axis = choice("Along", options, names[study.along], () => changed());
        const others = study.others.map((one, k) => ({
            ...one, color: PALETTE[k % PALETTE.length], dash: k < PALETTE.length ? [7, 3] : [2, 3],
            tick: tick(one.title, PALETTE[k % PALETTE.length], false, () => changed()),
        }));
        const reading = element("output", { className: "reading" });
        const moved = (k) => { names.forEach((name) => knobs[name].set(columns[name][k])); changed(); };

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
        buttons.append(button(heldRows.length ? "Worst held-out sample" : "Worst sample", worstSample));

        const legend = element("div", { className: "legend" },
            span("key", "model, dashed where it is extrapolated"), span("key grey", "measured, trained"),
            ...(heldRows.length ? [span("key held", "measured, held out")] : []),
            ...others.map((one) => one.tick.row));
        const rows_ = names.map((name) => knobs[name].row);
        box.append(axis.row, element("div", { className: "knobs" }, ...rows_), reading, buttons, legend);
        const view = mapmore.chart(box, `${words(output.name)} by the model along an input, beside measured samples`);
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
            const inside = ys.map((y, k) => (beyond[k] ? null : y));
            const dashed = ys.map((y, k) => (beyond[k] || beyond[k - 1] || beyond[k + 1] ? y : null));
            /** @type {any[]} */
            const layers = [
                { kind: "line", x: xs, y: dashed, color: "--model", dash: [5, 5] },
                { kind: "line", x: xs, y: inside, color: "--model" },
            ];
            const half = places.map((place, k) => (beyond[k] ? NaN : halfWidth(study.interval, place)));
            const known = [...half.keys()].filter((k) => Number.isFinite(half[k]));
            const [low, high] = [-1, 1].map((side) => known.map((k) => ys[k] + side * half[k]));
            if (known.length) layers.unshift({ kind: "band", color: "--model", x: known.map((k) => xs[k]), y: low, y2: high });
            for (const one of others.filter((other) => other.tick.on)) {
                const y = places.map((place) => valueAt(place, mapmore.models[one.key]));
                layers.push({ kind: "line", x: xs, y, color: one.color, dash: one.dash, width: 1.6, free: true });
            }
            return layers;
        }

        function changed() {
            const x = at(), along = axis.value, beyond = outside(x), half = halfWidth(study.interval, x);
            const slope = model.derivatives(...inOrder(x))[names.indexOf(along)], value = valueAt(x);
            const per = inputs[names.indexOf(along)].unit, unit = per ? `${output.unit || "1"}/${per}` : output.unit;
            reading.replaceChildren(
                element("strong", {}, `${words(output.name)} = ${withUnit(value, output)}`),
                !beyond && Number.isFinite(half) ? ` ± ${numberText(half)} (${100 * study.interval.level} %)` : "",
                span("slope", `slope along ${words(along)}: ${numberText(slope)} ${unit}`.trim()),
                beyond ? span("beyond", "beyond the training range: the model is extrapolated") : "");
            reading.dataset.value = String(value);
            const ends = wider(spans[along], 0.15), quantity = inputs[names.indexOf(along)];
            view.show(axisLabel(quantity), axisLabel(output), ends, [
                { kind: "dots", ...near(x, along, false), color: "--trained" },
                { kind: "dots", ...near(x, along, true), color: "--held" },
                ...lines(x, along, ends), { kind: "at", x: x[along], color: "--ink", width: 1, dash: [2, 3] },
            ]);
            for (const follow of followers) follow();
        }

        if (heldRows.length) heldOutCurve(); else changed();
        if (study.pieces) {
            const frame = { study, at, along: () => axis.value, spans, heldRows, sampleAt, measured, inOrder, model };
            followers.push(mapmore.explorePieces(box, frame));
        }
    }

    mapmore.exploreFixed = explore;
})();
