"use strict";
/* The page of all runs: a filter, and two runs beside each other. */
(() => {
  const data = JSON.parse(document.getElementById("runs")?.textContent || "[]");
  const table = /** @type {HTMLTableElement} */ (document.querySelector("table.sortable"));
  const filter = /** @type {HTMLInputElement} */ (document.getElementById("filter"));
  const count = /** @type {HTMLElement} */ (document.getElementById("count"));
  const place = /** @type {HTMLElement} */ (document.getElementById("comparison"));
  const rows = [...table.tBodies[0].rows];
  /** @type {HTMLInputElement[]} */
  const boxes = rows.map((row) => /** @type {HTMLInputElement} */ (row.querySelector("input")));

  const show = () => {
    const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const row of rows) {
      const text = (row.textContent || "").toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
      shown += row.hidden ? 0 : 1;
    }
    count.textContent = `${shown} of ${rows.length}`;
  };

  /** @param {string} tag @param {string} text @param {Element} within */
  const add = (tag, text, within) => {
    const made = document.createElement(tag);
    made.textContent = text;
    within.append(made);
    return made;
  };

  const compare = () => {
    const two = boxes.filter((box) => box.checked).map((box) => data[Number(box.value)]);
    place.hidden = two.length !== 2;
    place.replaceChildren();
    if (place.hidden) return;
    const made = document.createElement("table");
    const head = made.createTHead().insertRow();
    add("th", "model", head);
    for (const run of two) add("th", `${run.run}: ${run.target}, NRMSE [%]`, head);
    const body = made.createTBody();
    const models = [...new Set(two.flatMap((run) => Object.keys(run.nrmse)))];
    const most = Math.max(...two.flatMap((run) => /** @type {number[]} */ (Object.values(run.nrmse))), 1e-300);
    for (const model of models) {
      const row = body.insertRow();
      add("th", model, row);
      two.forEach((run, number) => {
        const cell = row.insertCell();
        const error = run.nrmse[model];
        if (error === undefined) return;
        const bar = add("span", "", cell);
        bar.className = number ? "bar second" : "bar";
        bar.style.width = `${(12 * error) / most}rem`;
        cell.append(` ${error.toFixed(2)}`);
      });
    }
    place.append(made);
  };

  /** @type {HTMLElement} */ (document.querySelector(".tools")).hidden = false;
  filter.addEventListener("input", show);
  for (const box of boxes) box.addEventListener("change", compare);
  const wanted = new URLSearchParams(location.hash.slice(1)).get("filter");
  if (wanted) filter.value = wanted;
  show();
})();
