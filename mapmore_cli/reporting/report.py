"""Write a report: figures, tables, and one self-contained HTML page that needs no network."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.foreign import csv_cell
from mapmore_cli.domain.scores import deciding
from mapmore_cli.reporting.competitors import printed_competitors
from mapmore_cli.reporting.explore import explored, uncomputed_segments
from mapmore_cli.reporting.figures.drawing import (
    SVG_PROLOGUE,
    Drawing,
    Panel,
    RenderedFigure,
    Values,
    compose,
    drawings,
    render_figure,
    to_bytes,
)
from mapmore_cli.reporting.figures.panels import evenly
from mapmore_cli.reporting.figures.sketched import sketched
from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.fit_tables import training_rmse
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.order import FIGURES, FILES_ALONE
from mapmore_cli.reporting.score_tables import scored, verdict_sentence
from mapmore_cli.reporting.scripts import joined, json_text, scripts, text_of
from mapmore_cli.reporting.sections import all_tables, sections_of, shown_by
from mapmore_cli.reporting.table import (
    Table,
    environment,
    number_text,
    rows_to_csv,
    to_csv,
    to_latex,
)

TABLE_FILES: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "tex": to_latex}
"""Function that returns a table as text, for each file format."""

MOST_ROWS = 400
"""Largest number of rows of a table on the page."""


Figures = Mapping[str, Sequence[RenderedFigure]]
"""The figures of an output, by section."""


def render_page(
    inputs: ReportInputs, figures: Figures, others: Sequence[tuple[ReportInputs, Figures]] = ()
) -> str:
    """Return the HTML of a page with all outputs of a run, made from the template
    `templates/page.html`. `figures` are the figures of the first output, and `others` are the other
    outputs with their figures. All texts of the user are escaped.
    """
    pages = ((inputs, figures), *others)
    outputs = [_words_of(*page) for page in pages]
    for output in outputs[1:]:  # texts about the whole run are shown only once, at the first output
        output["alerts"] = [
            alert for alert in output["alerts"] if alert not in outputs[0]["alerts"]
        ]
    known = explored([output_inputs for output_inputs, _ in pages]) if inputs.explore else None
    texts, words = [joined("tables.js")], {"data": "", "uplot_css": ""}
    if known is not None:
        for output, study in zip(outputs, known.outputs, strict=True):
            output["explored"] = study
        texts = [text_of("uplot.js"), known.code, joined("tables.js", "explore.js")]
        data = json_text({"explore": known.outputs})
        words = {"data": data, "uplot_css": text_of("uplot.css")}
    template = environment().get_template("page.html")
    return template.render(
        outputs=outputs,
        head=lambda table: table.head(MOST_ROWS),
        scripts=scripts(texts),
        **words,
    )


def _words_of(inputs: ReportInputs, figures: Figures) -> dict[str, Any]:
    """Return the variables of the template of a page for one output, by name."""
    scores, table = inputs.validation.scores, inputs.validation.each[0].table
    known = (inputs.own, scored(table, inputs.dataset), inputs.failed, table.alert)
    return {
        "inputs": inputs,
        "explored": None,
        "uncomputed_segments": uncomputed_segments(inputs.model) if inputs.explore else 0,
        "verdict": verdict_sentence(scores, *known, inputs.validation.warnings),
        "alerts": inputs.alerts,
        "competitors": printed_competitors(inputs),
        "has_own_section": shown_by(inputs.fit.body) is not None,
        "sections": sections_of(inputs),
        "figures": figures,
        "errors": {fit.id: training_rmse(fit) for fit in inputs.fit.segments},
        "own": next((row for row in deciding(scores) if row.model == inputs.own), None),
    }


def write_report(
    inputs: ReportInputs,
    out: Path,
    figures: Sequence[str],
    formats: Sequence[str],
    others: Sequence[ReportInputs] = (),
) -> None:
    """Write the report into the folder `out`. The same inputs always give the same bytes.

    - `figures`: names from `reporting.order.FIGURES`.
    - `formats`: file formats. `html` is the page `index.html`, whose figures are drawn without
      Matplotlib if possible. `svg` is a file for each figure, drawn by Matplotlib; the page then
      has the same figures. `csv` and `tex` are files in `tables/`. `pdf`, `png` and `pgf` are files
      in `panels/`, one for each panel of each figure. The panels are also written as CSV, and as
      SVG if `svg` is requested.
    - `others`: the other outputs of the run, which are shown on the same page.
    """
    # the folder is an output of the stage, even if no file is requested
    out.mkdir(parents=True, exist_ok=True)
    shown = [(output, _write_files(output, out, figures, formats)) for output in (inputs, *others)]
    if "html" in formats:
        _write_file(out / "index.html", render_page(*shown[0], shown[1:]))


def _write_files(
    inputs: ReportInputs, out: Path, figures: Sequence[str], formats: Sequence[str]
) -> Figures:
    """Write the files of one output beside the page, and return its figures."""
    for suffix, written in TABLE_FILES.items():
        for table in all_tables(inputs) if suffix in formats else ():
            # a table without rows is useless in a LaTeX document, so only its CSV file is written
            if suffix == "csv" or table.rows:
                path = out / "tables" / f"{inputs.prefix}{table.name}.{suffix}"
                _write_file(path, written(table))
    sections: dict[str, list[RenderedFigure]] = {}
    if set(formats) <= set(TABLE_FILES):
        return sections
    quick = set(formats) <= {"html", *TABLE_FILES}
    drawn = [
        (name, replace(drawing, name=f"{inputs.prefix}{drawing.name}"))
        for name in FIGURES
        if name in figures and not (quick and name in FILES_ALONE)
        for drawing in drawings(name, inputs)
    ]
    for name, drawing in drawn if {"html", "svg"} & set(formats) else ():
        figure = None if "svg" in formats else sketched(drawing, inputs.style)
        figure = figure or render_figure(drawing, inputs.style)
        if "svg" in formats:
            _write_file(out / f"{figure.name}.svg", SVG_PROLOGUE + figure.svg)
        figure = replace(figure, numbers=numbers_of(drawing) if "html" in formats else "")
        sections.setdefault(FIGURES[name], []).append(figure)
    if set(formats) & {"pdf", "png", "pgf"}:
        suffixes = sorted(set(formats) & {"pdf", "png", "pgf", "svg"})
        panels = [(drawing, panel) for _, drawing in drawn for panel in drawing.panels]
        _write_panels(panels, out / "panels", suffixes, inputs)
    return sections


def _write_panels(
    panels: Sequence[tuple[Drawing, Panel]],
    folder: Path,
    suffixes: Sequence[str],
    inputs: ReportInputs,
) -> None:
    """Write every panel to a separate file in each of the formats `suffixes`, and its data as
    CSV.
    """
    stems: set[str] = set()
    for drawing, panel in panels:
        # keep only characters that all operating systems accept in names of files
        words = re.sub(r"[^A-Za-z0-9=+-]+", "_", panel.key).strip("_")[:80]
        name = stem = f"{drawing.name}.{words}" if words else drawing.name
        number = 1
        # some file systems treat capital and small letters as equal
        while stem.lower() in stems:
            number += 1
            stem = f"{name}.{number}"
        stems.add(stem.lower())
        _write_file(folder / f"{stem}.csv", data_csv(panel.data))
        with figure_style(inputs.style):
            figure = compose(drawing, inputs.style, panel)
            for suffix in suffixes:
                data = to_bytes(figure, suffix, stem, drawing.alt)
                (folder / f"{stem}.{suffix}").write_bytes(data)


def data_csv(data: Mapping[str, Values], digits: int = 12) -> str:
    """Return columns of data as CSV. The keys of `data` are the headings. Numbers have `digits`
    significant digits, and a missing number is an empty field.
    """
    columns = (np.asarray(values, dtype=object) for values in data.values())
    cells = ([number_text(cell, digits) for cell in column] for column in columns)
    return rows_to_csv(map(csv_cell, data), zip(*cells, strict=True))


MOST_NUMBERS = 400
"""Largest number of samples of a panel whose numbers are stored in a page. Files contain the
numbers of all samples.
"""


def numbers_of(drawing: Drawing) -> str:
    """Return the data of a figure as CSV, with a block for each panel. Each block is evenly thinned
    to at most `MOST_NUMBERS` rows, and numbers have six significant digits.
    """
    blocks = []
    for panel in (panel for panel in drawing.panels if panel.data):
        columns = {name: np.asarray(values) for name, values in panel.data.items()}
        rows = evenly(len(next(iter(columns.values()))), MOST_NUMBERS)
        data: dict[str, Values] = {"panel": np.full(len(rows), panel.key, dtype=object)}
        blocks.append(data_csv(data | {name: columns[name][rows] for name in columns}, 6))
    return "\n".join(blocks)


def _write_file(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
