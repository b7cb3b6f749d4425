"""Writes a report: page, figures, tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.tables import all_tables, to_csv

SVG_PROLOGUE = '<?xml version="1.0" encoding="utf-8"?>\n'


def write_report(inputs: ReportInputs, out: Path, figures: Sequence[str], formats: Sequence[str]) -> None:
    """Write the report into the folder `out`, byte for byte the same for the same inputs.

    Parameters
    ----------
    figures
        Names out of `figures.registry.FIGURES`.
    formats
        `html`: index.html, with the figures in it; `svg`: a file for each figure; `csv`: tables/*.csv.
    """
    tables = all_tables(inputs)
    out.mkdir(parents=True, exist_ok=True)
    if "csv" in formats:
        (out / "tables").mkdir(exist_ok=True)
        for table in tables:
            _write(out / "tables" / f"{table.name}.csv", to_csv(table))
    if not {"html", "svg"} & set(formats):
        return
    from mapmore_cli.reporting.figures.registry import rendered_figures
    from mapmore_cli.reporting.page import render_page

    rendered = rendered_figures(inputs, figures)
    if "svg" in formats:
        for figure in (figure for several in rendered.values() for figure in several):
            _write(out / f"{figure.name}.svg", SVG_PROLOGUE + figure.svg)
    if "html" in formats:
        _write(out / "index.html", render_page(inputs, tables, rendered))


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")
