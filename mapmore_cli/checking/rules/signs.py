"""Check signs: whether the force of a muscle pulls, and whether its strain is a contraction."""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.checking.evidence import LITTLE, ROUNDING
from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.domain.arrays import extremes, in_blocks
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling.shape.violations import KINDS
from mapmore_cli.modelling.signals.sampling import correlation, even_share

PULL = 0.01
"""Smallest share of pulling (positive) forces in the sum of all squared forces. If it is smaller,
the force has the wrong sign.
"""

NOISE = 0.1
"""Fraction of the largest force of all recordings. A recording with smaller forces is not examined,
because noise decides their sign.
"""


def force_never_pulls(subject: Subject) -> Issues:
    """Find a force that is almost never positive, in all recordings or in a single recording. A
    muscle pulls, and models treat a pulling force as positive. Noise, or a single spike above zero,
    is not enough to show that the force pulls.
    """
    if not subject.has("force"):
        return
    low, high = subject.span("force")
    turned = [recording for recording in subject.kept if _never_pulls(recording)]
    if turned and len(turned) == len(subject.kept):
        ends = f"it goes from {low:.4g} to {high:.4g}"
        yield _turned(subject, f"the force is almost never positive ({ends})", "")
        return
    largest = max(-low, high)
    for recording in turned:
        least = extremes(recording.columns["force"])[0]
        if -least > NOISE * largest:
            force = f"{recording.name}: the force is almost never positive (down to {least:.4g})"
            others = "while that of other recordings is"
            yield _turned(subject, f"{force}, {others}", " in a study of its own")


def _never_pulls(recording: Recording) -> bool:
    """Return True if the sum of squares of the positive forces is less than the fraction `PULL` of
    the sum of squares of all forces. The outermost forces count only up to a quantile, because a
    few wrong samples, for example -9999, do not say in which direction the others act.
    """
    above = below = 0.0
    for (x,) in in_blocks(recording.columns["force"]):
        x = np.clip(x, *np.quantile(x, (LITTLE, 1 - LITTLE), method="nearest"))
        above += float(np.sum(np.maximum(x, 0) ** 2))
        below += float(np.sum(np.minimum(x, 0) ** 2))
    return above < PULL * (above + below)


def _turned(subject: Subject, label: str, where: str) -> Issue:
    column = subject.spec.data.columns.get("force")
    scale = 1.0 if column is None else column.scale
    return Issue(
        "warning",
        "force-never-positive",
        subject.source("force"),
        f"{label}: its sign seems to be inverted",
        f"write `scale: {-scale:g}`{where}, so that a pulling force is positive",
    )


TURNED = 0.5
"""A strain is reported if its correlation has the wrong sign and a magnitude above this limit."""


def strain_turned(subject: Subject) -> Issues:
    """Find a strain in which a contraction is negative. At equal pressure, the force of a muscle
    falls with its contraction. If the force is constant or unknown, another fact is used: the
    contraction rises with the pressure.

    Only kinds of muscles of which this is known are examined. A strain that rises with the pressure
    has the right sign, even if the force rises with the strain, as in a muscle that stretches a
    spring.
    """
    muscle = subject.spec.muscle
    if muscle is None or muscle.kind not in KINDS or not subject.has("strain"):
        return
    if any(force_never_pulls(subject)):
        # if the force never pulls, its sign is probably wrong, and not the sign of the strain
        return
    strain, pressure, force = (
        even_share(subject.pooled(name)) if subject.has(name) else np.zeros(1)
        for name in ("strain", "pressure", "force")
    )
    rise = correlation(strain, pressure)
    if np.ptp(force):
        against = _partial(correlation(strain, force), rise, correlation(force, pressure))
        why = "the force rises with the strain at equal pressure"
    else:
        against, why = -rise, "the strain falls where the pressure rises"
    if against > TURNED and rise < TURNED:
        yield Issue(
            "warning",
            "strain-turned",
            subject.source("strain"),
            f"{why} (correlation {against:.2f}): the sign of the strain seems to be inverted",
            "turn its sign (`scale: -1` at its column, or a minus in `derive`), so that a "
            "contraction is positive",
        )


def _partial(between: float, first: float, second: float) -> float:
    """Return the partial correlation of two signals whose correlation is `between`. `first` and
    `second` are their correlations with a third signal, whose effect is removed. The result is 0 if
    the third signal explains one of the two signals up to rounding.
    """
    left = (1 - first**2) * (1 - second**2)
    return (between - first * second) / math.sqrt(left) if left > ROUNDING**2 else 0.0
