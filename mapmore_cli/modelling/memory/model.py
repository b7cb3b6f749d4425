"""A model with memory: its prediction along a recording, its training range, its equation, its
program.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.fits import PIECE, FormulaFit, MemoryModel, SegmentedCurve
from mapmore_cli.domain.models import CurveRange, Equation, Memory, Model
from mapmore_cli.domain.recording import Quantity, united
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.equations import equation
from mapmore_cli.modelling.expressions import Expression, Name, Number, parse, state, substitute
from mapmore_cli.modelling.expressions.operator import Recursion
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.expressions.states import Lagged, Measured, Operated, State
from mapmore_cli.modelling.expressions.syntax import ONE, ZERO, Condition
from mapmore_cli.modelling.literature.model import (
    backbone_values,
    formula_equations,
    formula_value,
    where_finite,
)
from mapmore_cli.modelling.memory.feedback import fed_back_states, parted
from mapmore_cli.modelling.memory.free_run import free_run, one_step_ahead
from mapmore_cli.modelling.memory.simulation import bounds_of
from mapmore_cli.modelling.memory.states import memory_inputs, setting_of
from mapmore_cli.modelling.program.statements import NOTHING, Queue, Recall
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit, times, total


def build(
    name: str,
    memory: MemoryModel,
    backbone: FormulaFit | None,
    training: Sequence[SegmentedCurve],
    quantities: Mapping[str, Quantity],
    notes: tuple[str, ...] = (),
) -> Model:
    """Return a model with memory, on the backbone that it was fitted on; the `training` curves say
    the range of the inputs.
    """
    formula = () if backbone is None else literature.of(backbone).inputs
    inputs = sorted({*memory_inputs(memory), *formula})
    ranges = tuple(
        CurveRange(c.curve, c.level, {name: c.limits[name] for name in inputs}) for c in training
    )
    return Model(
        name,
        quantities[memory.output],
        tuple(quantities[name] for name in inputs),
        Memory(memory, ranges, backbone),
        notes=notes,
    )


def simulate(model: Model, columns: Columns) -> Run:
    """Return the model in free run along one recording, (n,), on its backbone where it has one."""
    run = free_run(_body(model).model, columns)
    return Run(_base(model, columns) + run.values, run.diverged)


def one_step(model: Model, columns: Columns) -> Array:
    """Prediction of every row from the measured past, (n,); NaN before there is history."""
    return _base(model, columns) + one_step_ahead(_body(model).model, columns)


def equations(model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """Return the backbone first, then the equation of the next output."""
    body = _body(model)
    own, limits = (
        body.model,
        united([*(one.limits for one in body.ranges), {body.model.output: body.model.limits}]),
    )
    return *formula_equations(body.backbone, units), equation(
        PIECE, own.terms, own.theta, own.scaling, limits, units
    )


def parameters(model: Model) -> int:
    """Return the coefficients of the terms, with the model's own constant where it has one, and the
    parameters of the backbone.
    """
    body = _body(model)
    own = len(body.model.theta) + (body.model.constant != 0.0)
    return own + (0 if body.backbone is None else len(body.backbone.parameters))


def fed_back(model: Model) -> tuple[str, ...]:
    """Return the output, where the model goes on from it."""
    memory = _body(model).model
    return (memory.output,) if fed_back_states(memory.states, memory.output) else ()


def _base(model: Model, columns: Columns) -> Array:
    body = _body(model)
    if body.backbone is None and not model.inputs:
        return np.zeros(len(next(iter(columns.values()))))
    return where_finite(
        model.inputs, columns, lambda inputs, n: backbone_values(body.backbone, inputs, n)
    )


def _body(model: Model) -> Memory:
    assert isinstance(model.body, Memory)
    return model.body


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a model with memory, on its backbone where it has one."""
    body = _body(model)
    limit(m, body.ranges, None, inputs)
    m.kept.steps.append(body.model.states.step)
    return m.let(
        "model", formula_value(m, body.backbone, inputs) + _Output(m, body.model, inputs).written()
    )


class _Output:
    """Writes the output of one model down, and its states, each once; `seen` counts the samples
    before this one.
    """

    def __init__(self, m: Writer, model: MemoryModel, inputs: Mapping[str, Expression]) -> None:
        self.m, self.model, self.inputs = m, model, inputs
        self.lags = fed_back_states(model.states, model.output)
        self.seen = m.number("seen")
        self.known: dict[str, Expression] = {}
        self.queues: dict[str, str] = {}

    def written(self) -> Expression:
        """Write the output at a sample in free run; nothing before there is history, and once it
        has diverged.
        """
        m, model = self.m, self.model
        names = {
            name: self._scaled(place, self._state(state(name)))
            for place, name in enumerate(model.states.names)
        }
        start = float(max((state(name).lag for name in model.states.names), default=0))
        early = self.seen < start
        if not self.lags:
            found = m.choose("memory", [(early, NOTHING)], lambda: self._sum(names))
        else:
            lost = m.number("lost")
            low, high = bounds_of(model.limits)

            def bounded() -> Expression:
                """Write the output while it stays within bounds; nothing from where it leaves them,
                up to a reset.
                """
                value = self._sum(names)
                return m.choose(
                    "within",
                    [(lost > 0, NOTHING), (value < low, NOTHING), (value > high, NOTHING)],
                    value,
                )

            found = m.choose("memory", [(early, NOTHING)], bounded)
            m.keep(
                lost, m.choose("lost", [(early, ZERO), (Condition(found, "==", found), ZERO)], ONE)
            )
        for name, queue in self.queues.items():
            m.statements.append(
                Queue(queue, found if name == model.output else self._state(state(name)))
            )
        if self.lags:
            m.kept.fed_back.setdefault(model.output, []).append(self.queues[model.output])
        m.keep(self.seen, m.choose("seen", [(self.seen <= start, self.seen + 1)], self.seen))
        return found

    def _state(self, found: State) -> Expression:
        """Write a state in physical units."""
        if found.name not in self.known:
            match found:
                case Measured(name):
                    written = self.inputs[name]
                case Lagged(source, steps):
                    written = self._lagged(source, steps)
                case Operated(name, source):
                    written = self._operated(
                        name,
                        OPERATORS[name].recursion(setting_of(found, self.model.states)),
                        source,
                    )
            self.known[found.name] = written
        return self.known[found.name]

    def _operated(self, name: str, rule: Recursion, source: State) -> Expression:
        """Write an operator from its kept values; it rests up to the first sample on which its
        source has a value.
        """
        m = self.m
        x = m.let("source", self._state(source))
        if rule.own == rule.source == 0:
            return m.let(name, rule.next(m, x))
        own = [m.number(name) for _ in range(rule.own)]
        past = [m.number("source") for _ in range(rule.source)]
        rest = Condition(self.seen, "<=", Number(float(source.lag)))
        value = m.choose(name, [(rest, rule.rest(x))], lambda: rule.next(m, *own, x, *past))
        for kept, now in ((own, value), (past, x)):
            older = [now, *(m.where(rest, now, one) for one in kept[:-1])]
            for place, one in zip(kept, older[: len(kept)], strict=True):
                m.keep(place, one)
        return value

    def _lagged(self, source: State, steps: int) -> Expression:
        if source.name not in self.queues:
            self.queues[source.name] = self.m.fresh("queue")
            if source != Measured(self.model.output):
                self._state(source)
        queue = self.queues[source.name]
        self.m.kept.queues[queue] = max(self.m.kept.queues.get(queue, 0), steps)
        name = self.m.fresh("past")
        self.m.statements.append(Recall(name, queue, steps))
        return Name(name)

    def _scaled(self, place: int, value: Expression) -> Expression:
        """Write a state scaled to its training range, as `states.evaluate_states` does."""
        states = self.model.states
        if not states.scaled:
            return value
        low, high = float(states.low[place]), float(states.high[place])
        return (
            self.m.clip((value - low) / (high - low), -states.margin, 1 + states.margin, "scaled")
            if high > low
            else ZERO
        )

    def _sum(self, names: Mapping[str, Expression]) -> Expression:
        """Write `constant + sum_j theta_j D_j`, the terms of inputs first, as a free run adds them
        up.
        """
        m, model = self.m, self.model
        driven: list[Expression] = [Number(model.constant)]
        weights: dict[Expression, list[Expression]] = {}
        for text, theta in zip(model.terms, model.theta.tolist(), strict=True):
            own, inputs = parted(parse(text), self.lags)
            weight = times(Number(theta), m.let("driven", substitute(inputs, names)))
            (driven if own == ONE else weights.setdefault(own, [])).append(weight)
        fed = [
            times(m.let("weight", total(parts)), m.let("own", substitute(own, names)))
            for own, parts in weights.items()
        ]
        return m.let("output", total([m.let("base", total(driven)), *fed]))


def faults(model: Model) -> Iterator[str]:
    """Say what of a stored model no prediction would notice."""
    memory = _body(model).model
    if memory.output != model.output.name or not all(
        parse(text).names <= {*memory.states.names} for text in memory.terms
    ):
        yield "its terms are of other states than it has"
