// What "Explore" is built of: numbers as text, sliders, choices, competitors, and charts.
(() => {
  "use strict";
  const { element } = mapmore;
  const PALETTE = ["--other1", "--other2", "--other3", "--other4", "--other5"];

  const span = (className, text) => (
    element("span", { className, hidden: text === "" && className !== "" }, text));

  /** A number of four digits, without an exponent where that can be read. */
  function numberText(x) {
    if (!Number.isFinite(x)) return "no value";
    const size = Math.abs(x);
    let text = String(Number(x.toPrecision(4)));
    if (size !== 0 && (size < 1e-4 || size >= 1e6)) text = x.toExponential(3);
    else if (size >= 1000) text = x.toFixed(0);
    return text.replace("-", "−");
  }

  const digits = (x) => String(Number(x.toPrecision(5)));
  const words = (name) => name.replaceAll("_", " ");
  const withUnit = (x, quantity) => `${numberText(x)} ${quantity.unit}`.trim();
  const axisLabel = (quantity) => {
    const name = words(quantity.name);
    return `${name[0].toUpperCase()}${name.slice(1)} (${quantity.unit || "–"})`;
  };

  /** Least and greatest of some numbers; nulls and what is not finite are left out. */
  function rangeOf(numbers) {
    let low = Infinity, high = -Infinity;
    for (const x of numbers) {
      if (x === null || !Number.isFinite(x)) continue;
      if (x < low) low = x;
      if (x > high) high = x;
    }
    return low > high ? [0, 1] : [low, high];
  }

  const wider = ([low, high], share) => {
    const more = share * (high - low || Math.abs(low) || 1);
    return [low - more, high + more];
  };

  const evenly = ([low, high], count) => (
    Array.from({ length: count }, (_, k) => low + ((high - low) * k) / (count - 1)));
  const rootMeanSquare = (errors) => (
    Math.sqrt(errors.reduce((sum, one) => sum + one * one, 0) / errors.length));

  let labels = 0;

  /** A slider beside a number field: `row` for the page, `value` to ask or to set. */
  function knob(label, unit, ends, start, changed) {
    const id = `knob${(labels += 1)}`;
    let value = start;
    const slider = element("input", { type: "range", id });
    const about = { type: "number", step: "any", "aria-label": `${label} as a number` };
    const field = element("input", about);
    const set = (x) => {
      value = x;
      slider.value = String(x);
      field.value = digits(x);
    };
    slider.addEventListener("input", () => {
      value = Number(slider.value);
      field.value = digits(value);
      changed();
    });
    field.addEventListener("input", () => {
      if (field.value === "" || !Number.isFinite(Number(field.value))) return;
      value = Number(field.value);
      slider.value = String(value);
      changed();
    });
    const name = element("label", { htmlFor: id }, label), units = span("", unit);
    const row = element("div", { className: "knob" }, name, slider, field, units);
    /** Another range, and a value within it. */
    const reach = ([low, high], x, of) => {
      slider.min = String(low);
      slider.max = String(high);
      slider.step = String(Number(((high - low) / 500).toPrecision(2)));
      units.textContent = of;
      set(x);
    };
    reach(ends, start, unit);
    return { row, set, reach, get value() { return value; } };
  }

  /** A choice out of a few words. */
  function choice(label, options, start, changed) {
    const id = `choice${(labels += 1)}`;
    const select = element("select", { id });
    for (const [value, text] of options) select.append(element("option", { value }, text));
    select.value = start;
    select.addEventListener("change", changed);
    const row = element("div", { className: "choice" });
    row.append(element("label", { htmlFor: id }, label), select);
    return { row, get value() { return select.value; } };
  }

  /** Competitors that can be switched on, each with its look: `rows` for the legend, `on` now. */
  function competitors(others, changed) {
    const made = others.map((one, k) => {
      const color = PALETTE[k % PALETTE.length], dash = k < PALETTE.length ? [7, 3] : [2, 3];
      const box = element("input", { type: "checkbox" });
      box.addEventListener("change", changed);
      const sample = element("span", { className: "swatch" });
      sample.style.borderTop = `.28rem ${k < PALETTE.length ? "dashed" : "dotted"} var(${color})`;
      const row = element("label", { className: "tick" }, box, sample, one.title);
      const look = { kind: "line", color, dash, width: 1.6, free: true };
      return { box, row, look, code: mapmore.models[one.key] };
    });
    return {
      rows: made.map((one) => one.row),
      get on() { return made.filter((one) => one.box.checked); },
    };
  }

  /** Layers of the model: solid within the training range, dashed beyond it. */
  function byRange(x, y, beyond, width = 2) {
    const inside = y.map((one, k) => (beyond[k] ? null : one));
    const near = (k) => beyond[k] || beyond[k - 1] || beyond[k + 1];
    const outside = y.map((one, k) => (near(k) ? one : null));
    const look = { kind: "line", x, color: "--model", width };
    return [{ ...look, y: outside, dash: [5, 5] }, { ...look, y: inside }];
  }

  const dark = window.matchMedia("(prefers-color-scheme: dark)");

  /**
   * A chart of layers `{kind: "line" | "dots" | "band" | "at", x, y, y2, color, dash, width}`.
   * uPlot has the axes and the zoom; layers are painted in their order, x may run back and forth.
   */
  function chart(box, summary, height = 340) {
    const holder = element("div", { className: "chart", role: "img" });
    holder.setAttribute("aria-label", summary);
    box.append(holder);
    let plot = null, labelled = [], shown = "", layers = [], limits = [[0, 1], [0, 1]];
    const colour = (name) => getComputedStyle(holder).getPropertyValue(name).trim();

    function paint(u) {
      const { ctx } = u, ratio = window.devicePixelRatio || 1;
      const px = (x) => u.valToPos(x, "x", true), py = (y) => u.valToPos(y, "y", true);
      ctx.save();
      ctx.beginPath();
      ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
      ctx.clip();
      for (const layer of layers) {
        ctx.strokeStyle = ctx.fillStyle = colour(layer.color);
        ctx.lineWidth = (layer.width ?? 2) * ratio;
        ctx.setLineDash((layer.dash ?? []).map((x) => x * ratio));
        ctx.globalAlpha = layer.kind === "band" ? 0.2 : 1;
        ctx.beginPath();
        if (layer.kind === "at") {
          ctx.moveTo(px(layer.x), u.bbox.top);
          ctx.lineTo(px(layer.x), u.bbox.top + u.bbox.height);
          ctx.stroke();
        } else if (layer.kind === "dots") {
          const r = 2.2 * ratio;
          for (let k = 0; k < layer.x.length; k += 1) {
            if (layer.y[k] === null) continue;
            ctx.rect(px(layer.x[k]) - r, py(layer.y[k]) - r, 2 * r, 2 * r);
          }
          ctx.fill();
        } else {
          trace(ctx, layer, px, py);
        }
      }
      ctx.restore();
    }

    function trace(ctx, layer, px, py) {
      let drawing = false;
      for (let k = 0; k < layer.x.length; k += 1) {
        const y = layer.y[k];
        if (y === null || !Number.isFinite(y)) drawing = false;
        else if (drawing) ctx.lineTo(px(layer.x[k]), py(y));
        else ctx.moveTo(px(layer.x[k]), py(y));
        drawing = y !== null && Number.isFinite(y);
      }
      if (layer.kind === "line") return ctx.stroke();
      for (let k = layer.x.length - 1; k >= 0; k -= 1) {
        ctx.lineTo(px(layer.x[k]), py(layer.y2[k]));
      }
      return ctx.fill();
    }

    function build(x, y) {
      if (plot) plot.destroy();
      const axis = (label) => ({
        label, stroke: colour("--ink"), grid: { stroke: colour("--grid"), width: 1 },
        ticks: { stroke: colour("--grid") }, size: label === y ? 62 : 44,
        font: "12px sans-serif", labelFont: "13px sans-serif",
      });
      const across = { time: false, range: (_u, low, high) => [low, high] };
      plot = new uPlot({
        width: holder.clientWidth || 300, height, legend: { show: false }, cursor: { y: false },
        scales: { x: across, y: { range: () => limits[1] } }, axes: [axis(x), axis(y)],
        series: [{}, { stroke: "transparent", width: 0, points: { show: false } }],
        hooks: { draw: [paint] },
      }, [limits[0], limits[1]], holder);
      labelled = [x, y];
    }

    /** Show layers over an axis of these limits; a zoom stays as long as the axis does. */
    function show(x, y, ends, next) {
      layers = next;
      const scaling = next.filter((one) => one.kind !== "at" && !one.free);
      let [low, high] = rangeOf(scaling.flatMap((one) => [...one.y, ...(one.y2 ?? [])]));
      const free = next.flatMap((one) => (one.free ? one.y : []));
      const [least, most] = rangeOf([low, high, ...free]);
      const room = high - low; // what is free may double the scale to each side, and no more
      [low, high] = [Math.max(least, low - room), Math.min(most, high + room)];
      limits = [ends, wider([low, high], 0.06)];
      if (String(labelled) !== String([x, y])) build(x, y);
      else {
        const same = shown === String(ends);
        plot.setData([limits[0], limits[1]], !same);
        if (same) plot.setScale("y", { min: limits[1][0], max: limits[1][1] });
      }
      shown = String(ends);
    }

    new ResizeObserver(() => plot?.setSize({ width: holder.clientWidth, height })).observe(holder);
    dark.addEventListener("change", () => {
      const [x, y] = labelled;
      if (plot) build(x, y);
    });
    /** Call a function with the place on the axis that is clicked. */
    const whenClicked = (call) => {
      holder.onclick = (event) => {
        const left = holder.querySelector(".u-over").getBoundingClientRect().left;
        call(plot.posToVal(event.clientX - left, "x"));
      };
    };
    return { show, holder, whenClicked };
  }

  Object.assign(mapmore, { span, numberText, words, withUnit, axisLabel, knob, choice, chart });
  Object.assign(mapmore, { competitors, byRange, rangeOf, wider, evenly, rootMeanSquare });
})();
