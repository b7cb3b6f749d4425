"""Predict along a recording with a model of motion, and give its training range, equations and
program.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import mul

import numpy as np

from mapmore_cli.annexes.motion.body import BUMPLESS, HARD, REST, Motion, MotionSection, StateSpace
from mapmore_cli.annexes.motion.simulation import simulate as simulated
from mapmore_cli.domain.arrays import Columns, columns_at
from mapmore_cli.domain.models import Equation, Model
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling.expressions import Expression, Name, Number, add, parse, substitute
from mapmore_cli.modelling.expressions.syntax import ZERO, Condition, names_in
from mapmore_cli.modelling.kinds import Verbs
from mapmore_cli.modelling.literature.model import printed
from mapmore_cli.modelling.program.writing import Inputs, Side, Writer, limit, renamed_all, total

OfSection = Callable[[str, Sequence[Side]], Expression]
"""Function that writes the value of the active section. Its arguments are the beginning of the
names of new variables, and the values of all sections.
"""


def build(
    name: str,
    motion: Motion,
    training: Sequence[CurveRange],
    quantities: Mapping[str, Quantity],
    notes: tuple[str, ...],
) -> Model:
    """Return a model of motion. The `training` curves give the range of the inputs."""
    inputs = motion_inputs(motion)
    ranges = tuple(curve.of(inputs) for curve in training)
    return Model(
        name,
        quantities[motion.output],
        tuple(quantities[name] for name in inputs),
        StateSpace(motion, ranges),
        notes=notes,
    )


def motion_inputs(motion: Motion) -> list[str]:
    """Return the quantities that drive the sections: the input, then the load if there is one."""
    return list(dict.fromkeys([motion.input, *sorted(names_in(map(parse, motion.drives)))]))


def _motion(model: Model) -> Motion:
    return model.body_of(StateSpace).motion


def _falls(m: Writer, motion: Motion, u: Expression, first: Condition) -> Expression:
    """Return an expression for the program, which is 1 if the input does not rise above its value
    one sample before, and 0 otherwise (equation 16 of Brown and Xie 2024).

    With bumpless switching, the expression becomes 1 when the input has fallen by more than the
    dead band from its last maximum, and 0 when it has risen by more than the dead band from its
    last minimum.
    """
    if motion.switching != BUMPLESS:
        before = m.number("input")
        falls = m.choose("falls", [(first, 1), (u > before, 0)], 1)
        m.keep(before, u)
        return falls
    play, falling, half = m.number("play"), m.number("falling"), 0.5 * motion.dead_band
    low, high = m.let("low", u - half), m.let("high", u + half)
    moved = m.choose("play", [(first, u)], lambda: m.clip(play, low, high))
    falls = m.choose("falls", [(first, 0), (low > play, 0), (high < play, 1)], falling)
    m.keep(play, moved)
    m.keep(falling, falls)
    return falls


def _separate(
    m: Writer, motion: Motion, of_section: OfSection, drives: list[Expression], first: Condition
) -> Expression:
    """Return an expression for the output of the active section. The statements that simulate every
    section with the whole input are added to the program.
    """
    outputs = []
    for section in motion.sections:
        origin, now, later = (m.number(stem) for stem in ("origin", "now", "later"))
        drive = m.let("driven", _driven(section, drives))
        began = m.choose("began", [(first, drive)], origin) if motion.start == REST else ZERO
        x1, z = (
            m.choose(stem, [(first, ZERO)], name)
            for stem, name in (("moved", now), ("ahead", later))
        )
        outputs.append(m.let("output", x1 + began / (1.0 - section.p1 - section.p2)))
        following, ahead = (
            m.let("following", z + section.p2 * x1),
            m.let("coming", (drive - began) + section.p1 * x1),
        )
        for name, value in ((origin, began), (now, following), (later, ahead)):
            m.keep(name, value)
    return of_section("motion", outputs)


def _shared(
    m: Writer, motion: Motion, of_section: OfSection, drives: list[Expression], first: Condition
) -> Expression:
    """Return an expression for the output of sections that share one state: `x1[k+2] = P2 x1[k+1] +
    P1 x1[k] + d[k]`, with P1, P2 and the drive d of the active section (equation 10 of Brown and
    Xie 2024).
    """
    now, later = m.number("now"), m.number("later")
    resting = [
        lambda section=section: _driven(section, drives) / (1.0 - section.p1 - section.p2)
        for section in motion.sections
    ]
    rest = of_section("rest", resting) if motion.start == REST else ZERO
    x1, x2 = (
        m.choose(stem, [(first, rest)], name) for stem, name in (("output", now), ("ahead", later))
    )
    coming = [
        lambda section=section: total(
            [_driven(section, drives), total([section.p2 * x2, section.p1 * x1])]
        )
        for section in motion.sections
    ]
    after = of_section("following", coming)
    m.keep(now, x2)
    m.keep(later, after)
    return x1


def _driven(section: MotionSection, drives: list[Expression]) -> Expression:
    return total(
        [weight * drive for weight, drive in zip(section.weights.tolist(), drives, strict=True)]
    )


class MotionVerbs(Verbs):
    """Operations of a model of motion, for example its prediction and its equations."""

    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return the output along one recording, (n,). It begins as `start` of the model says: at
        rest, or at zero. The output is NaN at rows with an input of NaN, and the model starts again
        after such rows.
        """
        names = [
            *model.input_names,
            *(["time"] if "time" in columns else []),
        ]
        numbers = {name: np.asarray(columns[name], dtype=np.float64) for name in names}
        known = np.logical_and.reduce([np.isfinite(column) for column in numbers.values()])
        values = np.full(len(known), np.nan)
        for rows in np.split(np.arange(len(known)), np.flatnonzero(np.diff(known)) + 1):
            if len(rows) and known[rows[0]]:
                values[rows] = simulated(_motion(model), columns_at(numbers, rows))
        return SimulatedRun(values)

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the equation `y[k] = P2 y[k-1] + P1 y[k-2] + sum_m w_m d_m[k-2]` of every section,
        with its numbers. `units` is as in `kinds.equations`.
        """
        motion = _motion(model)
        delayed = {
            name: Number(units[name]) * Name(f"{name}[k-2]")
            if name in units
            else Name(f"{name}[k-2]")
            for name in motion_inputs(motion)
        }
        drives = [substitute(parse(text), delayed) for text in motion.drives]
        once, twice = (Name(f"{motion.output}[k-{lag}]") for lag in (1, 2))
        sums = {
            section.id: (
                section.p2 * once,
                section.p1 * twice,
                *map(mul, section.weights.tolist(), drives),
            )
            for section in motion.sections
        }
        return tuple(printed(name, add(*terms)) for name, terms in sums.items())

    def rules(self, model: Model) -> tuple[str, ...]:
        """Return sentences that say how the sections are simulated."""
        motion = _motion(model)
        ways = {
            "hard": "every section runs, and the output of the active one is used",
            "carried": "each section passes its state on to the next",
            "bumpless": "sections share one state, and meet at their boundaries",
        }
        at = ", ".join(f"{boundary:g}" for boundary in motion.boundaries)
        places = f"Sections meet at {motion.input} {at}. " if at else ""
        return (
            f"{places}Switching: {motion.switching} ({ways[motion.switching]}), at steps of "
            f"{motion.step:.6g} s, from {motion.start}.",
        )

    def parameters(self, model: Model) -> int:
        """Return the number of parameters: P1, P2 and the weights of all sections."""
        return sum(2 + len(section.weights) for section in _motion(model).sections)

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Write the program of a model of motion. As `start` says, a run begins at rest under the
        first input, or at zero.
        """
        body = model.body_of(StateSpace)
        motion = body.motion
        limit(m, body.ranges, None, inputs)
        m.kept.steps.append(motion.step)
        seen = m.number("seen")
        first = Condition(seen, "==", ZERO)
        drives = [m.let("drive", drive) for drive in renamed_all(map(parse, motion.drives), inputs)]
        u = inputs[motion.input]
        section = m.choose(
            "place",
            [(u < boundary, place) for place, boundary in enumerate(motion.boundaries)],
            len(motion.boundaries),
        )
        if motion.directed:
            section = m.let("section", 2 * section + _falls(m, motion, u, first))

        def of_section(stem: str, values: Sequence[Side]) -> Expression:
            """Return an expression for one of the `values`: that of the active section. Sections
            are numbered as in `simulation.active`.
            """
            return m.choose(
                stem,
                [
                    (Condition(section, "==", Number(float(i))), value)
                    for i, value in enumerate(values[:-1])
                ],
                values[-1],
            )

        value = (_separate if motion.switching == HARD else _shared)(
            m, motion, of_section, drives, first
        )
        m.keep(seen, 1)
        return value

    def faults(self, model: Model) -> Iterator[str]:
        """Yield the faults of a stored model that a prediction would not reveal."""
        motion = _motion(model)
        if len(motion.sections) != (len(motion.boundaries) + 1) * (1 + motion.directed):
            yield "the number of its sections does not match its boundaries"
