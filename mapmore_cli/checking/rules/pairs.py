"""Rules about what should tell the target: a column that it was computed from, and inputs that
leave a difference untold.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.checking.evidence import FEWEST_SAME, same_signals
from mapmore_cli.checking.findings import Severity
from mapmore_cli.checking.rules import Issue, Subject
from mapmore_cli.domain.arrays import Array, extremes
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling.signals.sampling import even_share

# of the range of the target, that a straight line leaves of what was computed by one
OF_A_LINE = 1e-4
HARDLY_REPEATED = 0.1  # of the range of the target: a difference that hardly is repeatability
# of the samples of the longer recording, that two of the same inputs have in common
IN_COMMON = 0.9


def computed_from(subject: Subject) -> Iterator[Issue]:
    """Find a target that is a straight line of another column, in each recording with an offset of
    its own.
    """
    target = subject.spec.target_quantity
    if target not in subject.spec.data.columns or not subject.has(target):
        return
    others = [name for name in subject.spec.data.columns if name not in (target, "time")]
    for name in (one for one in others if subject.has(one)):
        if same_signals([subject.pooled(name), subject.pooled(target)]):
            continue  # told as an error
        slopes = [
            _slope_of_line(one.columns[name], one.columns[target]) for one in subject.recordings
        ]
        known = np.array([slope for slope in slopes if slope is not None])
        if None not in slopes and np.ptp(known) <= OF_A_LINE * np.abs(known).max():
            message = (
                f"{target} is {known[0]:.6g} times {name}, plus a constant of each recording, "
                f"to {OF_A_LINE:g} of its range"
            )
            remedy = (
                f"was it computed from {name}? Then it is no measurement: name the column of "
                "a sensor, or `derive` it"
            )
            yield Issue("warning", "computed-from", subject.source(target), message, remedy)


def _slope_of_line(x: Array, y: Array) -> float | None:
    """Return the slope of a straight line that tells `y`; None where none does."""
    if len(x) < FEWEST_SAME or not np.ptp(extremes(x)) or not np.ptp(extremes(y)):
        return None
    x, y = even_share(x), even_share(y)
    off = x - x.mean()
    slope = float(off @ y / (off @ off))
    left = np.abs(y - y.mean() - slope * off).max()
    return slope if left <= OF_A_LINE * float(np.ptp(y)) else None


def untold_difference(subject: Subject) -> Iterator[Issue]:
    """Find recordings with equal inputs and another output: what made the difference was not
    recorded, or a file has another's name.
    """
    target = subject.spec.target_quantity
    names = [name for name in subject.spec.data.quantities if subject.has(name)]
    inputs = [name for name in names if name not in (target, "time")]
    if target not in names or not any(np.ptp(subject.span(name)) for name in inputs):
        return
    span = float(np.ptp(subject.span(target)))
    alike: dict[tuple[str, ...], list[Recording]] = {}
    for recording in (one for one in subject.recordings if one.rows_kept >= FEWEST_SAME):
        begins = np.concatenate([recording.columns[name][:FEWEST_SAME] for name in inputs])
        others = alike.setdefault(tuple(f"{value:.4g}" for value in begins), [])
        twin = next((one for one in others if _equal_inputs(one, recording, inputs)), None)
        if twin is None:
            others.append(recording)
            continue
        both = min(twin.rows_kept, recording.rows_kept)
        apart = float(np.abs(twin.columns[target][:both] - recording.columns[target][:both]).max())
        if apart <= OF_A_LINE * span:
            continue
        share = f"{apart:.4g} {subject.units[target]} ({apart / span:.2g} of its range)"
        message = (
            f"{recording.source} has the same {', '.join(inputs)} as {twin.source}, and "
            f"{target} differs by up to {share}"
        )
        remedy = (
            "set what differed for the files (`set: {specimen: 2}`), or correct a name; "
            "repeats of one test show its repeatability"
        )
        severity: Severity = "warning" if apart > HARDLY_REPEATED * span else "hint"
        place = subject.source(target)
        yield Issue(severity, "untold-difference", place, message, remedy, "data")


def _equal_inputs(one: Recording, other: Recording, inputs: list[str]) -> bool:
    few, many = sorted((one.rows_kept, other.rows_kept))
    return few >= IN_COMMON * many and all(
        np.allclose(one.columns[n][:few], other.columns[n][:few], rtol=1e-6, atol=0) for n in inputs
    )
