"""Check several columns together: a column from which the target was computed, and a difference of
outputs that the inputs do not explain.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.checking.evidence import FEWEST, ROUNDING, same_signals, unequal
from mapmore_cli.checking.findings import Severity
from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.domain.arrays import Array, extremes
from mapmore_cli.modelling.signals.sampling import even_share


def computed_from(subject: Subject) -> Issues:
    """Find a target that is a linear function of another column, with a separate offset in each
    recording, so that it was probably computed from that column.
    """
    target = subject.target
    if target not in subject.spec.data.columns or not subject.has(target):
        return
    for name in subject.spec.data.columns:
        if name in (target, "time") or not subject.has(name):
            continue
        if same_signals([subject.pooled(name), subject.pooled(target)]):
            continue  # the rule `same_signal` reports a column that repeats the target
        slopes = [
            _slope_of_line(recording.columns[name], recording.columns[target])
            for recording in subject.recordings
        ]
        known = np.array([slope for slope in slopes if slope is not None])
        if None not in slopes and np.ptp(known) <= ROUNDING * np.abs(known).max():
            yield Issue(
                "warning",
                "computed-from",
                subject.source(target),
                f"{target} equals {known[0]:.6g} times {name} plus a constant for each "
                f"recording, to within {ROUNDING:g} of its range",
                f"if it was computed from {name}, it is not a measurement: use the column "
                "of a sensor, or compute it with `derive`",
            )


def _slope_of_line(x: Array, y: Array) -> float | None:
    """Return the slope of the straight line on which all points (x, y) lie; None if they do not lie
    on a line.
    """
    if len(x) < FEWEST or not np.ptp(extremes(x)) or not np.ptp(extremes(y)):
        return None
    x, y = even_share(x), even_share(y)
    off = x - x.mean()
    slope = float(off @ y / (off @ off))
    left = np.abs(y - y.mean() - slope * off).max()
    return slope if left <= ROUNDING * float(np.ptp(y)) else None


def untold_difference(subject: Subject) -> Issues:
    """Find recordings with equal inputs and different outputs: the cause of the difference was not
    recorded, or a file has the wrong name.
    """
    data, target = subject.spec.data, subject.target
    inputs = {*data.quantities} - {*subject.spec.targets, "time", *data.derive}
    if not subject.has(target):
        return
    difference = unequal(subject.recordings, sorted(filter(subject.has, inputs)), target)
    if difference is not None:
        effects = "".join(f", {effect}: true" for effect in difference.effects)
        line = f"`data.groups: {{of: session{effects}}}` and " if effects else ""
        severity: Severity = "warning" if difference.is_large else "hint"
        place = subject.source(target)
        yield Issue(
            severity,
            "untold-difference",
            place,
            difference.words(),
            f"write {line}`set: {{session: 1}}` beside the files of each session, or correct the "
            "name of a file",
            "data",
        )
