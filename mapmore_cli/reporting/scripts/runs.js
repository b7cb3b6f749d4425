// The page of all runs: filter the runs, and compare two of them.
import { element } from "./elements.js";

const data = JSON.parse(document.getElementById("runs").textContent);
const filter = /** @type {HTMLInputElement} */ (document.getElementById("filter"));
const count = document.getElementById("count"), place = document.getElementById("comparison");
const rows = [...document.querySelector("table").tBodies[0].rows];
const boxes = rows.map((row) => row.querySelector("input"));

function show() {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  for (const row of rows) {
    const text = row.textContent.toLowerCase();
    row.hidden = !words.every((word) => text.includes(word));
  }
  count.textContent = `${rows.filter((row) => !row.hidden).length} of ${rows.length}`;
}

function compare() {
  const two = boxes.filter((box) => box.checked).map((box) => data[Number(box.value)]);
  place.hidden = two.length !== 2;
  if (place.hidden) return;
  const models = [...new Set(two.flatMap((run) => Object.keys(run.nrmse)))];
  const errors = two.flatMap((run) => models.map((model) => run.nrmse[model] ?? 0));
  const most = Math.max(...errors, 1e-300);
  const bar = (error) => element("span", { className: "bar", style: `--share: ${error / most}` });
  const cell = (error) => (
    element("td", {}, ...(error === undefined ? [] : [bar(error), ` ${error.toFixed(2)}`])));
  const head = two.map((run) => (
    element("th", { scope: "col" }, `${run.run}: ${run.target}, NRMSE [%]`)));
  const body = models.map((model) => element("tr", {}, element("th", { scope: "row" }, model),
    ...two.map((run) => cell(run.nrmse[model]))));
  place.replaceChildren(element("table", {},
    element("thead", {}, element("tr", {}, element("th", { scope: "col" }, "model"), ...head)),
    element("tbody", {}, ...body)));
}

document.querySelector(".tools").removeAttribute("hidden");
filter.addEventListener("input", show);
for (const box of boxes) box.addEventListener("change", compare);
filter.value = new URLSearchParams(location.hash.slice(1)).get("filter") ?? "";
show();
