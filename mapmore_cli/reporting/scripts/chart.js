// Charts with axes and zoom by uPlot. A chart has layers, which are painted in their order.

/** Return the smallest and largest finite number, moved apart by a share of their distance. */
export function rangeOf(numbers, share = 0) {
  const known = numbers.filter(Number.isFinite);
  if (!known.length) return [0, 1];
  const [low, high] = [Math.min, Math.max].map((of) => known.reduce((one, two) => of(one, two)));
  const more = share * (high - low || Math.abs(low) || 1);
  return [low - more, high + more];
}

/** Return the ends of the y axis. Layers that are `free` at most double it to each side. */
function heightOf(layers) {
  const heights = (free) => layers.filter((one) => Boolean(one.free) === free)
    .flatMap((one) => [...one.y, ...(one.y2 ?? [])]);
  const [low, high] = rangeOf(heights(false)), room = high - low;
  const [least, most] = rangeOf([low, high, ...heights(true)]);
  return rangeOf([Math.max(least, low - room), Math.min(most, high + room)], 0.06);
}

/** Draw a line through points; a point without a value interrupts the line. */
function trace(pen, xs, ys) {
  let drawing = false;
  ys.forEach((y, k) => {
    if (drawing) pen.lineTo(xs[k], y);
    else pen.moveTo(xs[k], y);
    drawing = Number.isFinite(y);
  });
}

/** Paint a layer; `px` and `py` convert its points to pixels. */
function paint(pen, layer, px, py) {
  const ratio = window.devicePixelRatio || 1, width = (layer.width ?? 2) * ratio;
  const place = (values) => values.map((y) => (y === null ? NaN : py(y)));
  const xs = layer.x.map(px), ys = place(layer.y), corner = 1.1 * width;
  pen.lineWidth = width;
  pen.setLineDash((layer.dash ?? []).map((x) => x * ratio));
  pen.globalAlpha = layer.kind === "band" ? 0.2 : 1;
  pen.beginPath();
  if (layer.kind === "dots") {
    ys.forEach((y, k) => pen.rect(xs[k] - corner, y - corner, 2 * corner, 2 * corner));
  } else if (layer.kind === "line") trace(pen, xs, ys);
  else trace(pen, [...xs, ...xs.toReversed()], [...ys, ...place(layer.y2).toReversed()]);
  return layer.kind === "line" ? pen.stroke() : pen.fill();
}

/**
 * Make a chart in an element of the page. Return a function that shows layers
 * `{kind: "line" | "dots" | "band", x, y, y2, color, dash, width, free}`, whose x need not be
 * sorted, and that calls `clicked` with the place of a click.
 */
export function chart(holder) {
  let shown = "", labels = ["", ""], layers = [], limits = [[0, 1], [0, 1]], act = null;
  const size = () => ({ width: holder.clientWidth || 300, height: holder.clientHeight || 300 });
  const colour = (name) => getComputedStyle(holder).getPropertyValue(name).trim();
  const grid = { stroke: () => colour("--grid"), width: 1 };
  const axis = (k) => ({
    label: () => labels[k], stroke: () => colour("--ink"), grid, ticks: grid,
    size: [44, 62][k], font: "12px sans-serif", labelFont: "13px sans-serif",
  });

  function draw({ ctx: pen, bbox: { left, top, width, height }, valToPos }) {
    pen.save();
    pen.beginPath();
    pen.rect(left, top, width, height);
    pen.clip();
    const [px, py] = ["x", "y"].map((key) => (value) => valToPos(value, key, true));
    for (const layer of layers) {
      pen.strokeStyle = pen.fillStyle = colour(layer.color);
      paint(pen, layer, px, py);
    }
    pen.restore();
  }

  const across = { time: false, range: (_plot, low, high) => [low, high] };
  const plot = new uPlot({
    ...size(), legend: { show: false }, cursor: { y: false }, axes: [axis(0), axis(1)],
    scales: { x: across, y: { range: () => limits[1] } },
    series: [{}, { stroke: "transparent", width: 0, points: { show: false } }],
    hooks: { draw: [draw] },
  }, limits, holder);

  /** Show layers over an x axis with these ends; a zoom stays until the axis changes. */
  function show(x, y, ends, next, clicked) {
    const frame = String([x, y, ends]), same = shown === frame;
    [shown, layers, labels, limits, act] = [frame, next, [x, y], [ends, heightOf(next)], clicked];
    plot.setData(limits, !same);
    if (same) plot.setScale("y", { min: limits[1][0], max: limits[1][1] });
  }

  plot.over.addEventListener("click", ({ offsetX, offsetY }) => (
    act?.(plot.posToVal(offsetX, "x"), plot.posToVal(offsetY, "y"))));
  new ResizeObserver(() => plot.setSize(size())).observe(holder);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plot.redraw());
  return show;
}
