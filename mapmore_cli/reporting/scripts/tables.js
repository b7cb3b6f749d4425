"use strict";
/* Tables sort by a click on a heading, and are saved as CSV; figures are saved as SVG, PNG or CSV;
   what has `data-copy` is copied by its button. Without scripts, everything is as it was. */
(() => {
  /** @param {string} text */
  const numberOf = (text) => {
    const plain = text.replace(/\u2212/g, "-").replace(/[\s\u00a0]/g, "");
    return plain ? Number(plain) : parseFloat(plain); // an empty cell is no zero
  };

  /** @param {string} name @param {Blob} blob */
  const save = (name, blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  };

  /** @param {string} words @param {string} about @param {() => void} act */
  const button = (words, about, act) => {
    const made = document.createElement("button");
    made.type = "button";
    made.className = "save";
    made.textContent = words;
    made.setAttribute("aria-label", about);
    made.addEventListener("click", act);
    return made;
  };

  /** @param {string[]} cells */
  const line = (cells) =>
    cells.map((cell) => (/[",\n]/.test(cell) ? `"${cell.replace(/"/g, '""')}"` : cell)).join(",");

  /** @param {HTMLTableElement} table @param {number} column @param {HTMLElement} heading */
  const sort = (table, column, heading) => {
    const body = table.tBodies[0];
    const up = heading.getAttribute("aria-sort") !== "ascending";
    for (const other of table.querySelectorAll("th[aria-sort]")) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", up ? "ascending" : "descending");
    const rows = [...body.rows].map((row) => {
      const words = row.cells[column] ? row.cells[column].textContent || "" : "";
      return { row, words, number: numberOf(words) };
    });
    const numeric = rows.every(({ words, number }) => /^[\s\u2013]*$/.test(words) || !isNaN(number));
    rows.sort((one, two) => {
      if (!numeric) return (up ? 1 : -1) * one.words.localeCompare(two.words, undefined, { numeric: true });
      if (isNaN(one.number) || isNaN(two.number)) return Number(isNaN(one.number)) - Number(isNaN(two.number));
      return (up ? 1 : -1) * (one.number - two.number);
    });
    body.append(...rows.map(({ row }) => row));
  };

  for (const table of document.querySelectorAll("table")) {
    const headings = table.tHead ? [...table.tHead.rows[0].cells] : [];
    headings.forEach((heading, column) => {
      const inner = document.createElement("button");
      inner.type = "button";
      inner.className = "sort";
      inner.append(...heading.childNodes);
      inner.addEventListener("click", () => sort(table, column, heading));
      heading.append(inner);
    });
    if (!table.caption) continue;
    const title = table.caption.textContent || "table";
    const csv = () => {
      const rows = [...table.rows].map((row) => line([...row.cells].map((cell) => (cell.textContent || "").trim())));
      save(`${table.dataset.name || "table"}.csv`, new Blob([rows.join("\n") + "\n"], { type: "text/csv" }));
    };
    table.caption.append(" ", button("CSV", `Save the table ${title} as CSV`, csv));
  }

  /** @param {Element} svg */
  const sizeOf = (svg) => (svg.getAttribute("viewBox") || "0 0 500 300").split(/[\s,]+/).map(Number).slice(2);

  /** One SVG of a figure: the legend, line by line, above its panels, in their columns.
   * @param {Element} figure */
  const whole = (figure) => {
    const parts = [...figure.querySelectorAll("svg")].filter((svg) => !svg.parentElement?.closest("svg"));
    if (parts.length === 1) return parts[0];
    const columns = Number(figure.querySelector(".panels")?.getAttribute("data-columns") || 1);
    const panels = parts.filter((svg) => svg.classList.contains("panel"));
    const width = columns * sizeOf(panels[0])[0];
    const made = document.createElementNS("http://www.w3.org/2000/svg", "svg");
    let [x, y, line] = [0, 0, 0];
    for (const svg of parts) {
      const [wide, high] = sizeOf(svg);
      const panel = svg.classList.contains("panel");
      if (x > 0 && (x + wide > width + 1 || (svg === panels[0] && line < sizeOf(svg)[1]))) [x, y] = [0, y + line];
      line = high;
      const copy = /** @type {Element} */ (svg.cloneNode(true));
      Object.entries({ x, y, width: wide, height: high }).forEach(([key, value]) => copy.setAttribute(key, String(value)));
      made.append(copy);
      x += wide + (panel ? 0 : 6);
    }
    made.setAttribute("viewBox", `0 0 ${width} ${y + line}`);
    made.setAttribute("width", String(width * 1.8));
    made.setAttribute("height", String((y + line) * 1.8));
    return made;
  };

  /** @param {Element} svg */
  const textOf = (svg) => new XMLSerializer().serializeToString(svg);

  /** @param {Element} svg @param {string} name */
  const png = (svg, name) => {
    const picture = new Image();
    const [width, height] = sizeOf(svg);
    picture.onload = () => {
      const canvas = document.createElement("canvas");
      canvas.width = width * 4;
      canvas.height = height * 4;
      const pen = canvas.getContext("2d");
      if (!pen) return;
      pen.fillStyle = "#fff";
      pen.fillRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(picture, 0, 0, canvas.width, canvas.height);
      canvas.toBlob((blob) => blob && save(`${name}.png`, blob));
    };
    picture.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(textOf(svg))}`;
  };

  for (const figure of document.querySelectorAll("figure[data-name]")) {
    const name = figure.getAttribute("data-name") || "figure";
    if (!figure.querySelector("svg")) continue;
    const row = document.createElement("div");
    row.className = "saves";
    row.append(
      button("SVG", `Save the figure ${name} as SVG`, () => save(`${name}.svg`, new Blob([textOf(whole(figure))], { type: "image/svg+xml" }))),
      button("PNG", `Save the figure ${name} as PNG`, () => png(whole(figure), name)),
    );
    const numbers = figure.querySelector("pre.numbers");
    if (numbers) {
      const csv = () => save(`${name}.csv`, new Blob([numbers.textContent || ""], { type: "text/csv" }));
      row.append(button("CSV", `Save the numbers of the figure ${name} as CSV`, csv));
    }
    figure.append(row);
  }

  for (const code of document.querySelectorAll("[data-copy]")) {
    const copy = button("copy", `Copy ${code.getAttribute("data-copy")}`, async () => {
      const range = document.createRange();
      range.selectNodeContents(code);
      const selection = getSelection();
      if (selection) {
        selection.removeAllRanges();
        selection.addRange(range);
      }
      try {
        await navigator.clipboard.writeText(code.textContent || "");
      } catch {
        document.execCommand("copy"); // a page from a file has no clipboard in some browsers
      }
      copy.textContent = "copied";
    });
    code.after(" ", copy);
  }
})();
