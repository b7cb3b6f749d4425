"""Write every kind of model as a program; `modelling.kinds` says which kind a model is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.models import Body, CurveRange, Formula, Memory, Model, Pieces, StateSpace, Sum
from mapmore_cli.modelling.memory.records import UNEVEN
from mapmore_cli.modelling.program.formula import formula_value
from mapmore_cli.modelling.program.memory import memory_value
from mapmore_cli.modelling.program.motion import motion_value
from mapmore_cli.modelling.program.pieces import pieces_value
from mapmore_cli.modelling.program.pruning import pruned
from mapmore_cli.modelling.program.statements import Limit, Program
from mapmore_cli.modelling.program.values import INPUT
from mapmore_cli.modelling.program.writing import Lines, Names, Writer, times, total
from mapmore_cli.modelling.terms import Expression, Name, Number, add, parse, substitute

Inputs = Mapping[str, Expression]
"""What a model's inputs are, in the order that it has them in."""


def program_of(model: Model) -> Program:
    """The model written down.

    Raises
    ------
    DataError
        Where parts have different times between samples or go on from different outputs, or one is no closed expression.
    """
    writer = Writer(Lines(Names()))
    names = {quantity.name: Name(f"{INPUT}{quantity.name}") for quantity in model.inputs}
    value = write(writer, model, names)
    steps = writer.kept.steps
    if steps and max(steps) > min(steps) * (1 + UNEVEN):
        raise DataError(
            f"the parts of {model.name} count samples of {min(steps):g} s and of {max(steps):g} s", "train them at the same time steps"
        )
    if len(writer.kept.fed_back) > 1:
        raise DataError(f"the parts of {model.name} go on from {', '.join(writer.kept.fed_back)}", "export the parts one by one")
    functions = {function.name: function for function in writer.functions}
    return pruned(
        Program(
            inputs=tuple(names),
            functions=tuple(functions.values()),
            body=writer.lines.block(value),
            limits=tuple(writer.limits),
            kept=writer.kept,
        )
    )


def write(writer: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write down a model of any kind; its output."""
    return WRITERS[type(model.body)](writer, model, inputs)


def pieces(writer: Writer, model: Model, inputs: Inputs) -> Expression:
    """Pieces, on their backbone where they have one."""
    body = model.body
    assert isinstance(body, Pieces)
    writer.limits.extend(_limits(body.ranges, body.level, inputs))
    base = formula_value(writer.lines, body.backbone, inputs)
    if not body.segments:
        return base
    own = {quantity.name: inputs[quantity.name] for quantity in model.inputs}
    value, functions = pieces_value(writer.lines, body, own)
    writer.functions.extend(functions)
    return writer.lines.let("model", add(base, value))


def formula(writer: Writer, model: Model, inputs: Inputs) -> Expression:
    """A formula alone."""
    assert isinstance(model.body, Formula)
    writer.limits.extend(_limits(model.body.ranges, model.body.level, inputs))
    return formula_value(writer.lines, model.body.fit, inputs)


def memory(writer: Writer, model: Model, inputs: Inputs) -> Expression:
    """A model with memory, on its backbone where it has one."""
    body = model.body
    assert isinstance(body, Memory)
    writer.limits.extend(_limits(body.ranges, None, inputs))
    writer.kept.steps.append(body.model.states.step)
    base = formula_value(writer.lines, body.backbone, inputs)
    return writer.lines.let("model", add(base, memory_value(writer.lines, body.model, inputs, writer.kept)))


def motion(writer: Writer, model: Model, inputs: Inputs) -> Expression:
    """A model of motion."""
    assert isinstance(model.body, StateSpace)
    writer.limits.extend(_limits(model.body.ranges, None, inputs))
    writer.kept.steps.append(model.body.motion.step)
    return motion_value(writer.lines, model.body.motion, inputs, writer.kept)


def sums(writer: Writer, model: Model, inputs: Inputs) -> Expression:
    """Models added up, each with its sign and by its own names of the inputs."""
    assert isinstance(model.body, Sum)
    values = []
    for part in model.body.parts:
        renamed = {name: writer.lines.let("input", substitute(parse(text), inputs)) for name, text in part.inputs.items()}
        limits = len(writer.limits)
        value = write(writer, part.model, {**inputs, **renamed})
        values.append(value if part.sign == 1.0 else times(Number(part.sign), value))
        writer.limits[limits:] = [_through(limit, part.inputs, inputs) for limit in writer.limits[limits:]]
    return writer.lines.let("sum", total(values))


def _limits(ranges: Sequence[CurveRange], level: str | None, inputs: Inputs) -> Iterable[Limit]:
    """The range of the level is that of its levels; that of any other input goes linearly from curve to curve (`modelling.ranges`)."""
    if not ranges:
        return
    levels = np.array([one.level for one in ranges], dtype=np.float64) if level is not None else np.empty(0)
    if level is not None:
        yield Limit(frozenset({level}), inputs[level], None, levels[:1], levels[:1], levels[-1:])
    for name in ranges[0].limits:
        if name != level and name in inputs:
            ends = np.array([one.limits[name] for one in ranges])
            if level is None:
                yield Limit(frozenset({name}), inputs[name], None, levels, ends[:1, 0], ends[:1, 1])
            else:
                yield Limit(frozenset({name}), inputs[name], inputs[level], levels, ends[:, 0], ends[:, 1])


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
