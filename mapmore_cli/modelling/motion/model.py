"""A model of motion: its prediction along a recording, its training range, its equations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.fits import SegmentedCurve
from mapmore_cli.domain.models import CurveRange, Equation, Model, StateSpace
from mapmore_cli.domain.motion import Motion, MotionSection
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.results import Run
from mapmore_cli.modelling.expressions import Expression, Name, Number, add, multiply, parse, substitute
from mapmore_cli.modelling.literature.model import printed
from mapmore_cli.modelling.motion.simulation import simulate as simulated
from mapmore_cli.modelling.program.motion import motion_value
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit


def build(
    name: str, motion: Motion, training: Sequence[SegmentedCurve], quantities: Mapping[str, Quantity], notes: tuple[str, ...]
) -> Model:
    """Return a model of motion; the `training` curves say the range of the inputs."""
    inputs = motion_inputs(motion)
    ranges = tuple(CurveRange(c.curve, c.level, {name: c.limits[name] for name in inputs}) for c in training)
    return Model(name, quantities[motion.output], tuple(quantities[name] for name in inputs), StateSpace(motion, ranges), notes=notes)


def motion_inputs(motion: Motion) -> list[str]:
    """Return the quantities that drive the sections: the input first, then a load where they depend on one."""
    return list(dict.fromkeys([motion.input, *sorted(frozenset[str]().union(*(parse(text).names for text in motion.drives)))]))


def simulate(model: Model, columns: Columns) -> Run:
    """Return the model along one recording, (n,), from rest; NaN where an input is NaN, with a new beginning after it."""
    names = [*(quantity.name for quantity in model.inputs), *(["time"] if "time" in columns else [])]
    given = {name: np.asarray(columns[name], dtype=np.float64) for name in names}
    known = np.logical_and.reduce([np.isfinite(column) for column in given.values()])
    values = np.full(len(known), np.nan)
    for rows in np.split(np.arange(len(known)), np.flatnonzero(np.diff(known)) + 1):
        if len(rows) and known[rows[0]]:
            values[rows] = simulated(_motion(model), {name: column[rows] for name, column in given.items()})
    return Run(values)


def one_step(model: Model, columns: Columns) -> Array:
    """Return the same, (n,): the model asks for no measured past."""
    return simulate(model, columns).values


def equations(model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
    """`y[k] = P2 y[k-1] + P1 y[k-2] + sum_m w_m d_m[k-2]` of every section; `units` as for `kinds.equations`."""
    motion = _motion(model)
    return tuple(printed(section.id, _equation(motion, section, units)) for section in motion.sections)


def parameters(model: Model) -> int:
    """P1, P2 and the weights of every section."""
    return sum(2 + len(section.weights) for section in _motion(model).sections)


def _equation(motion: Motion, section: MotionSection, units: Mapping[str, float]) -> Expression:
    delayed: dict[str, Expression] = {name: Name(f"{name}[k-2]") for name in motion_inputs(motion)}
    scaled = {name: multiply(Number(units[name]), past) if name in units else past for name, past in delayed.items()}
    driven = (
        multiply(Number(weight), substitute(parse(text), scaled))
        for text, weight in zip(motion.drives, section.weights.tolist(), strict=True)
    )
    past = (multiply(Number(p), Name(f"{motion.output}[k-{lag}]")) for lag, p in ((1, section.p2), (2, section.p1)))
    return add(*past, *driven)


def _motion(model: Model) -> Motion:
    assert isinstance(model.body, StateSpace)
    return model.body.motion


def write(m: Writer, model: Model, inputs: Inputs) -> Expression:
    """Write a model of motion."""
    assert isinstance(model.body, StateSpace)
    limit(m, model.body.ranges, None, inputs)
    m.kept.steps.append(model.body.motion.step)
    return motion_value(m, model.body.motion, inputs)
