"""Write every kind of model as a program; `modelling.kinds` says which kind a model is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Body, CurveRange, Formula, Memory, Model, Pieces, StateSpace, Sum
from mapmore_cli.modelling.memory.records import UNEVEN
from mapmore_cli.modelling.pieces.definition import pieces_value
from mapmore_cli.modelling.program.formula import formula_value
from mapmore_cli.modelling.program.memory import memory_value
from mapmore_cli.modelling.program.motion import motion_value
from mapmore_cli.modelling.program.statements import Limit, Program
from mapmore_cli.modelling.program.values import INPUT
from mapmore_cli.modelling.program.writing import Writer, times, total
from mapmore_cli.modelling.terms import Expression, Name, Number, parse, substitute

Inputs = Mapping[str, Expression]
"""What a model's inputs are, in the order that it has them in."""


def program_of(model: Model) -> Program:
    """The model written down.

    Raises
    ------
    DataError
        Where parts have different times between samples or go on from different outputs, or one is no closed expression.
    """
    m = Writer()
    names = {quantity.name: Name(f"{INPUT}{quantity.name}") for quantity in model.inputs}
    value = write(m, model, names)
    steps = m.kept.steps
    if steps and max(steps) > min(steps) * (1 + UNEVEN):
        raise DataError(
            f"the parts of {model.name} count samples of {min(steps):g} s and of {max(steps):g} s", "train them at the same time steps"
        )
    if len(m.kept.fed_back) > 1:
        raise DataError(f"the parts of {model.name} go on from {', '.join(m.kept.fed_back)}", "export the parts one by one")
    return m.program(tuple(names), value)


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a model of any kind; return its output."""
    return WRITERS[type(model.body)](m, model, inputs)


def pieces(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write pieces, on their backbone where they have one."""
    body = model.body
    assert isinstance(body, Pieces)
    _limit(m, body.ranges, body.level, inputs)
    base = formula_value(m, body.backbone, inputs)
    if not body.segments:
        return base
    return m.let("model", base + pieces_value(m, body, {quantity.name: inputs[quantity.name] for quantity in model.inputs}))


def formula(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a formula alone."""
    assert isinstance(model.body, Formula)
    _limit(m, model.body.ranges, model.body.level, inputs)
    return formula_value(m, model.body.fit, inputs)


def memory(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a model with memory, on its backbone where it has one."""
    body = model.body
    assert isinstance(body, Memory)
    _limit(m, body.ranges, None, inputs)
    m.kept.steps.append(body.model.states.step)
    return m.let("model", formula_value(m, body.backbone, inputs) + memory_value(m, body.model, inputs))


def motion(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a model of motion."""
    assert isinstance(model.body, StateSpace)
    _limit(m, model.body.ranges, None, inputs)
    m.kept.steps.append(model.body.motion.step)
    return motion_value(m, model.body.motion, inputs)


def sums(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write models added up, each with its sign and by its own names of the inputs."""
    assert isinstance(model.body, Sum)
    values = []
    for part in model.body.parts:
        renamed = {name: m.let("input", substitute(parse(text), inputs)) for name, text in part.inputs.items()}
        limits, knots, m.limits, m.knots = m.limits, m.knots, [], {}
        value = write(m, part.model, {**inputs, **renamed})
        values.append(value if part.sign == 1.0 else times(Number(part.sign), value))
        m.limits = [*limits, *(_through(limit, part.inputs, inputs) for limit in m.limits)]
        own, m.knots = m.knots, knots
        for name in own.keys() - part.inputs.keys():  # a renamed input is another expression of the sum's inputs
            m.knot(name, *own[name])
    return m.let("sum", total(values))


def _limit(m: Writer, ranges: Sequence[CurveRange], level: str | None, inputs: Inputs) -> None:
    """Add training ranges: of the level that of its levels, of any other input one that goes linearly from curve to curve."""
    if not ranges:
        return
    levels = np.array([one.level for one in ranges], dtype=np.float64) if level is not None else np.empty(0)
    if level is not None:
        m.limits.append(Limit(frozenset({level}), inputs[level], None, levels[:1], levels[:1], levels[-1:]))
        m.knot(level, *levels.tolist())
    for name in ranges[0].limits:
        if name != level and name in inputs:
            ends = np.array([one.limits[name] for one in ranges])
            m.knot(name, *ends.ravel().tolist())
            if level is None:
                m.limits.append(Limit(frozenset({name}), inputs[name], None, levels, ends[:1, 0], ends[:1, 1]))
            else:
                m.limits.append(Limit(frozenset({name}), inputs[name], inputs[level], levels, ends[:, 0], ends[:, 1]))


def _through(limit: Limit, renamed: Mapping[str, str], inputs: Inputs) -> Limit:
    """The limit of a part, where its inputs are expressions of the sum's."""
    own = {used for name in limit.inputs for used in (parse(renamed[name]).names if name in renamed else {name})}
    return replace(limit, inputs=frozenset(own & inputs.keys()))


WRITERS: Mapping[type[Body], Callable[[Writer, Model, Inputs], Expression]] = {
    Pieces: pieces,
    Formula: formula,
    Memory: memory,
    StateSpace: motion,
    Sum: sums,
}
