// A click on a heading sorts a table. Buttons save tables as CSV, save figures as SVG, PNG or CSV,
// and copy texts with `data-copy`. Without scripts, the page is complete but has none of these.
import { button, element } from "./elements.js";

function save(name, content) {
  const href = URL.createObjectURL(new Blob([content]));
  element("a", { href, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(href), 1000);
}

/** Return a small button that saves something in a format. */
const saver = (format, what, act) => (
  button(format, act, { className: "save", "aria-label": `Save ${what} as ${format}` }));

/** Sort by a column, as numbers if all its cells are numbers; empty cells come last. */
function sort(table, column, heading) {
  const up = heading.getAttribute("aria-sort") !== "ascending", sign = up ? 1 : -1;
  for (const other of table.querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
  heading.setAttribute("aria-sort", up ? "ascending" : "descending");
  const rows = [...table.tBodies[0].rows].map((row) => {
    const cell = row.cells[column], text = cell?.dataset.sort ?? cell?.textContent ?? "";
    const number = Number(text.replace(/\u2212/g, "-").replace(/\s/g, ""));
    return { row, text, number, empty: /^[\s\u2013]*$/.test(text) };
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
  const file = () => save(`${table.dataset.name || "table"}.csv`, csvOf(table));
  table.caption.append(" ", saver("CSV", `the table ${title}`, file));
}

/** Return one SVG of a figure, joined from its parts, which know their places in it. */
function whole(figure) {
  const panels = figure.querySelector(".panels");
  if (!panels) return figure.querySelector("svg");
  const made = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  const parts = [...panels.querySelectorAll("[data-place]")];
  for (const [of, svg] of [[panels, made], ...parts.map((part) => [part, part.cloneNode(true)])]) {
    const place = Object.entries(JSON.parse(of.dataset.place));
    for (const [name, value] of place) svg.setAttribute(name, value);
    if (svg !== made) made.append(svg);
  }
  return made;
}

const textOf = (svg) => new XMLSerializer().serializeToString(svg);

function savePng(svg, name) {
  const picture = new Image(), { width, height } = svg.viewBox.baseVal;
  picture.onload = () => {
    const canvas = element("canvas", { width: width * 4, height: height * 4 });
    const pen = canvas.getContext("2d");
    pen.fillStyle = "#fff";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(picture, 0, 0, canvas.width, canvas.height);
    canvas.toBlob((blob) => blob && save(name, blob));
  };
  picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(textOf(svg))}`;
}

for (const figure of document.querySelectorAll("figure[data-name]")) {
  const name = figure.getAttribute("data-name"), what = `the figure ${name}`;
  const numbers = figure.querySelector("pre.numbers")?.textContent;
  figure.append(element("div", { className: "saves" },
    saver("SVG", what, () => save(`${name}.svg`, textOf(whole(figure)))),
    saver("PNG", what, () => savePng(whole(figure), `${name}.png`)),
    ...(numbers ? [saver("CSV", what, () => save(`${name}.csv`, numbers))] : [])));
}

for (const text of document.querySelectorAll("[data-copy]")) {
  const copier = button("Copy", () => {
    getSelection().selectAllChildren(text);
    document.execCommand("copy"); // a page from a file may have no navigator.clipboard
    copier.textContent = "Copied";
    setTimeout(() => { copier.textContent = "Copy"; }, 2000);
  }, { className: "save" });
  text.after(" ", copier);
}
