"""Evaluate sums of models: `output = sum_m sign_m m(inputs_m)`, in which an input may be the output
of another model.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.arrays import Array, BoolArray, Columns, row_count
from mapmore_cli.domain.foreign import tex_text
from mapmore_cli.domain.models import Equation, Model
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.expressions import (
    Expression,
    Name,
    Number,
    evaluate,
    parse,
    substitute,
    to_latex,
    to_text,
)
from mapmore_cli.modelling.expressions.syntax import Condition
from mapmore_cli.modelling.kinds import Verbs
from mapmore_cli.modelling.program.statements import NOTHING
from mapmore_cli.modelling.program.writing import Inputs, Writer, product_as_written, total
from mapmore_cli.modelling.programs import write as write_any


def _outside(parts: Sequence[Part], columns: Columns) -> BoolArray:
    outside = np.zeros(row_count(columns), dtype=np.bool_)
    for part, inputs in _parts(parts, columns):
        outside |= kinds.outside_range(part.model, inputs) | _outside(part.fed, columns)
    return outside


def _whole(model: Model) -> Equation:
    terms, printed = [], []
    for part in model.body_of(Sum).parts:
        sign = "-" if part.sign < 0 else "+"
        sources: dict[str, Expression] = {
            q.name: parse(part.inputs.get(q.name, q.name)) for q in part.model.inputs
        }
        sources |= {inner.model.output.name: Name(inner.model.name) for inner in part.fed}
        listed = ", ".join(f"{name} = {to_text(source)}" for name, source in sources.items())
        terms.append(f"{sign} {part.model.name}({listed})")
        arguments = ", ".join(
            f"{to_latex(Name(name))} = {to_latex(source)}" for name, source in sources.items()
        )
        printed.append(rf"{sign} \text{{{tex_text(part.model.name)}}}\left({arguments}\right)")
    return Equation("sum", " ".join(terms).removeprefix("+ "), " ".join(printed).removeprefix("+ "))


def _parts(parts: Sequence[Part], columns: Columns) -> Iterator[tuple[Part, Columns]]:
    """Yield each part with the columns from which its model is computed, under the names that this
    model uses for its inputs.
    """
    n = row_count(columns)
    for part in parts:
        renamed = {
            name: np.broadcast_to(evaluate(parse(text), columns), n)
            for name, text in part.inputs.items()
        }
        fed = {
            inner.model.output.name: kinds.simulate(inner.model, inputs).values
            for inner, inputs in _parts(part.fed, columns)
        }
        yield part, {**columns, **renamed, **fed}


def _value(m: Writer, part: Part, inputs: Inputs) -> Expression:
    """Write a part of the sum to the program, after the models whose outputs are its inputs. Return
    the value of the part. The value is NaN as long as one of these models has no value because it
    needs earlier samples.
    """
    renamed = {
        name: m.let("input", substitute(parse(text), inputs)) for name, text in part.inputs.items()
    }
    waits: list[Expression] = []
    for inner in part.fed:
        queues = len(m.kept.queues)
        renamed[inner.model.output.name] = fed = m.let("fed", _value(m, inner, inputs))
        waits += [fed] * (len(m.kept.queues) > queues)
    waited = m.let("fed", total(waits)) if waits else None
    limits, knots, m.limits, m.knots = m.limits, m.knots, [], {}
    written: Callable[[], Expression] = partial(write_any, m, part.model, {**inputs, **renamed})
    value = (
        written() if waited is None else m.where(Condition(waited, "==", waited), written, NOTHING)
    )
    m.limits = [
        *limits,
        *(replace(limit, inputs=_own(part, limit.inputs) & inputs.keys()) for limit in m.limits),
    ]
    own_knots, m.knots = m.knots, knots
    # knots along a renamed input are not knots along an input of the sum
    for name in own_knots.keys() - renamed.keys():
        m.knot(name, *own_knots[name])
    return value


def _own(part: Part, names: Iterable[str]) -> frozenset[str]:
    """Return those inputs of the sum from which the inputs `names` of a part are computed."""
    fed = {inner.model.output.name: _own(inner, inner.model.input_names) for inner in part.fed}
    return frozenset().union(
        *(fed[name] if name in fed else parse(part.inputs.get(name, name)).names for name in names)
    )


class SumVerbs(Verbs):
    """Operations of a sum of models, for example its prediction and its equations."""

    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return the sum at every row, (n,), and the rows at which any part diverges."""
        runs = [
            (part.sign, kinds.simulate(part.model, inputs))
            for part, inputs in _parts(model.body_of(Sum).parts, columns)
        ]
        values = sum((sign * run.values for sign, run in runs), start=np.zeros(row_count(columns)))
        return SimulatedRun(values, tuple(sorted({row for _, run in runs for row in run.diverged})))

    def one_step(self, model: Model, columns: Columns) -> Array:
        """Return the one-step-ahead prediction of the sum from the measured past, (n,)."""
        runs = [
            part.sign * kinds.one_step_ahead(part.model, inputs)
            for part, inputs in _parts(model.body_of(Sum).parts, columns)
        ]
        return np.asarray(np.sum(runs, axis=0))

    def outside_range(self, model: Model, columns: Columns) -> BoolArray:
        """Return True for rows at which any part, or a model that feeds it, is outside its training
        range, (n,).
        """
        return _outside(model.body_of(Sum).parts, columns)

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the equation of the sum in terms of its parts, with the expressions of their
        inputs; then the equations of each part, with its name.
        """
        parts = model.body_of(Sum).parts
        whole = (
            ()
            if all(part.sign == 1.0 and not part.inputs and not part.fed for part in parts)
            else (_whole(model),)
        )
        named = [
            (inner.name, kinds.equations(inner, units)) for part in parts for inner in part.models
        ]
        return whole + tuple(
            replace(equation, id=f"{name}: {equation.id}")
            for name, of_part in named
            for equation in of_part
        )

    def rules(self, model: Model) -> Iterator[str]:
        """Yield, for each part, the sentences that say how its equations are combined. Each
        sentence begins with the name of the part's model, for example `spring: ...`.
        """
        for part in model.body_of(Sum).parts:
            for inner in part.models:
                yield from (f"{inner.name}: {rule}" for rule in kinds.rules(inner))

    def faults(self, model: Model) -> Iterator[str]:
        """Yield the faults for which a stored sum is refused."""
        if not model.body_of(Sum).parts:
            yield "the sum has no parts"

    def parameters(self, model: Model) -> int:
        """Return the number of parameters of all parts."""
        return sum(
            kinds.parameters(inner) for part in model.body_of(Sum).parts for inner in part.models
        )

    def fed_back(self, model: Model) -> tuple[str, ...]:
        """Return the names of the outputs of which measured values are needed to start at least one
        part.
        """
        return tuple(
            dict.fromkeys(
                name
                for part in model.body_of(Sum).parts
                for inner in part.models
                for name in kinds.fed_back(inner)
            )
        )

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Write the program of a sum: the models of its parts, each with its sign, and with its own
        names for the inputs.
        """
        values = []
        for part in model.body_of(Sum).parts:
            value = _value(m, part, inputs)
            values.append(
                value if part.sign == 1.0 else product_as_written(Number(part.sign), value)
            )
        return m.let("sum", total(values))
