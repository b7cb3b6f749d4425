"""Writes a report: figures, tables, and one self-contained HTML page without scripts and
network.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mapmore_cli.domain.scores import FIGURES
from mapmore_cli.reporting.figures.drawing import (
    SVG_PROLOGUE,
    WRITERS,
    Drawing,
    Panel,
    RenderedFigure,
    Values,
    compose,
    drawings,
    rendered,
)
from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.score_tables import verdict
from mapmore_cli.reporting.table import (
    SCREEN_SCALE,
    Table,
    csv_text,
    environment,
    number_text,
    to_csv,
    to_latex,
)
from mapmore_cli.reporting.tables import all_tables

LONG_TABLE = 40
"""Rows from which a table starts folded on the screen; it is always printed."""

TABLE_FILES: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "tex": to_latex}
"""What is written of a table, by format."""

PAPER = frozenset({"pdf", "png", "pgf"})
"""Formats of figures for print: with one of these, every panel is a file of its own, beside the
numbers that it was drawn from.
"""

LONGEST_STEM = 80
MOST_NUMBERS = 20_000
"""Rows of a figure's numbers beside the page; longer ones are written on demand (`mapmore figure
--data`).
"""


def render_page(
    inputs: ReportInputs, tables: Sequence[Table], figures: Mapping[str, Sequence[RenderedFigure]]
) -> str:
    """Return the page, from the template `templates/page.html`, with `figures` by section; every
    text of the user's is escaped.
    """
    template = environment().get_template("page.html")
    return template.render(
        inputs=inputs,
        verdict=verdict(inputs.validation.scores, inputs.own, inputs.target, inputs.failed),
        tables={table.name: table for table in tables},
        figures=figures,
        held_out=any(curve.held_out.any() for curve in inputs.dataset.curves),
        long_table=LONG_TABLE,
        scale=SCREEN_SCALE,
    )


def render_campaign(
    title: str,
    tables: Sequence[Table],
    figures: Sequence[RenderedFigure],
    pages: Mapping[str, str],
    failed: Mapping[str, str],
) -> str:
    """Return the page: `pages` are links by run, `failed` the messages of runs that did not end."""
    template = environment().get_template("campaign.html")
    return template.render(
        title=title, tables=tables, figures=figures, scale=SCREEN_SCALE, pages=pages, failed=failed
    )


def write_report(
    inputs: ReportInputs, out: Path, figures: Sequence[str], formats: Sequence[str]
) -> None:
    """Write the report into the folder `out`, byte for byte the same for the same inputs.

    - `figures`: names out of `domain.scores.FIGURES`.
    - `formats`: `html`: index.html, with the figures in it; `svg`: a file for each figure; `csv`,
      `tex`: tables/*, and with a page `csv`
      of what each figure was drawn from, numbers/*; `pdf`, `png`, `pgf`:
      panels/*, every panel of every figure in these formats (and as SVG where that is asked for
      too), and as CSV.
    """
    tables = all_tables(inputs)
    out.mkdir(parents=True, exist_ok=True)
    for suffix, text_of in TABLE_FILES.items():
        for table in tables if suffix in formats else ():
            if suffix == "csv" or table.rows:  # a document does not want a table of nothing
                _write(out / "tables" / f"{table.name}.{suffix}", text_of(table))
    if set(formats) <= set(TABLE_FILES):
        return
    drawn = [
        (name, drawing) for name in FIGURES if name in figures for drawing in drawings(name, inputs)
    ]
    if {"html", "svg"} & set(formats):
        sections: dict[str, list[RenderedFigure]] = {}
        for name, drawing in drawn:
            figure = rendered(drawing, inputs.style)
            if "csv" in formats:
                figure = _with_numbers(figure, drawing, out)
            if "svg" in formats:
                _write(out / f"{figure.name}.svg", SVG_PROLOGUE + figure.svg)
            sections.setdefault(FIGURES[name], []).append(figure)
        if "html" in formats:
            _write(out / "index.html", render_page(inputs, tables, sections))
    if PAPER & set(formats):
        _write_panels(
            [(drawing, panel) for _, drawing in drawn for panel in drawing.panels],
            out / "panels",
            formats,
            inputs,
        )


def _with_numbers(figure: RenderedFigure, drawing: Drawing, out: Path) -> RenderedFigure:
    """Write what a figure was drawn from beside the page, panel below panel, and return the figure
    with the name of the file.
    """
    sizes = [len(next(iter(panel.data.values()), ())) for panel in drawing.panels]
    if not 0 < sum(sizes) <= MOST_NUMBERS:
        return figure
    headings = dict.fromkeys(heading for panel in drawing.panels for heading in panel.data)
    table: dict[str, list[Any]] = {
        "panel": [
            panel.key
            for panel, size in zip(drawing.panels, sizes, strict=True)
            for _ in range(size)
        ]
    }
    for heading in headings:
        pairs = zip((panel.data.get(heading, ()) for panel in drawing.panels), sizes, strict=True)
        table[heading] = [
            value
            for values, size in pairs
            for value in (values if len(values) else [math.nan] * size)
        ]
    _write(out / "numbers" / f"{drawing.name}.csv", data_csv(table))
    return replace(figure, numbers=f"numbers/{drawing.name}.csv")


def _write_panels(
    panels: Sequence[tuple[Drawing, Panel]],
    folder: Path,
    formats: Sequence[str],
    inputs: ReportInputs,
) -> None:
    """Write every panel as a file of its own in every format of figures that is asked for, and the
    numbers behind it.
    """
    folder.mkdir(exist_ok=True)
    for stem, (drawing, panel) in zip(_stems(panels), panels, strict=True):
        _write(folder / f"{stem}.csv", data_csv(panel.data))
        with figure_style(inputs.style):
            figure = compose(drawing, inputs.style, panel)
            for suffix, written in WRITERS.items():
                if suffix in formats:
                    (folder / f"{stem}.{suffix}").write_bytes(written(figure, stem, drawing.alt))


def _stems(panels: Sequence[tuple[Drawing, Panel]]) -> Iterator[str]:
    """Yield a name for the files of every panel: of its figure and of what tells it from the
    others, in letters that any system takes.
    """
    taken: set[str] = set()
    for drawing, panel in panels:
        words = re.sub(r"[^A-Za-z0-9=+-]+", "_", panel.key).strip("_")[:LONGEST_STEM]
        stem = f"{drawing.name}.{words}" if words else drawing.name
        number = 2
        while stem.lower() in taken:  # some file systems know no capitals
            stem, number = f"{stem.removesuffix(f'.{number - 1}')}.{number}", number + 1
        taken.add(stem.lower())
        yield stem


def data_csv(data: Mapping[str, Values]) -> str:
    """Return what a panel was drawn from, a column for each heading; 12 significant digits, an
    empty field where there is no number.
    """
    columns = (
        values if isinstance(values, Sequence) else values.tolist() for values in data.values()
    )
    return csv_text(data, zip(*(map(number_text, cells) for cells in columns), strict=True))


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8", newline="\n")
