"""Candidate terms and formulas as small syntax trees: read, evaluated, differentiated, printed; never `eval`ed."""

from mapmore_cli.modelling.expressions.calculus import affine, derivative, exponents, substitute
from mapmore_cli.modelling.expressions.errors import ExpressionError, NotFinite
from mapmore_cli.modelling.expressions.evaluation import (
    Compiled,
    compiled,
    dictionary_blocks,
    dictionary_matrix,
    evaluate,
    stacked_matrices,
)
from mapmore_cli.modelling.expressions.families import monomials
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.parsing import parse
from mapmore_cli.modelling.expressions.printing import to_latex, to_text
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated, State, state
from mapmore_cli.modelling.expressions.syntax import Expression, Name, Number, add, call, multiply, power

__all__ = [
    "OPERATORS",
    "Compiled",
    "Expression",
    "ExpressionError",
    "Lagged",
    "Measured",
    "Name",
    "NotFinite",
    "Number",
    "Operated",
    "State",
    "add",
    "affine",
    "call",
    "compiled",
    "derivative",
    "dictionary_blocks",
    "dictionary_matrix",
    "evaluate",
    "exponents",
    "monomials",
    "multiply",
    "parse",
    "power",
    "stacked_matrices",
    "state",
    "substitute",
    "to_latex",
    "to_text",
]
