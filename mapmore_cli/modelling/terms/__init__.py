"""Candidate terms and formulas as small syntax trees: read, evaluated, differentiated, printed; never `eval`ed."""

from mapmore_cli.modelling.terms.calculus import affine, derivative, substitute
from mapmore_cli.modelling.terms.errors import ExpressionError, NotFinite
from mapmore_cli.modelling.terms.evaluation import dictionary_matrix, evaluate
from mapmore_cli.modelling.terms.families import monomials
from mapmore_cli.modelling.terms.parsing import parse
from mapmore_cli.modelling.terms.printing import to_latex, to_text
from mapmore_cli.modelling.terms.syntax import Expression, Name, Number, add, call, multiply, power

__all__ = [
    "Expression",
    "ExpressionError",
    "Name",
    "NotFinite",
    "Number",
    "add",
    "affine",
    "call",
    "derivative",
    "dictionary_matrix",
    "evaluate",
    "monomials",
    "multiply",
    "parse",
    "power",
    "substitute",
    "to_latex",
    "to_text",
]
