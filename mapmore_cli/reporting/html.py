"""The templates of all pages."""

from __future__ import annotations

from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from mapmore_cli.reporting.table import to_html
from mapmore_cli.reporting.titles import title_of

SCREEN_SCALE = 1.35
"""Figures are made for paper; a screen is read from further away."""


@cache
def environment() -> Environment:
    """Return the templates of the package, with tables and figures as filters."""
    templates = Environment(
        loader=PackageLoader("mapmore_cli.reporting"), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    templates.filters["table"] = lambda table: Markup(to_html(table, title_of))
    templates.filters["svg"] = lambda figure: Markup(figure.svg)
    return templates
