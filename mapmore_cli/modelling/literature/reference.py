"""The formulas as Markdown, made from what they say of themselves; `mapmore schema formulas` prints them."""

from __future__ import annotations

from importlib import import_module

from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import to_text
from mapmore_cli.modelling.literature.literature_model import LOAD_CYCLES, LiteratureModel

COMPONENTS = {"static": "Static force", "damping": "Damping force", "dynamic": "Force in motion"}


def reference() -> str:
    """Return every formula with its equation, source and inputs, by the force that it gives."""
    every = [literature.get(name) for name in literature.names()]
    return "\n".join(_section(title, [one for one in every if one.component == word]) for word, title in COMPONENTS.items())


def _section(title: str, formulas: list[LiteratureModel]) -> str:
    return "\n".join([f"## {title}\n", *(_formula(one) for one in formulas)])


def _formula(formula: LiteratureModel) -> str:
    about = (import_module(f"{literature.__name__}.formulas.{formula.name}").__doc__ or "").strip()
    lines = [f"### {formula.name}\n", f"{about}\n"]
    text = _text(formula)
    lines += [f"    {text}\n"] if text else []
    lines.append(f"- source: {formula.reference}")
    lines.append(f"- inputs: {', '.join(formula.inputs) or 'none'}")
    if formula.dimensions:
        lines.append(f"- needs: the {' and the '.join(formula.dimensions)} of the muscle (`muscle: {{{formula.dimensions[0]}: ...}}`)")
    if formula.fitted_to == LOAD_CYCLES:
        lines.append("- needs: a static study (`needs: {static: ...}`), whose load cycles it is fitted to")
    return "\n".join(lines) + "\n"


def _text(formula: LiteratureModel) -> str | None:
    """Return the formula as it is written in a spec, where one expression holds it."""
    whole = getattr(formula, "formula", formula)  # a formula by regions has the same one in each
    expression = getattr(whole, "expression", None)
    return None if expression is None else to_text(expression)
