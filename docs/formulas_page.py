"""docs/formulas.md, made from the formulas themselves: `python docs/formulas_page.py` writes it, a test compares it."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from mapmore_cli.modelling import literature
from mapmore_cli.modelling.expressions import to_text
from mapmore_cli.modelling.literature.literature_model import LOAD_CYCLES, LiteratureModel

PAGE = Path(__file__).with_name("formulas.md")
HEAD = """# Formulas of the literature

Every formula stands under its name in `validate.against`, as `model: {type: literature, name: ...}`, or as the backbone of pieces.
It is fitted to the same training samples as the model it is compared with. M1, M2, P, W and H are papers; [references.md](references.md)
names them. `mapmore show` prints the fitted parameters with their standard errors, and says which of them the data do not determine.

This page is made from the code: `python docs/formulas_page.py`.
"""
COMPONENTS = {"static": "Static force", "damping": "Damping force", "dynamic": "Force in motion"}


def page() -> str:
    """The whole page."""
    every = [literature.get(name) for name in literature.names()]
    sections = [_section(title, [one for one in every if one.component == word]) for word, title in COMPONENTS.items()]
    return "\n".join([HEAD, *sections])


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
    """The formula as it is written in a spec, where one expression holds it."""
    whole = getattr(formula, "formula", formula)  # a formula by regions has the same one in each
    expression = getattr(whole, "expression", None)
    return None if expression is None else to_text(expression)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
