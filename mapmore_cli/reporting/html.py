"""What all pages share: their templates, and the names of models as people write them."""

from __future__ import annotations

from functools import cache, lru_cache
from typing import TYPE_CHECKING

from mapmore_cli.domain.scores import BASELINES, SIMPLE
from mapmore_cli.modelling import literature
from mapmore_cli.reporting.table import to_html

if TYPE_CHECKING:
    from jinja2 import Environment

SCREEN_SCALE = 1.35
"""Figures are made for paper; a screen is read from further away."""

OTHERS = {**BASELINES, **SIMPLE}


@lru_cache(maxsize=10_000)
def title_of(text: str) -> str:
    """Return the title of the model or of the sum of models that a text names, `sarosi_hinged` as `Sárosi, hinged`; else the text."""
    names = text.split("+")
    found = [OTHERS.get(name) or (literature.get(name).title if name in literature.names() else "") for name in names]
    return text if "" in found else " + ".join(found)


@cache
def environment() -> Environment:
    """Return the templates of the package, with tables and figures as filters."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # tables and figures need none of it
    from markupsafe import Markup

    loader = PackageLoader("mapmore_cli.reporting")
    templates = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    templates.filters["table"] = lambda table: Markup(to_html(table, title_of))
    templates.filters["svg"] = lambda figure: Markup(figure.svg)
    return templates
