"""Compute the force of a muscle in series with a tendon, `F = f(P, l - (F - F_0)/k, v + F'/k)`. The
length of the muscle is smaller than l by the stretch of the tendon, and its shortening velocity is
larger than v by the rate of this stretch.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

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
"""Number of Newton steps, each of half length. Each step halves the error, and 2^-30 of a force is
negligible.
"""

NUDGE = 1e-6
"""Step of the length for the numerical derivative of the muscle's force, as a fraction of the
length's range.
"""


def muscle_columns(columns: Columns, force: Array, stiffness: float, at_zero: float) -> Columns:
    """Return the columns with the length and velocity of the muscle without the tendon."""
    of_muscle = {**columns, "length": columns["length"] - (force - at_zero) / stiffness}
    if "velocity" in columns:
        of_muscle["velocity"] = (
            columns["velocity"] + np.gradient(force, columns["time"]) / stiffness
        )
    return of_muscle


def solve(
    muscle: Callable[[Columns], Array], columns: Columns, stiffness: float, at_zero: float = 0.0
) -> Array:
    """Return the force of a `muscle` in series with a tendon, shape (n,), along one recording.

    The equation is solved by Newton's method. Only the derivative with respect to the length is
    used; the rate of the force is taken from the previous iteration.
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
    needed = ("time", *model.input_names)
    if missing := [name for name in needed if name not in columns]:
        raise DataError(
            f"{model.name}: a force behind a tendon is computed from {', '.join(needed)} of a "
            f"recording, but the table lacks {' and '.join(missing)}",
            f"give a column for {' and for '.join(missing)}; the time is in s",
        )
    rows = {name: columns[name] for name in needed}
    return solve(
        lambda of_muscle: kinds.predict(body.muscle, of_muscle), rows, body.stiffness, body.force
    )


def _of_muscle(equation: Equation) -> Equation:
    """Return an equation of the muscle with new names for its length and velocity, because `length`
    and `velocity` are those of muscle and tendon together.
    """

    def renamed(text: str, underscore: str = "_") -> str:
        # in LaTeX, an underscore inside a name is written as `\_`
        return re.sub(r"\b(?=(length|velocity)\b(?!\\_))", f"muscle{underscore}", text)

    return replace(
        equation,
        text=renamed(equation.text),
        latex=renamed(equation.latex, r"\\_"),
        mathml=tuple(map(renamed, equation.mathml)),
        weight=renamed(equation.weight),
    )


class TendonVerbs(Verbs):
    """Operations of a model of a muscle in series with a tendon."""

    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return the force at every row of a recording, shape (n,).

        Raises DataError if the time or an input is missing.
        """
        return SimulatedRun(_force(model, columns), ())

    def outside_range(self, model: Model, columns: Columns) -> BoolArray:
        """Return True for rows at which the muscle, without the tendon, is outside its training
        range, shape (n,).
        """
        body = model.body_of(Tendon)
        of_muscle = muscle_columns(columns, _force(model, columns), body.stiffness, body.force)
        return kinds.outside_range(body.muscle, of_muscle)

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the equation for the length of the muscle (and for its velocity, if the velocity
        is an input), followed by the equations of the muscle.

        In these equations, `length` and `velocity` are those of muscle and tendon together, and
        `muscle_length` and `muscle_velocity` those of the muscle alone.
        """
        body, force = model.body_of(Tendon), model.output.name
        text = f"muscle_length = length - ({force} - {body.force:g})/{body.stiffness:g}"
        if "velocity" in model.input_names:
            text += f", muscle_velocity = velocity + rate({force})/{body.stiffness:g}"
        tendon = Equation(f"{body.muscle.name}: tendon", text, rf"\text{{{tex_text(text)}}}")
        return (tendon, *map(_of_muscle, kinds.equations(body.muscle, units)))

    def parameters(self, model: Model) -> int:
        """Return the number of parameters of the muscle. The tendon has none, because it is not
        fitted.
        """
        return kinds.parameters(model.body_of(Tendon).muscle)

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:  # noqa: ARG002
        """Raise DataError, because the force is the root of an equation at every sample, which no
        exported program can solve.
        """
        raise DataError(
            f"{model.name}: the force behind a tendon is found by solving an equation at "
            "every sample, which an exported program cannot do",
            f"export the muscle without its tendon, {model.body_of(Tendon).muscle.name}",
        )
