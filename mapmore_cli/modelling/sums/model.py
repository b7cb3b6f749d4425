"""Models that are added up: `output = sum_m sign_m m(inputs_m)`.

The verbs of the summands come as arguments, since a summand may be of any kind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.models import Equation, Model, Part, Sum
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.terms import Name, evaluate, parse, to_latex, to_text


def simulate(model: Model, columns: Columns, of: Callable[[Model, Columns], Run]) -> Run:
    """The sum at every row, (n,), and the rows at which a free run of any part diverges."""
    runs = [(part.sign, of(part.model, inputs)) for part, inputs in _parts(model, columns)]
    values = sum((sign * run.values for sign, run in runs), start=np.zeros(len(next(iter(columns.values())))))
    return Run(values, tuple(sorted({row for _, run in runs for row in run.diverged})))


def one_step(model: Model, columns: Columns, of: Callable[[Model, Columns], Array]) -> Array:
    """The sum from the measured past, (n,)."""
    values: Array = np.sum([part.sign * of(part.model, inputs) for part, inputs in _parts(model, columns)], axis=0)
    return values


def outside_range(model: Model, columns: Columns, of: Callable[[Model, Columns], BoolArray]) -> BoolArray:
    """True where any part is beyond its training range, (n,)."""
    found: BoolArray = np.logical_or.reduce([of(part.model, inputs) for part, inputs in _parts(model, columns)])
    return found


def equations(
    model: Model, units: Mapping[str, float], of: Callable[[Model, Mapping[str, float]], tuple[Equation, ...]]
) -> tuple[Equation, ...]:
    """The sum of the parts by their names, with what their inputs are here; then the equations of each part, named after it."""
    whole = () if all(part.sign == 1.0 and not part.inputs for part in _body(model).parts) else (_whole(model),)
    return whole + tuple(replace(one, id=f"{part.model.name}: {one.id}") for part in _body(model).parts for one in of(part.model, units))


def parameters(model: Model, of: Callable[[Model], int]) -> int:
    """The parameters of all parts."""
    return sum(of(part.model) for part in _body(model).parts)


def fed_back(model: Model, of: Callable[[Model], tuple[str, ...]]) -> tuple[str, ...]:
    """The measured outputs that any part begins from."""
    return tuple(dict.fromkeys(name for part in _body(model).parts for name in of(part.model)))


def _whole(model: Model) -> Equation:
    terms, printed = [], []
    for part in _body(model).parts:
        sign = "-" if part.sign < 0 else "+"
        given = {q.name: parse(part.inputs.get(q.name, q.name)) for q in part.model.inputs}
        terms.append(f"{sign} {part.model.name}({', '.join(f'{name} = {to_text(source)}' for name, source in given.items())})")
        arguments = ", ".join(f"{to_latex(Name(name))} = {to_latex(source)}" for name, source in given.items())
        words = part.model.name.replace("_", r"\_")
        printed.append(rf"{sign} \text{{{words}}}\left({arguments}\right)")
    return Equation("sum", " ".join(terms).removeprefix("+ "), " ".join(printed).removeprefix("+ "))


def _parts(model: Model, columns: Columns) -> Iterator[tuple[Part, Columns]]:
    """Each part, with its inputs by the names that it knows them by."""
    n = len(next(iter(columns.values())))
    for part in _body(model).parts:
        renamed = {name: np.broadcast_to(evaluate(parse(text), columns), n) for name, text in part.inputs.items()}
        yield part, {**columns, **renamed}


def _body(model: Model) -> Sum:
    assert isinstance(model.body, Sum)
    return model.body
