"""One self-contained HTML page: style and figures inline, no script, no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from mapmore_cli.reporting.figures.catalogue import RenderedFigure
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import Table, to_html
from mapmore_cli.reporting.verdict import verdict

if TYPE_CHECKING:
    from jinja2 import Environment

LONG_TABLE = 40
"""Rows from which a table starts folded on the screen; it is always printed."""

SCREEN_SCALE = 1.35
"""Figures are made for paper; a screen is read from further away."""


def render_page(inputs: ReportInputs, tables: Sequence[Table], figures: Mapping[str, Sequence[RenderedFigure]]) -> str:
    """The page, from the template `templates/page.html`, with `figures` by section; every text of the user's is escaped."""
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


def environment() -> Environment:
    """The templates of the package, with tables and figures as filters."""
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    templates = Environment(
        loader=PackageLoader("mapmore_cli.reporting"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    templates.filters["table"] = lambda table: Markup(to_html(table))
    templates.filters["svg"] = lambda figure: Markup(figure.svg)
    return templates
