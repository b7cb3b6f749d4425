"""Writes a report: figures, tables, and one self-contained HTML page without scripts and network."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mapmore_cli.domain.scores import FIGURES
from mapmore_cli.reporting.figures.catalogue import RenderedFigure, drawings, rendered, rendered_by_section
from mapmore_cli.reporting.figures.drawing import Drawing, Panel, Values, alone
from mapmore_cli.reporting.figures.saving import SVG_PROLOGUE, WRITERS
from mapmore_cli.reporting.figures.style import figure_style
from mapmore_cli.reporting.html import SCREEN_SCALE, environment
from mapmore_cli.reporting.inputs import FigureStyle, ReportInputs
from mapmore_cli.reporting.score_tables import verdict
from mapmore_cli.reporting.table import Table, number_text, to_csv, to_latex
from mapmore_cli.reporting.tables import all_tables

LONG_TABLE = 40
"""Rows from which a table starts folded on the screen; it is always printed."""


def render_page(inputs: ReportInputs, tables: Sequence[Table], figures: Mapping[str, Sequence[RenderedFigure]]) -> str:
    """Return the page, from the template `templates/page.html`, with `figures` by section; every text of the user's is escaped."""
    return (
        environment()
        .get_template("page.html")
        .render(
            inputs=inputs,
            verdict=verdict(inputs.validation.scores, inputs.own, inputs.target, inputs.failed),
            tables={table.name: table for table in tables},
            figures=figures,
            held_out=any(curve.held_out.any() for curve in inputs.dataset.curves),
            long_table=LONG_TABLE,
            scale=SCREEN_SCALE,
        )
    )


def render_campaign(
    title: str, tables: Sequence[Table], figures: Sequence[RenderedFigure], pages: Mapping[str, str], failed: Mapping[str, str]
) -> str:
    """Return the page: `pages` are links by run, `failed` the messages of runs that did not end."""
    template = environment().get_template("campaign.html")
    return template.render(title=title, tables=tables, figures=figures, scale=SCREEN_SCALE, pages=pages, failed=failed)


TABLE_FILES: Mapping[str, Callable[[Table], str]] = {"csv": to_csv, "tex": to_latex}
"""What is written of a table, by format."""

PAPER = frozenset({"pdf", "png", "pgf"})
"""Formats of figures for print: with one of these, every panel is a file of its own, beside the numbers that it was drawn from."""

LONGEST_STEM = 80


def write_report(inputs: ReportInputs, out: Path, figures: Sequence[str], formats: Sequence[str]) -> None:
    """Write the report into the folder `out`, byte for byte the same for the same inputs.

    - `figures`: names out of `domain.scores.FIGURES`.
    - `formats`: `html`: index.html, with the figures in it; `svg`: a file for each figure; `csv`, `tex`: tables/*, and with a page `csv`
      of what each figure was drawn from, numbers/*; `pdf`, `png`, `pgf`:
      panels/*, every panel of every figure in these formats (and as SVG where that is asked for too), and as CSV.
    """
    tables = all_tables(inputs)
    out.mkdir(parents=True, exist_ok=True)
    for suffix, text_of in TABLE_FILES.items():
        if suffix in formats:
            (out / "tables").mkdir(exist_ok=True)
            for table in tables:
                if suffix == "tex" and not table.rows:
                    continue  # a document does not want a table of nothing
                _write(out / "tables" / f"{table.name}.{suffix}", text_of(table))
    if set(formats) <= set(TABLE_FILES):
        return
    drawn = [(name, drawing) for name in FIGURES if name in figures for drawing in drawings(name, inputs)]
    if {"html", "svg"} & set(formats):
        on_page = [(name, rendered(drawing, inputs.style)) for name, drawing in drawn]
        if "csv" in formats:
            on_page = [(name, _with_numbers(figure, drawing, out)) for (name, figure), (_, drawing) in zip(on_page, drawn, strict=True)]
        if "svg" in formats:
            for _, figure in on_page:
                _write(out / f"{figure.name}.svg", SVG_PROLOGUE + figure.svg)
        if "html" in formats:
            _write(out / "index.html", render_page(inputs, tables, rendered_by_section(on_page)))
    if PAPER & set(formats):
        write_panels([drawing for _, drawing in drawn], out / "panels", formats, inputs)


MOST_NUMBERS = 20_000
"""Rows of a figure's numbers beside the page; longer ones are written on demand (`mapmore figure --data`)."""


def _with_numbers(figure: RenderedFigure, drawing: Drawing, out: Path) -> RenderedFigure:
    """Write what a figure was drawn from beside the page, panel below panel, and return the figure with the name of the file."""
    sizes = [len(next(iter(panel.data.values()), ())) for panel in drawing.panels]
    if not 0 < sum(sizes) <= MOST_NUMBERS:
        return figure
    headings = dict.fromkeys(heading for panel in drawing.panels for heading in panel.data)
    table: dict[str, list[Any]] = {"panel": [panel.key for panel, size in zip(drawing.panels, sizes, strict=True) for _ in range(size)]}
    for heading in headings:
        pairs = zip((panel.data.get(heading, ()) for panel in drawing.panels), sizes, strict=True)
        table[heading] = [value for values, size in pairs for value in (values if len(values) else [math.nan] * size)]
    (out / "numbers").mkdir(exist_ok=True)
    _write(out / "numbers" / f"{drawing.name}.csv", data_csv(table))
    return replace(figure, numbers=f"numbers/{drawing.name}.csv")


def write_panels(drawn: Sequence[Drawing], folder: Path, formats: Sequence[str], inputs: ReportInputs) -> None:
    """Write every panel as a file of its own in every format of figures that is asked for, and the numbers behind it."""
    folder.mkdir(exist_ok=True)
    panels = [(drawing, panel) for drawing in drawn for panel in drawing.panels]
    for stem, (drawing, panel) in zip(_stems(panels), panels, strict=True):
        for name, content in _panel_files(stem, drawing, panel, formats, inputs.style).items():
            (folder / name).write_bytes(content)


def _panel_files(stem: str, drawing: Drawing, panel: Panel, formats: Sequence[str], style: FigureStyle) -> dict[str, bytes]:
    """Return the files of a panel by their names."""
    with figure_style(style):
        figure = alone(drawing, panel, style)
        wanted = {suffix: to_bytes for suffix, to_bytes in WRITERS.items() if suffix in formats}
        pictures = {f"{stem}.{suffix}": to_bytes(figure, stem, drawing.alt) for suffix, to_bytes in wanted.items()}
    return {f"{stem}.csv": data_csv(panel.data).encode(), **pictures}


def _stems(panels: Sequence[tuple[Drawing, Panel]]) -> Iterator[str]:
    """Yield a name for the files of every panel: of its figure and of what tells it from the others, in letters that any system takes."""
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
    """Return what a panel was drawn from, a column for each heading; 12 significant digits, an empty field where there is no number."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(data)
    writer.writerows(zip(*map(_texts, data.values()), strict=True))
    return text.getvalue()


def _texts(values: Values) -> list[str]:
    """Return the cells of a column, as `number_text` writes them: a panel may have a million."""
    cells = values if isinstance(values, Sequence) else values.tolist()
    kinds = {type(cell) for cell in cells}
    if kinds == {float}:
        return ["" if cell != cell else f"{cell:.12g}" for cell in cells]  # NaN differs from itself
    if kinds == {str}:
        known = {word: number_text(word) for word in set(cells)}
        return [known[word] for word in cells]
    return [number_text(cell) for cell in cells]


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
