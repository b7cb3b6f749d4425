"""Make curves from recordings: sort samples by level, and join the branches of load cycles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from mapmore_cli.domain.arrays import (
    Array,
    BoolArray,
    Columns,
    Rows,
    by_blocks,
    extremes,
    joined,
    picked,
    row_numbers,
)
from mapmore_cli.domain.errors import DataError, SpecError, Warn
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import DAMPING, STATIC_FORCE, Curve, Quantity, Recording, united
from mapmore_cli.ingestion.samples import located
from mapmore_cli.modelling.kinds import alone, outside_range, predict
from mapmore_cli.modelling.signals.cycles import split_cycles
from mapmore_cli.modelling.signals.plateau import (
    default_within,
    find_levels,
    find_plateau,
    match_levels,
    without_steady_state,
)
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.sections.data import STEP_OF, STEP_PRESSURE, Cycles, Levels
from mapmore_cli.study.units import convert

PLATEAU = "plateau"
"""Column that is 1 on the plateau of a step response, and 0 elsewhere."""

MOSTLY = 0.9
"""A warning is raised if more than this fraction of the samples on a plateau lies outside the
training range. The limit is high, because at the highest level, noise alone puts half of the
samples outside.
"""

Plateau = Literal["auto"] | tuple[float, float]


def with_plateau(recording: Recording, plateau: Plateau, units: Mapping[str, str]) -> Recording:
    """Return the recording with two more columns: `plateau`, which is 1 for samples on the plateau
    of the step response and 0 otherwise, and `step_pressure`, the mean pressure on the plateau.

    Raises DataError if no plateau is found, or if the time interval in the spec contains no sample.
    """
    columns = recording.columns
    seconds = convert(columns["time"], units["time"], "s")
    if plateau == "auto":
        others = {name: columns[name] for name in ("strain", "displacement") if name in columns}
        with located(recording.name):
            start, end = find_plateau(seconds, columns[STEP_OF], others)
    else:
        start, end = plateau
    on: BoolArray = (seconds >= start) & (seconds <= end)
    if not on.any():
        problem = (
            f"there is no sample from {start:g} s to {end:g} s, where the spec has the "
            "plateau; the recording covers"
        )
        place = f"{seconds[0]:g} s to {seconds[-1]:g} s"
        raise DataError(
            f"{recording.name}: {problem} {place}",
            "give another `plateau`, or write `plateau: auto`",
        )
    step = np.full(len(on), columns[STEP_OF][on].mean())
    return replace(recording, columns={**columns, PLATEAU: on.astype(float), STEP_PRESSURE: step})


def static_model(run_dir: Path, force: Quantity, units: Mapping[str, str]) -> Model:
    """Return the model of the static run that the spec names in `needs.static`.

    Raises SpecError if the model predicts another quantity than `force` or uses another unit, or if
    the recordings lack one of its inputs or have it in another unit.
    """
    model = alone(RunFiles(run_dir).model())
    if model.output != force:
        predicted = f"{model.output.name} in {model.output.unit}"
        raise SpecError(
            f"needs.static: the model of {model.name} predicts {predicted}, not {force.name} in "
            f"{force.unit}",
            "name a run of such a model in `needs.static`",
        )
    for quantity in model.inputs:
        if units.get(quantity.name) != quantity.unit:
            have = f"has it in {units[quantity.name]}" if quantity.name in units else "lacks it"
            raise SpecError(
                f"needs.static: the model of {model.name} needs {quantity.name} in "
                f"{quantity.unit}; this study {have}",
                f"declare the column, or set `units: {{{quantity.name}: {quantity.unit}}}`",
            )
    return model


def with_damping(recording: Recording, force: str, static: Model, warn: Warn) -> Recording:
    """Return the recording with two more columns: `static_force`, F_s, and `damping`, F_d. The
    damping is the difference F - F_s, minus the mean of this difference on the plateau (M2 eq 1).
    """
    columns = recording.columns
    static_force = predict(static, columns)
    beyond = outside_range(static, columns)
    on = columns[PLATEAU] == 1.0
    if beyond[on].mean() > MOSTLY:
        warn(
            f"{recording.name}: its plateau lies outside the training range of the static model "
            f"{static.name}, so the static force there is a guess; train the static model there too"
        )
    damping = without_steady_state(columns[force] - static_force, on)
    return replace(recording, columns={**columns, STATIC_FORCE: static_force, DAMPING: damping})


MEANT = 0.25
"""Largest distance between a value that a user writes and the level that it means, as a fraction of
the smallest distance between levels.
"""


@dataclass(frozen=True)
class LevelSet:
    """The levels `at`, (m,) in ascending order, at which the quantity `of` was held constant. A
    sample is at a level if its distance from the level is at most `within`.

    If `nominal` is True, the level replaces the measured value of each sample.
    """

    of: str
    at: Array
    within: float
    nominal: bool = False

    def match(self, values: Array) -> Array:
        """Return the level of every value, (n,); NaN for a value that is not within `within` of any
        level.
        """
        index = match_levels(values, self.at, self.within)
        return np.where(index >= 0, self.at[index], np.nan)

    def named(self, value: float) -> float | None:
        """Return the level that a user means by `value`: the nearest one, if it lies within a
        quarter of the smallest distance between levels; otherwise None.
        """
        level = float(self.at[np.argmin(np.abs(self.at - value))])
        distance = 2 * default_within(self.at) if len(self.at) > 1 else abs(level)
        # the tolerance 1e-12 accepts a value whose distance is exactly a quarter, despite
        # rounding errors
        reach = MEANT * distance + 1e-12 * abs(value)
        return level if abs(level - value) <= reach else None

    def describe(self) -> str:
        """Return a description of the levels in one line."""
        reach = f"within {self.within:g}" if np.isfinite(self.within) else "all samples"
        return f"levels of {self.of}: {', '.join(f'{value:g}' for value in self.at)} ({reach})"


@dataclass(frozen=True)
class LevelPart:
    """Samples of one recording at one level, (n,) each.

    `log` is the number of the log that contains these samples, `whole` is the number of samples in
    this log, and `places` are the indices of these samples in the log. If load cycles were
    resampled, `measured` holds the smallest and the largest measured value of each quantity.
    """

    recording: Recording
    level: float | None
    columns: Columns
    places: Rows
    whole: int
    log: int
    measured: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of samples, n."""
        return len(self.places)

    def behind(self, share: float) -> BoolArray:
        """Return a mask, (n,), that is True for samples in the last part of their log. This part
        begins after the fraction `share` of all samples of the log.
        """
        late: BoolArray = by_blocks(
            lambda part: (row_numbers(part) + 0.5) / self.whole > share, self.places
        )
        return late


def level_set(levels: Levels, recordings: Sequence[Recording]) -> LevelSet:
    """Return the levels in the spec. If the spec says `at: auto`, return the values at which the
    quantity was held constant in the recordings.
    """
    of = levels.of
    if levels.at == "auto":
        at = find_levels(joined([recording.columns[of] for recording in recordings]))
        if not at.size:
            raise DataError(
                f"levels: {of} is never held constant, so that no levels can be found",
                "Give the levels, for example `at: [80, 150]`.",
            )
    else:
        # adding zero turns -0 into 0, so that no id of a curve contains it
        at = np.sort(np.array(levels.at, dtype=float)) + 0.0
    within = levels.within if levels.within is not None else default_within(at)
    return LevelSet(of, at, within, nominal=levels.value == "nominal")


def cut_by_level(
    logs: Sequence[Sequence[Recording]], levels: LevelSet | None
) -> tuple[list[Recording], list[LevelPart]]:
    """Return the recordings without the samples that lie between levels, and a list of parts. A
    part contains the samples of one recording at one level. Without levels, every recording is one
    part.

    The recordings in one element of `logs` are the pieces of one log, in the order of time. Raises
    DataError for a level without samples.
    """
    recordings, parts = list[Recording](), list[LevelPart]()
    for number, log in enumerate(logs):
        whole, start = sum(piece.rows_kept for piece in log), 0
        for recording in log:
            places = range(start, start := start + recording.rows_kept)
            if levels is None:
                recordings.append(recording)
                parts.append(LevelPart(recording, None, recording.columns, places, whole, number))
                continue
            kept, level = _at_levels_only(recording, levels)
            recordings.append(kept)
            for value in np.unique(levels.at).tolist():
                mask = by_blocks(partial(np.equal, value), level)
                if mask.any():
                    columns = {
                        name: picked(values, mask) for name, values in recording.columns.items()
                    }
                    there = picked(places, mask)
                    parts.append(LevelPart(kept, value, columns, there, whole, number))
    there_are = {part.level for part in parts}
    for level in [] if levels is None else levels.at:
        if level not in there_are:
            assert levels is not None
            values = np.concatenate(
                [recording.columns[levels.of] for log in logs for recording in log]
            )
            raise DataError(
                f"levels: no sample is within {levels.within:g} of {levels.of}={level:g}",
                f"{levels.of} goes from {values.min():g} to {values.max():g}; give other "
                "levels or a larger `within`.",
            )
    return recordings, parts


def _at_levels_only(recording: Recording, levels: LevelSet) -> tuple[Recording, Array]:
    """Return the recording without the samples that lie between levels. Also return the level of
    each original sample, (n,), with NaN for a sample between levels.
    """
    level = by_blocks(levels.match, recording.columns[levels.of])
    at_one = by_blocks(np.isfinite, level)
    lost = int(np.count_nonzero(~at_one))
    reason = f"not within {levels.within:g} of any level of {levels.of}"
    dropped = {**recording.dropped, reason: lost} if lost else recording.dropped
    columns = {name: picked(values, at_one) for name, values in recording.columns.items()}
    first = 0 if lost else recording.first_row
    return replace(recording, columns=columns, dropped=dropped, first_row=first), level


def join_branches(part: LevelPart, cycles: Cycles, target: str) -> LevelPart:
    """Replace the load cycles of a part by their static and hysteresis components (M1 IV.A).

    Both branches of the cycles are interpolated at the same values of the quantity `cycles.over`.
    For every quantity, the static component, which is the mean of the two branches, replaces the
    measured values. A column `hysteresis` is added for the target. It is not added if the target is
    `cycles.over` itself, because this quantity is equal in both branches. The result has no column
    `time`.
    """
    over = cycles.over
    where = (
        part.recording.name
        if part.level is None
        else f"{part.recording.name}, level {part.level:g}"
    )
    others = {name: values for name, values in part.columns.items() if name not in (over, "time")}
    with located(f"{where} ({part.size} samples)"):
        branches = split_cycles(part.columns[over], others, cycles.samples)
    columns = {over: branches.over, **branches.static()}
    if target != over:
        columns["hysteresis"] = branches.hysteresis(target)
    measured = {name: extremes(x) for name, x in part.columns.items() if name in columns}
    places = range(cycles.samples)
    return LevelPart(
        part.recording, part.level, columns, places, cycles.samples, part.log, measured
    )


def joined_curves(
    parts: Sequence[LevelPart], held_out: Sequence[BoolArray], levels: LevelSet | None
) -> tuple[Curve, ...]:
    """Return the curves. A curve consists of all parts at one level, and the curves are in the
    order of the levels. Without levels, every recording is a curve.
    """
    members: dict[str, list[int]] = {}
    for number in sorted(range(len(parts)), key=lambda number: parts[number].level or 0.0):
        level = parts[number].level
        key = f"{levels.of}={level:g}" if levels is not None else parts[number].recording.id
        members.setdefault(key, []).append(number)
    nominal = levels.of if levels is not None and levels.nominal else None
    return tuple(
        _joined_parts(key, [parts[i] for i in group], [held_out[i] for i in group], nominal)
        for key, group in members.items()
    )


def _joined_parts(
    key: str, parts: Sequence[LevelPart], masks: Sequence[BoolArray], nominal: str | None
) -> Curve:
    """Join parts to one curve. If `nominal` names a quantity, its measured values are replaced by
    the level of the parts.
    """
    columns = {name: joined([part.columns[name] for part in parts]) for name in parts[0].columns}
    plateau = columns.pop(PLATEAU, None)
    ends = np.cumsum([part.size for part in parts])
    if nominal is not None:
        columns[nominal] = np.full(int(ends[-1]), parts[0].level, dtype=float)
    training = [part.measured for part, mask in zip(parts, masks, strict=True) if not mask.all()]
    return Curve(
        key,
        parts[0].level,
        columns,
        np.concatenate(masks),
        tuple(part.recording.id for part in parts),
        None if plateau is None else plateau == 1.0,
        None
        if len(parts) == 1
        else np.repeat(np.arange(len(parts)), [part.size for part in parts]),
        {name: known for name, known in united(training).items() if name != nominal},
    )
