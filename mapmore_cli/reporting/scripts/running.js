// "Explore" for a model with memory: a free run along a course of the inputs that is chosen.
import { chart, rangeOf } from "./chart.js";
import { byRange, competitors, controls, read, rootMeanSquare, span, withUnit }
  from "./controls.js";

const PERIODS = 4, MOST = 20000;
const SHAPES = {
  steps: (turn) => (turn % 1 < 0.5 ? 1 : -1),
  ramps: (turn) => 1 - 4 * Math.abs(((turn + 0.75) % 1) - 0.5),
  sine: (turn) => Math.sin(2 * Math.PI * turn),
  // from a tenth of the frequency to the whole frequency
  chirp: (turn) => Math.sin(2 * Math.PI * turn * (0.1 + (0.45 * turn) / PERIODS)),
};

export function exploreRunning(box, study) {
  const model = mapmore.models[study.key], { inputs, output, record, signals } = study;
  const { STEP } = model;
  const own = inputs.filter(({ name }) => !(name in signals) && name !== "time");
  const { values } = controls(box, () => changed());
  const reading = box.querySelector(".reading");
  const [overTime, loop] = [...box.querySelectorAll(".chart")].map(chart);

  /** Return all inputs at all samples; rates and directions are computed from differences. */
  function columnsOf(course) {
    const columns = { time: course.map((_, k) => k * STEP) };
    for (const { name } of own) {
      columns[name] = name === values.driven ? course : course.map(() => values[`input:${name}`]);
    }
    for (const [name, { kind, of, factor }] of Object.entries(signals)) {
      const x = columns[of] ?? course.map(() => 0);
      const change = x.map((value, k) => (k ? (value - x[k - 1]) / STEP : 0) * factor);
      columns[name] = kind === "rate" ? change : change.map(Math.sign);
    }
    return columns;
  }

  /** Return the columns of a periodic course of the driven input, of at most `MOST` samples. */
  function invented() {
    const shape = SHAPES[values.course], f = Math.max(values.frequency, 1e-9);
    const count = Math.min(MOST, Math.max(2, Math.round(PERIODS / (f * STEP))));
    const swing = values[`amplitude:${values.driven}`], offset = values[`input:${values.driven}`];
    const course = Array.from({ length: count }, (_, k) => offset + swing * shape(f * k * STEP));
    return columnsOf(course);
  }

  /**
   * Return the free run of a model along columns. As long as it lacks past values, it uses
   * measured ones. A competitor may have no memory.
   */
  function run(code, columns) {
    const s = code.reset?.(), measured = columns[output.name], y = [], beyond = [];
    const count = Object.values(columns)[0].length;
    for (let k = 0; k < count; k += 1) {
      const x = code.INPUTS.map((name) => columns[name][k] ?? NaN);
      y.push(s ? code.step(s, ...x) : code.evaluate(...x));
      if (code.measured && Number.isNaN(y[k])) code.measured(s, measured?.[k] ?? record.start);
      beyond.push(code.outsideRange(...x));
    }
    return { y, beyond };
  }

  function readRest(y, beyond) {
    const still = columnsOf(Array(record.rest).fill(values[`input:${values.driven}`]));
    const settled = run(model, still).y.at(-1);
    const share = Math.round((100 * beyond.filter(Boolean).length) / y.length);
    read(reading, settled, `${output.title} = ${withUnit(settled, output)}`,
      span("slope", record.at_rest), beyond.some(Boolean)
        && span("beyond", `${share} % of the course lies beyond the training range`),
      Number.isNaN(y.at(-1)) && span("beyond", "the run diverges: it ends without a value"));
  }

  function readError(y, measured) {
    const errors = y.map((one, k) => (measured[k] === null ? NaN : one - measured[k]));
    const rmse = rootMeanSquare(errors.filter(Number.isFinite));
    read(reading, rmse, `RMSE ${withUnit(rmse, output)}`,
      span("slope", `along ${record.name}, in free run`));
  }

  /** Show the controls of the driven input; none of them along a recording. */
  function offer(ofRecord) {
    for (const group of box.querySelectorAll("[data-input]")) {
      group.classList.toggle("driven", group.dataset.input === values.driven);
    }
    box.querySelector(".knobs").hidden = ofRecord;
    box.querySelector(".key.held").hidden = !ofRecord;
  }

  function changed() {
    const ofRecord = !(values.course in SHAPES), columns = ofRecord ? record.columns : invented();
    const { y, beyond } = run(model, columns), measured = columns[output.name];
    offer(ofRecord);
    if (ofRecord) readError(y, measured);
    else readRest(y, beyond);
    const others = competitors(study.others, values, (code) => run(code, columns));
    const layers = (x) => [
      ...(ofRecord ? [{ kind: "line", x, y: measured, color: "--held", width: 1.2 }] : []),
      ...others.map((one) => ({ ...one, x })), ...byRange(x, y, beyond, 1.8),
    ];
    const t = y.map((_, k) => k * STEP), driven = own.find(({ name }) => name === values.driven);
    overTime("Time (s)", output.label, [0, t.at(-1)], layers(t));
    if (!driven) return;
    const x = columns[driven.name];
    loop(driven.label, output.label, rangeOf(x, 0.05), layers(x));
  }
  changed();
}
