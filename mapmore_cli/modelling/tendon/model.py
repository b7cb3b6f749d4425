"""The force of a muscle behind a tendon, `F = f(P, l - (F - F_0)/k, v + F'/k)`: its length l is
shorter by what the tendon is stretched, its shortening velocity v larger by the tendon's rate.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.foreign import tex_text
from mapmore_cli.domain.models import Equation, Model
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.expressions import Expression
from mapmore_cli.modelling.kinds import Verbs
from mapmore_cli.modelling.program.writing import Inputs, Writer
from mapmore_cli.modelling.tendon import Tendon

STEPS = 30
"""Half Newton steps: each halves the error, and 2^-30 of a force is none."""

NUDGE = 1e-6
"""Of the range of the length, over which the muscle's slope is taken."""


def muscle_columns(columns: Columns, force: Array, stiffness: float, at_zero: float) -> Columns:
    """Return the columns with the muscle's own length and velocity in the place of those of
    both.
    """
    of_muscle = {**columns, "length": columns["length"] - (force - at_zero) / stiffness}
    if "velocity" in columns:
        of_muscle["velocity"] = (
            columns["velocity"] + np.gradient(force, columns["time"]) / stiffness
        )
    return of_muscle


def solve(
    muscle: Callable[[Columns], Array], columns: Columns, stiffness: float, at_zero: float = 0.0
) -> Array:
    """Return the force of a `muscle` behind a tendon, (n,), along one recording.

    The slope is taken along the length; the rate of the force is that of the step before.
    """
    length = columns["length"]
    force, further = np.full(len(length), at_zero), NUDGE * (float(np.ptp(length)) or 1.0)
    for _ in range(STEPS):
        of_muscle = muscle_columns(columns, force, stiffness, at_zero)
        here, there = (
            muscle({**of_muscle, "length": of_muscle["length"] + x}) for x in (0.0, further)
        )
        slope = (there - here) / further
        force = force + 0.5 * (here - force) / (1.0 + slope / stiffness)
    return force


def _force(model: Model, columns: Columns) -> Array:
    body = model.body_of(Tendon)
    needed = ("time", *(quantity.name for quantity in model.inputs))
    if missing := [name for name in needed if name not in columns]:
        raise DataError(
            f"{model.name}: a force behind a tendon follows from {', '.join(needed)} along a "
            f"recording, but there is no {' and no '.join(missing)}",
            f"give a column for {' and for '.join(missing)}; the time is in s",
        )
    rows = {name: columns[name] for name in needed}
    return solve(
        lambda of_muscle: kinds.predict(body.muscle, of_muscle), rows, body.stiffness, body.force
    )


class TendonVerbs(Verbs):
    """Operations of a model of a muscle behind a tendon."""

    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return the force at every row of a recording, (n,).

        Raises DataError where the time or an input is missing.
        """
        return SimulatedRun(_force(model, columns), ())

    def outside_range(self, model: Model, columns: Columns) -> BoolArray:
        """Return True if the muscle itself is beyond its training range, (n,)."""
        body = model.body_of(Tendon)
        of_muscle = muscle_columns(columns, _force(model, columns), body.stiffness, body.force)
        return kinds.outside_range(body.muscle, of_muscle)

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return what the tendon makes of the length; then the equations of the muscle."""
        body, force = model.body_of(Tendon), model.output.name
        stretched = f"length = length - ({force} - {body.force:g})/{body.stiffness:g}"
        latex = rf"\text{{{tex_text(stretched)}}}"
        of_muscle = kinds.equations(body.muscle, units)
        return (Equation(f"{body.muscle.name}: tendon", stretched, latex), *of_muscle)

    def parameters(self, model: Model) -> int:
        """Return those of the muscle: the tendon is given."""
        return kinds.parameters(model.body_of(Tendon).muscle)

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:  # noqa: ARG002
        """Refuse: the force is the root of an equation at every sample, which no program solves."""
        raise DataError(
            f"{model.name}: the force behind a tendon is found by solving an equation at "
            "every sample, which an exported program cannot do",
            f"export the muscle without its tendon, {model.body_of(Tendon).muscle.name}",
        )
