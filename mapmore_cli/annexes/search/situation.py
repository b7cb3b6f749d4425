"""Describe a study before its structure is searched: names, counts and steps, from the training
samples only.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.memory.records import sampled
from mapmore_cli.modelling.signals.sampling import correlation

NOT_INPUTS = ("time", "hysteresis", "static_force")
"""Quantities that are no inputs: the clock, and the quantities that `cycles` and the target
`damping` compute from the target.
"""

SAME = 1e-9
"""An input is treated as a linear function of another input if linear regression on the other input
leaves less than this fraction of its variance.
"""

FEWEST_IN_A_RECORD = 60
"""Smallest number of steps in the longest recording for which models with memory are tried."""


@dataclass(frozen=True)
class Situation:
    """Properties of a study on which families of candidates depend.

    Attributes
    ----------
    target, inputs
        The output, and all other quantities that vary: the swept quantity comes first, the level
        last.
    level
        The quantity that is constant within a curve; None without levels.
    samples, curves
        Number of training samples, and of curves that have training samples.
    step, steps
        Time between samples, s, and the number of steps in the longest recording. `step` is None if
        the steps are not equal; models can then not use earlier samples.
    around_zero
        Inputs that take both signs.
    ordered
        True if samples are in the order of time at unequal steps, so that it is known whether an
        input rises or falls.
    """

    target: str
    inputs: tuple[str, ...]
    level: str | None
    samples: int
    curves: int
    step: float | None = None
    steps: int = 0
    around_zero: tuple[str, ...] = ()
    ordered: bool = False

    @property
    def timed(self) -> bool:
        """Return True if recordings are in the order of time at equal steps."""
        return self.step is not None

    @property
    def moving(self) -> tuple[str, ...]:
        """Names of the inputs that move within a recording."""
        return tuple(name for name in self.inputs if name != self.level)


def situation_of(
    dataset: Dataset, ignored: Sequence[str] = (), inputs: Sequence[str] | None = None
) -> Situation:
    """Return the properties of the training samples of a dataset. Every curve has at least one
    training sample. If `inputs` is given, only these quantities are inputs. Otherwise, every
    quantity that varies is an input, except the `ignored` quantities.
    """
    curves, pooled = dataset.curves, pooled_training(dataset.curves)
    no_inputs = (dataset.target, *NOT_INPUTS, *ignored)
    known = [name for name in pooled if name in dataset.quantities and name not in no_inputs]
    wanted = known if inputs is None else inputs
    apart = [name for name in wanted if np.ptp(pooled[name]) > 0]
    if inputs is None:
        apart = _different(apart, pooled, dataset.level)
    if apart == [dataset.level]:
        raise DataError(
            f"levels: {dataset.level} is the only input that varies, so that nothing varies "
            "within a curve at one level",
            f"remove `levels` from `data`: {dataset.level} is then an input like others",
        )

    def rank(name: str) -> tuple[bool, float]:
        widths = [np.ptp(curve.columns[name][curve.training]) for curve in curves]
        return name == dataset.level, -round(np.mean(widths) / np.ptp(pooled[name]), 3)

    ordered = sorted(apart, key=rank)
    step, steps = None, 0
    if "time" in pooled:
        with suppress(DataError):
            even, _, records = sampled(curves)
            longest = max(record.size for record in records) - 1
            if longest >= FEWEST_IN_A_RECORD:
                step, steps = even, longest
    return Situation(
        target=dataset.target,
        inputs=tuple(ordered),
        level=dataset.level,
        samples=len(pooled[dataset.target]),
        curves=len(curves),
        step=step,
        steps=steps,
        around_zero=tuple(name for name in ordered if pooled[name].min() < 0 < pooled[name].max()),
    )


def _different(names: Sequence[str], pooled: Mapping[str, Array], level: str | None) -> list[str]:
    """Return the names of the quantities that are no linear function of another returned quantity.
    If two quantities are linear functions of each other, only one of them is returned: the level,
    if it is one of them; otherwise the quantity that more formulas of the literature use (the
    strain rather than a length or a displacement); if both are used equally often, the quantity
    that comes later in `names`.
    """
    formulas = map(literature.get, literature.names())
    uses = Counter(name for formula in formulas for name in formula.inputs)

    kept: list[str] = []
    for name in sorted(names, key=lambda name: (name != level, -uses[name], -names.index(name))):
        if all(abs(correlation(pooled[name], pooled[other])) < 1 - SAME for other in kept):
            kept.append(name)
    return [name for name in names if name in kept]
