// "Explore" of a model with memory: it runs freely along an input of one's own, from rest.
(() => {
    "use strict";
    const { element, words, withUnit, axisLabel, rangeOf, wider, knob, choice, chart } = window.mapmore;
    const PERIODS = 4, PER_PERIOD = 500, MOST = 20000, REST = 30;
    const SHAPES = {
        steps: (turn) => (turn % 1 < 0.5 ? 1 : -1),
        ramp: (turn) => 1 - 4 * Math.abs(((turn + 0.75) % 1) - 0.5),
        sine: (turn) => Math.sin(2 * Math.PI * turn),
    };

    function explore(box, study) {
        const model = mapmore.models[study.key], { inputs, output, samples } = study, { STEP } = model;
        const signals = study.signals, names = inputs.map((one) => one.name);
        const own = inputs.filter((one) => !(one.name in signals) && one.name !== "time");
        const recorded = samples.columns, rate = 1 / (PER_PERIOD * STEP);
        const spans = Object.fromEntries(names.map((name) => [name, study.spans[name]]));
        const middle = (name) => (spans[name][0] + spans[name][1]) / 2;

        const driven = choice("Input", own.map((one) => [one.name, words(one.name)]), (own.find((one) => one.name === names[study.along]) ?? own[0] ?? { name: "" }).name, () => chosen());
        const shape = choice("Course", [["steps", "steps"], ["ramp", "ramps"], ["sine", "sine"], ["chirp", "chirp"], ["record", "the record's own"]],
            "sine", () => changed());
        const offset = knob("offset", "", [0, 1], 0, () => changed());
        const amplitude = knob("amplitude", "", [0, 1], 0, () => changed());
        const frequency = knob("frequency", "Hz", [rate / 20, rate * 5], rate, () => changed());
        const rest = Object.fromEntries(own.map((one) => [one.name, knob(words(one.name), one.unit, wider(spans[one.name], 0.15), middle(one.name), () => changed())]));
        const reading = element("output", { className: "reading" });
        const key = element("span", { className: "key held" }, `measured, ${samples.name}${samples.held ? ", held out" : ""}`);
        const knobs = element("div", { className: "knobs" });
        box.append(element("div", { className: "choices" }, driven.row, shape.row), knobs, reading, element("div", { className: "legend" },
            element("span", { className: "key" }, "model, free run"), key));
        const row = element("div", { className: "two" });
        box.append(row);
        const overTime = chart(row, `${words(output.name)} over time`, 300), loop = chart(row, `${words(output.name)} over the input: the loop`, 300);

        /** Every input at every sample; what follows from another input is made of differences. */
        function courses(count, course) {
            const columns = {};
            for (const one of own) columns[one.name] = one.name === driven.value ? course : Array(count).fill(rest[one.name].value);
            for (const [name, { kind, of, factor }] of Object.entries(signals)) {
                const x = columns[of] ?? Array(count).fill(0);
                const change = x.map((value, k) => (k ? (value - x[k - 1]) / STEP : 0) * factor);
                columns[name] = kind === "rate" ? change : change.map(Math.sign);
            }
            if (names.includes("time")) columns.time = course.map((_, k) => k * STEP);
            return columns;
        }

        /** The record's inputs at the model's own steps, by straight lines. */
        function record() {
            const { time } = recorded, count = Math.min(MOST, Math.floor((time[time.length - 1] - time[0]) / STEP + 1.5));
            const columns = Object.fromEntries([...names, output.name].map((name) => [name, []]));
            for (let k = 0, j = 0; k < count; k += 1) {
                const t = time[0] + k * STEP;
                while (j < time.length - 2 && time[j + 1] < t) j += 1;
                const share = Math.min(1, Math.max(0, (t - time[j]) / (time[j + 1] - time[j])));
                for (const name of Object.keys(columns)) {
                    const [a, b] = [recorded[name][j], recorded[name][j + 1]];
                    columns[name].push(a === null || b === null ? null : a + share * (b - a));
                }
            }
            return columns;
        }

        function run(columns, count, measured) {
            const s = model.reset(), y = Array(count), start = recorded[output.name].find((one) => one !== null) ?? 0;
            let beyond = 0;
            for (let k = 0; k < count; k += 1) {
                const x = names.map((name) => columns[name][k] ?? NaN);
                y[k] = model.step(s, ...x);
                if (model.measured && Number.isNaN(y[k])) model.measured(s, measured?.[k] ?? start);
                if (model.outsideRange(...x)) beyond += 1;
            }
            return { y, beyond };
        }

        function chosen() {
            const name = driven.value, quantity = own.find((one) => one.name === name);
            if (quantity) {
                const [low, high] = spans[name], width = high - low || 1;
                for (const [one, ends, start] of [[offset, wider([low, high], 0.15), middle(name)], [amplitude, [0, 0.65 * width], 0.4 * width]]) {
                    const slider = one.row.querySelector("input[type=range]");
                    [slider.min, slider.max, slider.step] = [ends[0], ends[1], width / 500].map(String);
                    one.row.lastChild.textContent = quantity.unit;
                    one.set(start);
                }
            }
            knobs.replaceChildren(offset.row, amplitude.row, frequency.row, ...own.filter((one) => one.name !== name).map((one) => rest[one.name].row));
            changed();
        }

        function changed() {
            const ofRecord = shape.value === "record", f = Math.max(frequency.value, 1e-9), duration = PERIODS / f;
            let count = Math.min(MOST, Math.max(2, Math.round(duration / STEP))), columns, measured = null;
            if (ofRecord) {
                columns = record();
                measured = columns[output.name];
                count = measured.length;
            } else {
                const course = Array.from({ length: count }, (_, k) => {
                    const t = k * STEP, turn = shape.value === "chirp" ? f * t * (0.1 + (0.45 * t) / duration) : f * t;
                    return offset.value + amplitude.value * (SHAPES[shape.value] ?? SHAPES.sine)(turn);
                });
                columns = courses(count, course);
            }
            const { y, beyond } = run(columns, count, measured), along = driven.value;
            const t = Array.from({ length: count }, (_, k) => k * STEP), still = Math.min(MOST, Math.round(REST / STEP));
            const settled = run(courses(still, Array(still).fill(offset.value)), still, null).y[still - 1];
            const seconds = still === MOST ? still * STEP : REST;
            const errors = (measured ?? []).map((one, k) => (one === null ? NaN : y[k] - one)).filter(Number.isFinite);
            const rmse = Math.sqrt(errors.reduce((sum, one) => sum + one * one, 0) / errors.length);
            knobs.hidden = ofRecord;
            reading.replaceChildren(
                element("strong", {}, ofRecord ? `RMSE ${withUnit(rmse, output)}` : `${words(output.name)} = ${withUnit(settled, output)}`),
                element("span", { className: "slope" }, ofRecord ? `along ${samples.name}, in free run` : `at rest after ${Number(seconds.toPrecision(3))} s${along ? ` at the offset of ${words(along)}` : ""}`),
                beyond ? element("span", { className: "beyond" }, `${Math.round((100 * beyond) / count)} % of the course lies beyond the training range`) : "",
                y.some(Number.isNaN) ? element("span", { className: "slope" }, "no value before there is history, and where the run diverges") : "");
            reading.dataset.value = String(ofRecord ? rmse : settled);
            const layers = (x) => [...(measured ? [{ kind: "line", x, y: measured, color: "--held", width: 1.2 }] : []), { kind: "line", x, y, color: "--model", width: 1.8 }];
            overTime.show("Time (s)", axisLabel(output), [0, t[count - 1]], layers(t));
            key.hidden = !ofRecord;
            loop.holder.hidden = !along;
            if (along) {
                const x = columns[along], quantity = own.find((one) => one.name === along);
                loop.show(axisLabel(quantity), axisLabel(output), wider(rangeOf(x), 0.05), layers(x));
            }
        }

        chosen();
    }

    mapmore.exploreRunning = explore;
})();
