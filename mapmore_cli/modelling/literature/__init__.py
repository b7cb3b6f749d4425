"""Models of the literature, selectable by name and fitted on the same training data as MAPMORE.

Adding a formula is one file in `formulas/`, named after it, with a `FORMULA`.
"""

from mapmore_cli.modelling.literature.catalogue import UnknownFormula, get, names, of
from mapmore_cli.modelling.literature.formula import Formula
from mapmore_cli.modelling.literature.literature_model import LOAD_CYCLES, TARGET, LiteratureModel
from mapmore_cli.modelling.literature.problem import Nonlinear

__all__ = [
    "LOAD_CYCLES",
    "TARGET",
    "Formula",
    "LiteratureModel",
    "Nonlinear",
    "UnknownFormula",
    "get",
    "names",
    "of",
]
