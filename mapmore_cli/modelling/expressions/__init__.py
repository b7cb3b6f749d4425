"""Represent candidate terms and formulas as syntax trees. Trees can be read from text, evaluated,
differentiated and printed. For safety, Python's `eval` is never called.
"""

from mapmore_cli.modelling.expressions.calculus import affine, derivative, exponents, substitute
from mapmore_cli.modelling.expressions.evaluation import (
    NotFinite,
    compiled,
    dictionary_block,
    dictionary_blocks,
    dictionary_matrix,
    evaluate,
    folded,
)
from mapmore_cli.modelling.expressions.parsing import candidate, parse
from mapmore_cli.modelling.expressions.printing import to_latex, to_mathml, to_text
from mapmore_cli.modelling.expressions.states import ExpressionError, Operated, state
from mapmore_cli.modelling.expressions.syntax import (
    Expression,
    Name,
    Number,
    add,
    call,
    multiply,
    power,
)

__all__ = [
    "Expression",
    "ExpressionError",
    "Name",
    "NotFinite",
    "Number",
    "Operated",
    "add",
    "affine",
    "call",
    "candidate",
    "compiled",
    "derivative",
    "dictionary_block",
    "dictionary_blocks",
    "dictionary_matrix",
    "evaluate",
    "exponents",
    "folded",
    "multiply",
    "parse",
    "power",
    "state",
    "substitute",
    "to_latex",
    "to_mathml",
    "to_text",
]
