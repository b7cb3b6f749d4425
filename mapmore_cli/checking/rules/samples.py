"""Check samples: signals that are constant, repeated or clipped, load cycles without a movement,
copied files, targets far from zero, and pressures that are not at rest.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.checking import evidence
from mapmore_cli.checking.evidence import LITTLE, MUCH
from mapmore_cli.checking.findings import Severity
from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.domain.arrays import Array, extremes, in_blocks
from mapmore_cli.domain.recording import Recording
from mapmore_cli.domain.scores import FAR_FROM_ZERO
from mapmore_cli.modelling.signals.sampling import PART, even_share

# a sensor is saturated if an extreme value is this many times as frequent as any other value
FAR_MORE = 10
# these quantities hardly ever keep exactly the same value, unless their sensor is saturated
FROM_SENSORS = ("force", "pressure", "load")
# these targets vary around zero, even if the force does not
PARTS_OF_FORCE = ("hysteresis", "damping")


def constant(subject: Subject) -> Issues:
    """Find quantities that never change. They explain nothing, and a constant target needs no
    model.
    """
    for name in subject.spec.data.columns:
        low, high = subject.span(name)
        if low == high and sum(recording.rows_kept for recording in subject.recordings) > 1:
            target = name in subject.spec.targets
            yield Issue(
                "error" if target else "warning",
                "constant",
                subject.source(name),
                f"{name} has the same value, {low:g}, in every sample",
                "name another column" if target else "use another column, or remove this one",
                "data",
            )


def offset(subject: Subject) -> Issues:
    """Find a target far from zero, so that the error of any model is a small fraction of
    the largest target value.
    """
    spec = subject.spec
    name = spec.validation.as_ or subject.target
    if (
        spec.target in PARTS_OF_FORCE
        or spec.validation.normaliser == "range"
        or not subject.has(name)
    ):
        return
    low, high = subject.span(name)
    blocks = [x for recording in subject.recordings for (x,) in in_blocks(recording.columns[name])]
    mean = sum(float(x.sum()) for x in blocks) / sum(map(len, blocks))
    if abs(mean) > FAR_FROM_ZERO * (high - low) > 0:
        ends = f"{low:.6g} to {high:.6g} {subject.units[name]}"
        yield Issue(
            "hint",
            "offset",
            subject.source(name),
            f"{name} goes from {ends}, far from zero, so that its NRMSE is small even for a "
            "poor model",
            "subtract the initial value with `offset`, or write `validate: {normaliser: range}`",
        )


def same_signal(subject: Subject) -> Issues:
    """Find a signal that occurs in two columns, for example a sensor's voltage and the quantity
    computed from it. A model of one of the two must not use the other as an input.
    """
    names = [name for name in subject.spec.data.measured if name != "time" and subject.has(name)]
    for family in evidence.same_signals([subject.pooled(name) for name in names]):
        signals = " and ".join(names[place] for place in family)
        # inputs may be equal (as in a joint with two muscles), but no input may equal the target
        target = subject.target in (names[place] for place in family)
        yield Issue(
            "error" if target else "hint",
            "same-signal",
            subject.source(names[family[-1]]),
            f"{signals} are the same signal: each is a multiple of the other plus a "
            f"constant (correlation {1 - evidence.ROUNDING:g} or more)",
            "keep only the column that was really measured; the other quantity needs its "
            "own sensor",
        )


def clipped(subject: Subject) -> Issues:
    """Find saturated sensors: signals whose smallest or largest value occurs far more often than
    any other value.
    """
    levels = subject.spec.data.levels
    held = ("time", None if levels is None else levels.of)
    for name in subject.spec.data.columns:
        if name in held:
            continue
        largest = max(map(abs, subject.span(name))) if subject.has(name) else 0.0
        for recording in subject.kept:
            values = recording.columns.get(name, np.zeros(0))
            ends = zip(("above", "below"), extremes(values), strict=True) if values.size else ()
            some = values if len(values) <= PART else even_share(values)
            for side, end in ends:
                count = sum(int(np.count_nonzero(x == end)) for (x,) in in_blocks(values))
                # a slack muscle has zero force for a long time, which is no saturation
                rests = abs(end) < MUCH * largest
                if rests or count <= LITTLE * len(values):
                    continue
                others = np.unique(some[some != end], return_counts=True)[1]
                share = count * len(some) / len(values)
                if not others.size or share <= FAR_MORE * others.max():
                    continue
                yield _clipped(subject, recording, name, side, end, count)


def _clipped(
    subject: Subject, recording: Recording, name: str, side: str, end: float, count: int
) -> Issue:
    at = f"{end:.6g} {subject.units[name]}"
    exactly = f"{count} of {recording.rows_kept} samples have {name} at exactly {at}"
    leave_out = f"leave them out: `keep: [{{quantity: {name}, {side}: {end:.6g}}}]`"
    severity: Severity = "warning" if name in FROM_SENSORS else "hint"
    return Issue(
        severity,
        "clipped",
        subject.source(name),
        f"{recording.name}: {exactly}: the sensor is clipped, or {name} has a physical limit",
        f"if the sensor is at its limit, {leave_out}; if {name} itself stops there (an end "
        "stop, a full tank), keep the samples",
        "data",
    )


STILL = 0.05
"""A quantity is held constant if it moves in each recording by less than this fraction of its range
over all recordings.
"""


def still_cycles(subject: Subject) -> Issues:
    """Find load cycles of a quantity that was held constant, so that its reversals are only
    noise.
    """
    cycles = subject.spec.data.cycles
    if cycles is None or not subject.has(cycles.over):
        return
    low, high = subject.span(cycles.over)
    # movements below 5 % of the range of all recordings, or 1 % of the largest value, are noise
    least = max(STILL * (high - low), LITTLE * max(-low, high))
    columns = [recording.columns[cycles.over] for recording in subject.kept]
    noisy = [_is_noise(values) for values in columns]
    spans = [ends[1] - ends[0] for ends in map(extremes, columns)]
    everywhere = all(noise or span <= least for noise, span in zip(noisy, spans, strict=True))
    held = [
        recording.name
        for recording, noise in zip(subject.kept, noisy, strict=True)
        if noise or everywhere
    ]
    if held:
        others = f" and {len(held) - 1} more" if len(held) > 1 else ""
        yield Issue(
            "error" if everywhere else "warning",
            "cycles-of-nothing",
            subject.where("data", "cycles"),
            f"{cycles.over} is constant in {held[0]}{others}: its load cycles there would "
            "consist of noise only",
            "name the quantity that was moved up and down, for example `cycles: {over: strain}`",
            "data",
        )


def _is_noise(values: Array) -> bool:
    """Return True if the values are noise. Von Neumann's ratio, the mean squared difference of
    neighbouring samples divided by the variance, is 2 for noise and near 0 for a movement; the
    limit is 1.
    """
    x = values[:PART]
    return len(x) > 1 and float(np.mean(np.diff(x) ** 2)) >= float(np.var(x))


def recorded_twice(subject: Subject) -> Issues:
    """Find copied files. The samples of a copied file have twice the weight in a fit, and a copy
    among the validation data makes the validation worthless.
    """
    curves = subject.made.curves if subject.made else ()
    held_out = {name for curve in curves if curve.held_out.all() for name in curve.recordings}
    known: dict[tuple[object, ...], Recording] = {}
    for recording in subject.kept:
        # only measured columns are compared, not the values that a spec sets for whole files
        measured = [name for name in subject.spec.data.columns if name in recording.columns]
        samples = (hash(even_share(recording.columns[name]).tobytes()) for name in measured)
        twin = known.setdefault((recording.rows_kept, *measured, *samples), recording)
        if twin is recording:
            continue
        leak = (twin.id in held_out) != (recording.id in held_out)
        severity: Severity = "error" if leak else "warning"
        yield Issue(
            severity,
            "recorded-twice",
            recording.name,
            f"it has the same samples as {twin.name}"
            + (
                ", and one of the two is held out while the other is used for training"
                if leak
                else ""
            ),
            "leave one of the two out",
            "data",
        )


def unsettled(subject: Subject) -> Issues:
    """Find samples that were taken while the pressure changed. The force then lags behind the
    measured pressure, because the pressure sensor is at the valve.
    """
    data = subject.spec.data
    asked = any(keep.quantity.endswith("_rate") for keep in data.keep) or data.cycles is not None
    if (
        subject.spec.target != "static"
        or asked
        or subject.dataset.level == "pressure"
        or not subject.has("time", "pressure")
    ):
        return
    settling = evidence.settling(subject.recordings, subject.units["time"])
    if settling is not None and settling.share < MUCH:
        unit = f"{subject.units['pressure']}/s"
        window = f"{1000 * settling.window:g} ms"
        yield Issue(
            "hint",
            "unsettled",
            subject.where("data"),
            f"the pressure changes by more than {settling.limit:g} {unit} in "
            f"{1 - settling.share:.0%} of the samples, so that the recording is hardly "
            "static",
            "keep only samples at nearly constant pressure: derive `pressure_rate: "
            f"{{rate_of: pressure, window: {window}, order: 2}}` and add `keep: "
            f"[{{quantity: pressure_rate, abs_below: {settling.limit:g} {unit}}}]`",
        )
