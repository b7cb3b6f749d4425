"""Models of the literature, selectable by name and fitted on the same training data as MAPMORE.

Adding a formula is one file in `formulas/`, named after it, with a `FORMULA`.
"""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from functools import cache

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.literature import formulas
from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.literature_model import LOAD_CYCLES, TARGET, LiteratureModel
from mapmore_cli.modelling.literature.own import formula_of, is_definition, is_family
from mapmore_cli.modelling.literature.problem import Nonlinear

__all__ = ["LOAD_CYCLES", "TARGET", "Formula", "LiteratureModel", "Nonlinear", "UnknownFormula", "get", "names", "of"]


class UnknownFormula(KeyError):
    """No formula has this name; `suggestion` is the nearest name, or None."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.name = name
        self.suggestion = next(iter(difflib.get_close_matches(name, names(), n=1)), None)

    def __str__(self) -> str:
        hint = f"did you mean `{self.suggestion}`?" if self.suggestion else f"there are: {', '.join(names())}"
        return f"there is no formula `{self.name}`; {hint}"


@cache
def names() -> tuple[str, ...]:
    """Names of all formulas, in alphabetical order."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(formulas.__path__)))


def get(name: str) -> LiteratureModel:
    """Return the formula called `name`, or defined by it; raises `UnknownFormula` with the nearest name."""
    if is_family(name):
        from mapmore_cli.modelling.literature.family import family_of

        return family_of(name)
    if is_definition(name):
        return formula_of(name)
    if name not in names():
        raise UnknownFormula(name)
    formula: LiteratureModel = importlib.import_module(f"{formulas.__name__}.{name}").FORMULA
    return formula


def of(fit: FormulaFit) -> LiteratureModel:
    """Return the formula that was fitted."""
    return get(fit.formula)
