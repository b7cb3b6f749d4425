"""Provide formulas of the literature by name, to be fitted to the same training data as MAPMORE.

To add a formula, add a file to `formulas/` that defines `FORMULA`, or `FORMULAS` for several
similar formulas. In another package, an entry point can name such a file.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

from mapmore_cli.domain import plugins
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Formula as Body
from mapmore_cli.modelling.expressions import to_text
from mapmore_cli.modelling.kinds import Kind, Verbs
from mapmore_cli.modelling.literature import formulas
from mapmore_cli.modelling.literature.formula import LOAD_CYCLES, TARGET, Formula
from mapmore_cli.modelling.literature.own import formula_of, is_definition, is_family
from mapmore_cli.modelling.literature.problem import Nonlinear


def _verbs() -> Verbs:
    from mapmore_cli.modelling.literature.model import FormulaVerbs

    return FormulaVerbs()


KIND = Kind("formula", Body, FormulaFit, _verbs)

__all__ = [
    "LOAD_CYCLES",
    "TARGET",
    "Formula",
    "Nonlinear",
    "get",
    "names",
    "of",
    "reference",
]


@cache
def _published() -> dict[str, Formula]:
    """Return the formulas of all files by name, in alphabetical order."""
    by_name = {
        part.name: replace(
            part.value, about=(part.value.about or part.source.__doc__ or "").strip()
        )
        for part in plugins.parts("formulas", Formula, formulas.__name__)
    }
    return dict(sorted(by_name.items()))


def names() -> tuple[str, ...]:
    """Return the names of all formulas in alphabetical order."""
    return tuple(_published())


def get(name: str) -> Formula:
    """Return the formula with the given name or definition. Raises KeyError for an unknown name."""
    if is_family(name):
        from mapmore_cli.modelling.literature.family import family_of

        return family_of(name)
    if is_definition(name):
        return formula_of(name)
    if name not in _published():
        raise KeyError(f"there is no formula `{name}`; there are: {', '.join(names())}")
    return _published()[name]


def is_known(fit: FormulaFit) -> bool:
    """Return True if this installation can evaluate the formula of the fit: the fit contains the
    definition of the formula, or `names` contains the name of the formula.
    """
    return bool(fit.definition) or fit.formula in names()


def of(fit: FormulaFit) -> Formula:
    """Return the formula of a fit."""
    return get(fit.formula)


COMPONENTS = {"static": "Static force", "damping": "Damping force", "dynamic": "Force in motion"}


def reference() -> str:
    """Return the page with all formulas as Markdown. Each formula has its equation, source and
    inputs, and formulas are grouped by the force that they predict.
    """
    sections = {
        title: [formula for formula in _published().values() if formula.component == word]
        for word, title in COMPONENTS.items()
    }
    return "\n".join(
        f"## {title}\n\n" + "\n".join(map(_formula_section, of_component))
        for title, of_component in sections.items()
    )


def _formula_section(formula: Formula) -> str:
    lines = [
        f"### {formula.name}\n\n{formula.about}\n",
        f"As one expression:\n\n```text\n{to_text(formula.expression)}\n```\n",
        f"- The source of the formula is {formula.reference}.",
    ]
    inputs = ", ".join(formula.inputs)
    lines.append(
        f"- The inputs of the formula are: {inputs}." if inputs else "- The formula has no inputs."
    )
    if formula.dimensions:
        lines.append(
            f"- The formula needs the {' and the '.join(formula.dimensions)} of the muscle "
            f"(`muscle: {{{formula.dimensions[0]}: ...}}`)."
        )
    if formula.fitted_to == LOAD_CYCLES:
        lines.append(
            "- The formula needs a static study (`needs: {static: ...}`), because it is fitted to "
            "the load cycles of this study."
        )
    return "\n".join(lines) + "\n"
