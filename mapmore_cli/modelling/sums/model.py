"""Models that are added up: `output = sum_m sign_m m(inputs_m)`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.models import Equation, Model, Part, Sum
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.expressions import Expression, Name, Number, evaluate, parse, substitute, to_latex, to_text
from mapmore_cli.modelling.program.statements import Limit
from mapmore_cli.modelling.program.writing import Inputs, Writer, times, total


def simulate(model: Model, columns: Columns) -> Run:
    """Return the sum at every row, (n,), and the rows at which a free run of any part diverges."""
    runs = [(part.sign, kinds.simulate(part.model, inputs)) for part, inputs in _parts(model, columns)]
    values = sum((sign * run.values for sign, run in runs), start=np.zeros(len(next(iter(columns.values())))))
    return Run(values, tuple(sorted({row for _, run in runs for row in run.diverged})))


def one_step(model: Model, columns: Columns) -> Array:
    """Return the sum from the measured past, (n,)."""
    values: Array = np.sum([part.sign * kinds.one_step_ahead(part.model, inputs) for part, inputs in _parts(model, columns)], axis=0)
    return values


def outside_range(model: Model, columns: Columns) -> BoolArray:
    """Return True where any part is beyond its training range, (n,)."""
    found: BoolArray = np.logical_or.reduce([kinds.outside_range(part.model, inputs) for part, inputs in _parts(model, columns)])
    return found


def equations(model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """Return the sum of the parts by their names, with what their inputs are here; then the equations of each part, named after it."""
    whole = () if all(part.sign == 1.0 and not part.inputs for part in _body(model).parts) else (_whole(model),)
    named = [(part.model.name, kinds.equations(part.model, units)) for part in _body(model).parts]
    return whole + tuple(replace(one, id=f"{name}: {one.id}") for name, found in named for one in found)


def parameters(model: Model) -> int:
    """Return the parameters of all parts."""
    return sum(kinds.parameters(part.model) for part in _body(model).parts)


def fed_back(model: Model) -> tuple[str, ...]:
    """Return the measured outputs that any part begins from."""
    return tuple(dict.fromkeys(name for part in _body(model).parts for name in kinds.fed_back(part.model)))


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


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write models added up, each with its sign and by its own names of the inputs."""
    assert isinstance(model.body, Sum)
    values = []
    for part in model.body.parts:
        renamed = {name: m.let("input", substitute(parse(text), inputs)) for name, text in part.inputs.items()}
        limits, knots, m.limits, m.knots = m.limits, m.knots, [], {}
        value = kinds.write(m, part.model, {**inputs, **renamed})
        values.append(value if part.sign == 1.0 else times(Number(part.sign), value))
        m.limits = [*limits, *(_through(limit, part.inputs, inputs) for limit in m.limits)]
        own, m.knots = m.knots, knots
        for name in own.keys() - part.inputs.keys():  # a renamed input is another expression of the sum's inputs
            m.knot(name, *own[name])
    return m.let("sum", total(values))


def _through(limit: Limit, renamed: Mapping[str, str], inputs: Inputs) -> Limit:
    """Return the limit of a part, where its inputs are expressions of the sum's."""
    own = {used for name in limit.inputs for used in (parse(renamed[name]).names if name in renamed else {name})}
    return replace(limit, inputs=frozenset(own & inputs.keys()))
