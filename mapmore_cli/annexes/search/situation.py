"""What is known of a study before its structure is searched: names, counts and steps, of the
training samples alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.signals.sampling import UNEVEN, correlation

NOT_INPUTS = ("time", "hysteresis")
"""Quantities that are no inputs: the clock, and what `cycles` makes of the target."""

SAME = 1e-9
"""Of its variance: what another input leaves of one that says the same."""

FEWEST_IN_A_RECORD = 60
"""Samples of the longest recording, from which on a model with memory is tried."""

WITHIN = (1, 3)
"""Steps over which changes are told."""

FEWEST_IN_ORDER = 0.5
"""Share of the training samples that lie in recordings at even steps, from which on a model with
memory is tried.
"""


@dataclass(frozen=True)
class Situation:
    """What families of candidates look at.

    Attributes
    ----------
    target, inputs
        The output, and every other quantity that varies, the one that is swept first and the level
        last.
    level
        The quantity that is held within a curve; None without levels.
    samples, curves
        Training samples, and curves that have some.
    step, longest
        Time between samples and duration of the longest recording, s; None where recordings are not
        at even steps, so that nothing can be said of the past.
    around_zero
        Inputs that take both signs, each with its root mean square.
    changes
        The root mean square of how far an input moves within some steps, by its name and the number
        of steps.
    """

    target: str
    inputs: tuple[str, ...]
    level: str | None
    samples: int
    curves: int
    step: float | None = None
    longest: float = 0.0
    around_zero: Mapping[str, float] = field(default_factory=dict)
    changes: Mapping[tuple[str, int], float] = field(default_factory=dict)

    @property
    def timed(self) -> bool:
        """Whether recordings are in order of time at even steps."""
        return self.step is not None

    @property
    def moving(self) -> tuple[str, ...]:
        """The inputs that move within a recording."""
        return tuple(name for name in self.inputs if name != self.level)

    @property
    def swept(self) -> str:
        """The input that moves most."""
        return (self.moving or self.inputs)[0]

    @property
    def steps(self) -> int:
        """Steps of the longest recording."""
        return 0 if self.step is None else round(self.longest / self.step)


def situation_of(
    dataset: Dataset, ignored: Sequence[str] = (), inputs: Sequence[str] | None = None
) -> Situation:
    """Look at the training samples of a dataset; `ignored` are no inputs, `inputs` are all of them
    where they are given.
    """
    training = [curve for curve in dataset.curves if curve.training.any()]
    pooled = {
        name: np.concatenate([curve.columns[name][curve.training] for curve in training])
        for name in training[0].columns
        if name in dataset.quantities
    }
    wanted = (
        inputs
        if inputs is not None
        else [name for name in pooled if name not in (dataset.target, *NOT_INPUTS, *ignored)]
    )
    varied = [name for name in wanted if np.ptp(pooled[name]) > 0]
    apart = varied if inputs is not None else list(_different(varied, pooled, dataset.level))
    spread = {
        name: _within([curve.columns[name][curve.training] for curve in training], pooled[name])
        for name in apart
    }
    ordered = sorted(
        apart, key=lambda name: (name == dataset.level, -round(spread[name], 3), apart.index(name))
    )
    step, longest = _step(training) if "time" in pooled else (None, 0.0)
    return Situation(
        target=dataset.target,
        inputs=tuple(ordered),
        level=dataset.level,
        samples=len(pooled[dataset.target]),
        curves=len(training),
        step=step,
        longest=longest,
        around_zero={
            name: float(np.sqrt(np.mean(pooled[name] ** 2)))
            for name in ordered
            if pooled[name].min() < 0 < pooled[name].max()
        },
        changes={}
        if step is None
        else dict(_changes(training, [name for name in ordered if name != dataset.level])),
    )


def _changes(
    curves: Sequence[Curve], names: Sequence[str]
) -> Iterator[tuple[tuple[str, int], float]]:
    """How far each input moves within some steps, root mean square over all recordings; without
    those that stand still.
    """
    for name in names:
        for steps in WITHIN:
            parts = [
                (curve.columns[name][log], curve.training[log])
                for curve in curves
                for log in curve.logs
                if len(log) > steps
            ]
            moved = np.concatenate(
                [
                    np.zeros(1),
                    *(
                        (x[steps:] - x[:-steps])[known[steps:] & known[:-steps]]
                        for x, known in parts
                    ),
                ]
            )
            size = float(np.sqrt(np.mean(moved**2)))
            if size > 0:
                yield (name, steps), size


def _different(
    names: Sequence[str], pooled: Mapping[str, Array], level: str | None
) -> Iterator[str]:
    """Yield the names without those that are a straight line of another, of which a level, a
    canonical and a later one are kept.
    """
    kept: list[str] = []
    for name in sorted(names, key=lambda one: (one != level, -names.index(one))):
        if all(abs(correlation(pooled[name], pooled[other])) < 1 - SAME for other in kept):
            kept.append(name)
    yield from (name for name in names if name in kept)


def _within(parts: Sequence[Array], whole: Array) -> float:
    """How far a quantity moves within a curve, relative to its range."""
    return float(np.mean([np.ptp(part) for part in parts]) / np.ptp(whole))


def _step(curves: Sequence[Curve]) -> tuple[float | None, float]:
    """Return the even time step and the longest uninterrupted recording, s; None where the most
    samples are not in order at even steps.
    """
    steps = [np.diff(curve.columns["time"][log]) for curve in curves for log in curve.logs]
    every = np.concatenate(steps) if steps else np.zeros(0)
    if not len(every) or (usual := float(np.median(every))) <= 0:
        return None, 0.0
    slack = UNEVEN * usual + 4 * np.finfo(np.float64).eps * max(
        float(np.abs(curve.columns["time"]).max()) for curve in curves
    )
    early = (every >= 0) & (every < usual - slack)
    lengths = [_longest_run(np.abs(one - usual) <= slack) for one in steps]
    if (
        early.any()
        or np.mean(np.abs(every - usual) <= slack) < FEWEST_IN_ORDER
        or max(lengths) < FEWEST_IN_A_RECORD
    ):
        return None, 0.0
    return usual, usual * max(lengths)


def _longest_run(true: BoolArray) -> int:
    """Return the most samples in a row for which something is true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], true.astype(int), [0]])))
    return int((edges[1::2] - edges[::2]).max(initial=0))
