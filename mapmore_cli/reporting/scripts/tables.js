// Tables sort by a click on a heading, and are saved as CSV; figures are saved as SVG, PNG or CSV;
// what has `data-copy` is copied by its button. Without scripts, everything is as it was.
(() => {
  "use strict";
  const { element, button, copier } = mapmore;
  const CSV = "text/csv", SVG = "image/svg+xml";

  function save(name, content, type) {
    const href = URL.createObjectURL(new Blob([content], { type }));
    element("a", { href, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(href), 1000);
  }

  /** A small button that saves something in a format. */
  const saver = (format, what, act) => (
    button(format, act, { className: "save", "aria-label": `Save ${what} as ${format}` }));

  // Tables
  // ----------------------------------------------------------------------------------------------

  /** The number in a cell; an empty one is no zero. */
  function numberOf(text) {
    const plain = text.replace(/\u2212/g, "-").replace(/[\s\u00a0]/g, "");
    return plain ? Number(plain) : NaN;
  }

  /** Sort by a column: as numbers where all that it has are numbers; what is empty comes last. */
  function sort(table, column, heading) {
    const up = heading.getAttribute("aria-sort") !== "ascending", sign = up ? 1 : -1;
    for (const other of table.querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", up ? "ascending" : "descending");
    const rows = [...table.tBodies[0].rows].map((row) => {
      const cell = row.cells[column], text = cell?.dataset.sort ?? cell?.textContent ?? "";
      return { row, text, number: numberOf(text), empty: /^[\s\u2013]*$/.test(text) };
    });
    const numeric = rows.every(({ number, empty }) => empty || !Number.isNaN(number));
    rows.sort((one, two) => {
      if (one.empty || two.empty) return Number(one.empty) - Number(two.empty);
      if (numeric) return sign * (one.number - two.number);
      return sign * one.text.localeCompare(two.text, undefined, { numeric: true });
    });
    table.tBodies[0].append(...rows.map(({ row }) => row));
  }

  function csvOf(table) {
    const cell = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const line = (row) => [...row.cells].map((one) => cell(one.textContent.trim())).join(",");
    return `${[...table.rows].map(line).join("\n")}\n`;
  }

  for (const table of document.querySelectorAll("table")) {
    const title = table.caption?.textContent;
    [...(table.tHead?.rows[0].cells ?? [])].forEach((heading, column) => {
      if (heading.classList.contains("choose")) return;
      const inner = button("", () => sort(table, column, heading), { className: "sort" });
      inner.append(...heading.childNodes);
      heading.append(inner);
    });
    if (!title) continue;
    const file = () => save(`${table.dataset.name || "table"}.csv`, csvOf(table), CSV);
    table.caption.append(" ", saver("CSV", `the table ${title}`, file));
  }

  // Figures
  // ----------------------------------------------------------------------------------------------

  const sizeOf = (svg) => (
    (svg.getAttribute("viewBox") || "0 0 500 300").split(/[\s,]+/).map(Number).slice(2));

  /** One SVG of a figure: the legend, line by line, above its panels, in their columns. */
  function whole(figure) {
    const outer = (svg) => !svg.parentElement.closest("svg");
    const parts = [...figure.querySelectorAll("svg")].filter(outer);
    if (parts.length === 1) return parts[0];
    const columns = Number(figure.querySelector(".panels")?.getAttribute("data-columns") || 1);
    const first = parts.find((one) => one.classList.contains("panel"));
    const width = columns * sizeOf(first)[0];
    const made = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    let [x, y, line] = [0, 0, 0];
    for (const part of parts) {
      const [wide, high] = sizeOf(part), full = x + wide > width + 1;
      if (x > 0 && (full || (part === first && line < high))) [x, y] = [0, y + line];
      line = high;
      const copy = /** @type {Element} */ (part.cloneNode(true));
      const place = Object.entries({ x, y, width: wide, height: high });
      for (const [key, value] of place) copy.setAttribute(key, String(value));
      made.append(copy);
      x += wide + (part.classList.contains("panel") ? 0 : 6);
    }
    made.setAttribute("viewBox", `0 0 ${width} ${y + line}`);
    made.setAttribute("width", String(width * 1.8));
    made.setAttribute("height", String((y + line) * 1.8));
    return made;
  }

  const textOf = (svg) => new XMLSerializer().serializeToString(svg);

  function savePng(svg, name) {
    const picture = new Image(), [width, height] = sizeOf(svg);
    picture.onload = () => {
      const canvas = element("canvas", { width: width * 4, height: height * 4 });
      const pen = canvas.getContext("2d");
      pen.fillStyle = "#fff";
      pen.fillRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(picture, 0, 0, canvas.width, canvas.height);
      canvas.toBlob((blob) => blob && save(name, blob, blob.type));
    };
    picture.src = `data:${SVG};charset=utf-8,${encodeURIComponent(textOf(svg))}`;
  }

  for (const figure of document.querySelectorAll("figure[data-name]")) {
    if (!figure.querySelector("svg")) continue;
    const name = figure.getAttribute("data-name"), what = `the figure ${name}`;
    const numbers = figure.querySelector("pre.numbers")?.textContent;
    figure.append(element("div", { className: "saves" },
      saver("SVG", what, () => save(`${name}.svg`, textOf(whole(figure)), SVG)),
      saver("PNG", what, () => savePng(whole(figure), `${name}.png`)),
      ...(numbers ? [saver("CSV", what, () => save(`${name}.csv`, numbers, CSV))] : [])));
  }

  for (const code of document.querySelectorAll("[data-copy]")) code.after(" ", copier(code));
})();
