"""Make a dataset from files: read, clean, convert to the model's units, sort into curves, and
divide into training and validation.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import extremes
from mapmore_cli.domain.errors import DataError, SpecError, Warn
from mapmore_cli.domain.recording import (
    DAMPING,
    STATIC_FORCE,
    Dataset,
    Grouping,
    Quantity,
    Recording,
)
from mapmore_cli.fitting.groups import without_effects
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.ingestion.clock import clocked
from mapmore_cli.ingestion.curves import (
    PLATEAU,
    cut_by_level,
    join_branches,
    joined_curves,
    level_set,
    static_model,
    with_damping,
    with_plateau,
)
from mapmore_cli.ingestion.derived import derived, kept
from mapmore_cli.ingestion.files import (
    NO_TABLES,
    IngestSlice,
    Meter,
    Source,
    Tables,
    find_sources,
)
from mapmore_cli.ingestion.held_out import held_out, meant_levels
from mapmore_cli.ingestion.reading import read_tables
from mapmore_cli.ingestion.samples import (
    Samples,
    recordings_apart,
)
from mapmore_cli.ingestion.second_logs import with_joined
from mapmore_cli.ingestion.uncertainty import with_uncertainty
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.logs import FileEntry

BAD = "is left out as a bad file"
FEW = 10  # a recording with fewer samples gets a warning
MUCH = 0.5  # if more than this fraction of the samples is left out, a recording gets a warning


def build_dataset(
    slice_: IngestSlice,
    spec_dir: Path,
    *,
    static_run: Path | None = None,
    tables: Tables = NO_TABLES,
    progress: Progress = lambda *_: None,
    warn: Warn = lambda _: None,
) -> Dataset:
    """Read all recordings and sort their samples into curves, without writing anything.

    `static_run` is the run whose model is subtracted to obtain the damping force; without it, the
    measured quantity itself is the target. `tables` holds recordings in memory.

    Raises
    ------
    DataError
        Files that are missing or broken, levels without samples, held-out data that do not exist.
    SpecError
        Choices that contradict each other, or units of different dimension.
    """
    data, units, target = slice_.data, dict(slice_.units), slice_.measured
    _check(data)
    sources = find_sources(data.files, spec_dir, data.join, tables, data.skip_bad_files, warn)
    notes, warnings = list[str](), list[str]()
    logs = _logs_of(sources, data, units, Meter(sources, progress), notes, warnings)
    if data.plateau is not None:
        static = (
            None
            if static_run is None
            else static_model(static_run, Quantity(target, units[target]), units)
        )
        logs = [[with_plateau(piece, data.plateau, slice_.units) for piece in log] for log in logs]
        if static is not None:
            logs = [[with_damping(piece, target, static, warn) for piece in log] for log in logs]
        units[PLATEAU] = "1"
    levels = (
        level_set(data.levels, [recording for log in logs for recording in log])
        if data.levels
        else None
    )
    recordings, parts = cut_by_level(logs, levels)
    for warning in (*warnings, *(loss for recording in recordings for loss in _losses(recording))):
        warn(warning)
    if static_run is not None:
        target = DAMPING
        units |= dict.fromkeys((STATIC_FORCE, DAMPING), units[slice_.measured])
    if data.cycles:
        parts = [join_branches(part, data.cycles, slice_.measured) for part in parts]
        units["hysteresis"] = units[slice_.measured]
        target = "hysteresis" if slice_.component == "hysteresis" else target
    masks = held_out(parts, data.split.hold_out, levels, spec_dir)
    curves = joined_curves(parts, masks, levels)
    curves = with_uncertainty(curves, data, units, slice_.measured, target)
    notes += [levels.describe()] if levels else []
    notes += meant_levels(data.split.hold_out, levels)
    grouping = None
    if (groups := data.groups) is not None and groups.has_effects:
        measured = (slice_.measured, *slice_.also)
        made = (*sorted(data.computed_from(*measured)), "hysteresis", STATIC_FORCE, DAMPING)
        outputs = (*measured, *made)
        grouping = Grouping(target, groups.of, groups.offset, groups.gain, outputs)
        curves, effects = without_effects(curves, grouping)
        notes += effects.describe(target, units[target])
    return Dataset(
        target=target,
        level=levels.of if levels else None,
        quantities={name: Quantity(name, unit) for name, unit in units.items()},
        recordings=tuple(recordings),
        curves=curves,
        notes=tuple(notes),
        also=slice_.also,
        grouping=grouping,
    )


def _logs_of(
    sources: Sequence[Source],
    data: Data,
    units: Mapping[str, str],
    meter: Meter,
    notes: list[str],
    warnings: list[str],
) -> list[list[Recording]]:
    """Read all logs, and return a list of recordings for each log. If a log is cut at its gaps,
    each piece is a recording. Findings are added to `notes` and `warnings`. With `skip_bad_files:
    true`, a file that cannot be used is left out, with a warning.

    Raises DataError if no file is left.
    """
    logs, faults = list[list[Recording]](), list[DataError]()
    for source in sources:
        try:
            read = read_tables(source, data, data, units, meter)
            logs += [
                _mended(part, source, data, units, notes, warnings)
                for samples in with_joined(read, source, data, units, meter)
                for part in recordings_apart(samples, data, units, meter.texts)
            ]
        except DataError as fault:
            faults.append(fault)
            if data.skip_bad_files is not True:
                raise
            warnings.append(f"{source.name}: {BAD}: {fault.message}")
    if faults and not logs:
        raise faults[0]
    if not logs:
        raise DataError(
            "data.skip_bad_files: every file is left out", "name fewer files in `skip_bad_files`"
        )
    return logs


def _check(data: Data) -> None:
    """Raise SpecError for contradictions in the section `data`:

    - An entry of `files` gives a column for a quantity that is not in `data.columns`.
    - A constant (`set`) is also measured or derived, or only some entries of `files` set it.
    - The last samples or cycles are held out although `cycles` changes the order of the samples.
    """
    entries = [entry for entry in data.files if isinstance(entry, FileEntry)]
    for name in (name for one in entries for name in one.columns if name not in data.columns):
        raise SpecError(
            f"files: '{name}' has a column in some files only",
            "Name its column in `data.columns`. The `columns` of single files only replace entries "
            "of `data.columns`.",
        )
    for name in (name for one in entries for name in one.set):
        if name in data.measured or name in data.derive:
            raise SpecError(
                f"files: '{name}' is set for a file, and is also measured or derived",
                "Keep one of the two.",
            )
        if len(entries) < len(data.files) or not all(name in one.set for one in entries):
            raise SpecError(
                f"files: '{name}' is set for some entries only",
                "Set it for every entry of `files`.",
            )
    for key in ("last", "last_cycles"):
        if data.cycles and data.split.hold_out and getattr(data.split.hold_out, key) is not None:
            what = (
                f"split.validate: `{key}` needs samples in the order of time, but `cycles` "
                "reorders them"
            )
            raise SpecError(what, "Hold out levels or files.")


def _mended(
    samples: Samples,
    source: Source,
    data: Data,
    units: Mapping[str, str],
    notes: list[str],
    warnings: list[str],
) -> list[Recording]:
    """Clean the samples of a log and return its pieces in the order of time; a log without gaps is
    one piece. Findings are added to `notes` and `warnings`.

    The steps are, in this order: constants, time stamps and gaps, equal time steps, derived
    quantities, conditions on samples.
    """
    constants = {
        name: np.broadcast_to(np.float64(value), samples.size)
        for name, value in source.constants.items()
    }
    whole = clocked(samples.with_columns(constants), data, units)
    finished = [
        kept(derived(piece, data, units), (*data.keep, *source.keep), units)
        for piece in whole
        if piece.size
    ]
    left = [piece for piece in finished if piece.size]
    if not left:
        (finished or whole)[0].some()
    for piece in left:
        _check_sizes(piece, units)
    id_ = source.id if samples.element is None else f"{source.id}[{samples.element}]"
    names = [id_] if len(whole) == 1 else [f"{id_}#{number}" for number in range(1, len(left) + 1)]
    notes += [note for piece in whole for note in piece.notes]
    warnings += [doubt for piece in whole for doubt in piece.doubts]
    if lost := len(whole) - len(left):
        warnings.append(
            f"{samples.label}: {lost} of {len(whole)} pieces between gaps (`data.gaps`) "
            "have no sample left; check `keep` and `gaps`"
        )
    return [
        Recording(
            name,
            source.name,
            piece.columns,
            rows_read=piece.size + piece.merged + sum(map(len, piece.left_out.values())),
            dropped={reason: len(rows) for reason, rows in piece.left_out.items()},
            log="" if len(whole) == 1 else id_,
            first_row=_first_row(piece),
        )
        for name, piece in zip(names, left, strict=True)
    ]


def _first_row(piece: Samples) -> int:
    """Return the number of the first row in the file if the samples are consecutive rows; otherwise
    0.
    """
    first, last = int(piece.rows[0]), int(piece.rows[-1])
    by_row = piece.place == "row" and not piece.merged and last - first + 1 == piece.size
    return first if by_row else 0


def _losses(recording: Recording) -> Iterator[str]:
    kept, lost = recording.rows_kept, sum(recording.dropped.values())
    reasons = "; ".join(f"{count}: {reason}" for reason, count in recording.dropped.items())
    if kept < FEW:
        left = f"only {kept} of {kept + lost} samples are left ({reasons})"
        yield f"{recording.name}: {left if lost else f'holds only {kept} samples'}"
    elif kept < (1 - MUCH) * (kept + lost):
        yield (
            f"{recording.name}: {lost / (kept + lost):.0%} of {kept + lost} samples left out "
            f"({reasons})"
        )


# smallest and largest magnitude of a quantity; powers of smaller values underflow, and powers of
# larger values overflow
LEAST, MOST = (
    1e-30,
    1e30,
)


def _check_sizes(samples: Samples, units: Mapping[str, str]) -> None:
    """Raise DataError if the values of a quantity are so large or so small that their powers would
    overflow or underflow.
    """
    for name, column in samples.columns.items():
        largest = max(map(abs, extremes(column)))
        if largest > MOST or 0 < largest < LEAST:
            size = f"the largest {name} is {largest:.3g} {units.get(name, '')}".rstrip()
            remedy = (
                "correct its `unit`, `scale` or expression, or name the number that stands "
                "for a missing value (`missing`)"
            )
            raise DataError(
                f"{samples.label}: {size}, but numbers must be 0 or between {LEAST:g} and "
                f"{MOST:g} in magnitude",
                remedy,
            )
