"""Program of a model without memory worked out along columns, row by row."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.modelling.program.model import INPUT
from mapmore_cli.modelling.program.statements import Block, Choose, Condition, Let, Program, Use
from mapmore_cli.modelling.terms import evaluate
from mapmore_cli.modelling.terms.syntax import Expression

COMPARISONS: Mapping[str, Callable[[Array, Array], BoolArray]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
}


def results_of(model: Program, columns: Columns) -> list[Array]:
    """The results of the model's body at every row, (n,) each."""
    n = len(columns[model.inputs[0]])
    functions = {function.name: function for function in model.functions}

    def results(block: Block, known: dict[str, Array], n: int) -> list[Array]:
        for statement in block.statements:
            match statement:
                case Let(name, value):
                    known[name] = _value(value, known, n)
                case Use(names, function, arguments):
                    called = functions[function]
                    given = {name: _value(one, known, n) for name, one in zip(called.parameters, arguments, strict=True)}
                    known.update(zip(names, results(called.body, given, n), strict=True))
                case Choose(names):
                    known.update(zip(names, chosen(statement, known, n), strict=True))
                case _:
                    raise TypeError(f"not a statement of a model without memory: {statement!r}")
        return [_value(result, known, n) for result in block.results]

    def chosen(choice: Choose, known: dict[str, Array], n: int) -> list[Array]:
        found = [np.empty(n) for _ in choice.names]
        left = np.ones(n, dtype=np.bool_)
        for condition, block in (*choice.cases, (None, choice.otherwise)):
            rows = np.flatnonzero(left if condition is None else left & _holds(condition, known, n))
            left[rows] = False
            if len(rows):
                own = {name: values[rows] for name, values in known.items()}
                for whole, part in zip(found, results(block, own, len(rows)), strict=True):
                    whole[rows] = part
        return found

    with np.errstate(all="ignore"):
        return results(model.body, {f"{INPUT}{name}": np.asarray(columns[name], dtype=np.float64) for name in model.inputs}, n)


def _value(expression: Expression, known: dict[str, Array], n: int) -> Array:
    return evaluate(expression, {name: known[name] for name in expression.names}, n)


def _holds(condition: Condition, known: dict[str, Array], n: int) -> BoolArray:
    return COMPARISONS[condition.comparison](_value(condition.left, known, n), _value(condition.right, known, n))
