// "Explore" of a model with memory: it runs freely along an input of one's own, from rest.
(() => {
  "use strict";
  const { element, span, words, withUnit, axisLabel, rangeOf, wider, knob, choice } = mapmore;
  const PERIODS = 4, PER_PERIOD = 500, MOST = 20000, REST = 30;
  const SHAPES = {
    steps: (turn) => (turn % 1 < 0.5 ? 1 : -1),
    ramps: (turn) => 1 - 4 * Math.abs(((turn + 0.75) % 1) - 0.5),
    sine: (turn) => Math.sin(2 * Math.PI * turn),
    // from a tenth of the frequency to all of it
    chirp: (turn) => Math.sin(2 * Math.PI * turn * (0.1 + (0.45 * turn) / PERIODS)),
  };
  const RECORD = "record";
  const COURSES = [...Object.keys(SHAPES).map((one) => [one, one]), [RECORD, "the record's own"]];
  const RATES = "In a course of your own, rates and directions are plain differences of "
    + "neighbouring samples. Those of the recordings are of a window of samples, against noise.";

  function explore(box, study) {
    const model = mapmore.models[study.key], { inputs, output, samples, signals, spans } = study;
    const { STEP } = model, recorded = samples.columns, rate = 1 / (PER_PERIOD * STEP);
    const names = inputs.map((one) => one.name);
    const own = inputs.filter((one) => !(one.name in signals) && one.name !== "time");
    const middle = (name) => (spans[name][0] + spans[name][1]) / 2;

    const first = own.find((one) => one.name === names[study.along]) ?? own[0];
    const options = own.map((one) => [one.name, words(one.name)]);
    const driven = choice("Input", options, first?.name ?? "", () => chosen());
    const again = () => changed();
    const shape = choice("Course", COURSES, "sine", again);
    const offset = knob("offset", "", [0, 1], 0, again);
    const amplitude = knob("amplitude", "", [0, 1], 0, again);
    const frequency = knob("frequency", "Hz", [rate / 20, rate * 5], rate, again);
    const rest = Object.fromEntries(own.map(({ name, unit }) => (
      [name, knob(words(name), unit, wider(spans[name], 0.15), middle(name), again)])));
    const reading = element("output", { className: "reading" });
    const key = span("key held", `measured, ${samples.name}${samples.held ? ", held out" : ""}`);
    const others = mapmore.competitors(study.others, again);
    const knobs = element("div", { className: "knobs" });
    const row = element("div", { className: "two" });
    box.append(element("div", { className: "choices" }, driven.row, shape.row), knobs, reading,
      element("p", { className: "note", hidden: !Object.keys(signals).length }, RATES),
      element("div", { className: "legend" },
        span("key", "model, free run, dashed where it is extrapolated"), key, ...others.rows), row);
    const overTime = mapmore.chart(row, `${words(output.name)} over time`, 300);
    const loop = mapmore.chart(row, `${words(output.name)} over the input: the loop`, 300);

    /** Every input at every sample; what follows from another input is made of differences. */
    function courses(course) {
      const columns = { time: course.map((_, k) => k * STEP) };
      for (const { name } of own) {
        columns[name] = name === driven.value ? course : course.map(() => rest[name].value);
      }
      for (const [name, { kind, of, factor }] of Object.entries(signals)) {
        const x = columns[of] ?? course.map(() => 0);
        const change = x.map((value, k) => (k ? (value - x[k - 1]) / STEP : 0) * factor);
        columns[name] = kind === "rate" ? change : change.map(Math.sign);
      }
      return columns;
    }

    /** The record's inputs and output at the model's own steps, by straight lines. */
    function record() {
      const { time } = recorded, length = time[time.length - 1] - time[0];
      const count = Math.min(MOST, Math.floor(length / STEP + 1.5));
      const kept = [...names, output.name];
      const columns = Object.fromEntries(kept.map((name) => [name, Array(count)]));
      for (let k = 0, j = 0; k < count; k += 1) {
        const t = time[0] + k * STEP;
        while (j < time.length - 2 && time[j + 1] < t) j += 1;
        const share = Math.min(1, Math.max(0, (t - time[j]) / (time[j + 1] - time[j])));
        for (const [name, column] of Object.entries(columns)) {
          const [a, b] = [recorded[name][j], recorded[name][j + 1]];
          column[k] = a === null || b === null ? null : a + share * (b - a);
        }
      }
      return columns;
    }

    /**
     * The free run of a model along columns; before it has a history, it goes on from what was
     * measured. A competitor may have no memory.
     */
    function run(code, columns, count) {
      const s = code.reset?.(), y = Array(count), beyond = Array(count);
      const measured = columns[output.name];
      const start = recorded[output.name].find((one) => one !== null) ?? 0;
      for (let k = 0; k < count; k += 1) {
        const x = code.INPUTS.map((name) => columns[name][k] ?? NaN);
        y[k] = s ? code.step(s, ...x) : code.evaluate(...x);
        if (code.measured && Number.isNaN(y[k])) code.measured(s, measured?.[k] ?? start);
        beyond[k] = code.outsideRange(...x);
      }
      return { y, beyond };
    }

    /** Another input is driven: its knobs get its range. */
    function chosen() {
      const name = driven.value, quantity = own.find((one) => one.name === name);
      if (quantity) {
        const width = spans[name][1] - spans[name][0] || 1;
        offset.reach(wider(spans[name], 0.15), middle(name), quantity.unit);
        amplitude.reach([0, 0.65 * width], 0.4 * width, quantity.unit);
      }
      const others = own.filter((one) => one.name !== name).map((one) => rest[one.name].row);
      knobs.replaceChildren(offset.row, amplitude.row, frequency.row, ...others);
      changed();
    }

    function invented() {
      const f = Math.max(frequency.value, 1e-9), count = Math.round(PERIODS / (f * STEP));
      const length = Math.min(MOST, Math.max(2, count)), course = SHAPES[shape.value];
      const place = (k) => offset.value + amplitude.value * course(f * k * STEP);
      return courses(Array.from({ length }, (_, k) => place(k)));
    }

    function sayRest(y, share) {
      const count = Math.min(MOST, Math.round(REST / STEP));
      const still = courses(Array(count).fill(offset.value));
      const settled = run(model, still, count).y[count - 1];
      const seconds = Number((count * STEP).toPrecision(3));
      const where = driven.value ? ` at the offset of ${words(driven.value)}` : "";
      const outside = `${Math.round(100 * share)} % of the course lies beyond the training range`;
      const lost = Number.isNaN(y[y.length - 1]) ? "the run diverges: it ends without a value" : "";
      reading.replaceChildren(
        element("strong", {}, `${words(output.name)} = ${withUnit(settled, output)}`),
        span("slope", `at rest after ${seconds} s${where}`), span("beyond", share ? outside : ""),
        span("beyond", lost));
      reading.dataset.value = String(settled);
    }

    function sayError(y, measured) {
      const errors = y.map((one, k) => (measured[k] === null ? NaN : one - measured[k]));
      const rmse = mapmore.rootMeanSquare(errors.filter(Number.isFinite));
      reading.replaceChildren(element("strong", {}, `RMSE ${withUnit(rmse, output)}`),
        span("slope", `along ${samples.name}, in free run`));
      reading.dataset.value = String(rmse);
    }

    function changed() {
      const ofRecord = shape.value === RECORD, columns = ofRecord ? record() : invented();
      const measured = columns[output.name], count = Object.values(columns)[0].length;
      const { y, beyond } = run(model, columns, count), along = driven.value;
      if (ofRecord) sayError(y, measured);
      else sayRest(y, beyond.filter(Boolean).length / count);
      knobs.hidden = ofRecord;
      key.hidden = !ofRecord;
      loop.holder.hidden = !along;
      const drawn = others.on.map(({ look, code }) => (
        { ...look, y: run(code, columns, count).y }));
      const layers = (x) => [
        ...(ofRecord ? [{ kind: "line", x, y: measured, color: "--held", width: 1.2 }] : []),
        ...drawn.map((one) => ({ ...one, x })), ...mapmore.byRange(x, y, beyond, 1.8),
      ];
      const t = y.map((_, k) => k * STEP);
      overTime.show("Time (s)", axisLabel(output), [0, t[count - 1]], layers(t));
      if (along) {
        const x = columns[along], quantity = own.find((one) => one.name === along);
        const ends = wider(rangeOf(x), 0.05);
        loop.show(axisLabel(quantity), axisLabel(output), ends, layers(x));
      }
    }
    chosen();
  }

  mapmore.exploreRunning = explore;
})();
