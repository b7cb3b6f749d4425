"""From files to a dataset: read, cleaned, converted to the model's units and sorted into curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import DAMPING, STATIC_FORCE, Dataset, Quantity, Recording
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.ingestion.clock import clocked, with_joined
from mapmore_cli.ingestion.curves import (
    PLATEAU,
    cut_by_level,
    join_branches,
    joined_curves,
    level_set,
    offsets_of,
    static_model,
    with_damping,
    with_plateau,
    with_scatter,
)
from mapmore_cli.ingestion.files import IngestSlice, Meter, Source, find_sources
from mapmore_cli.ingestion.samples import Samples, derived, kept, read_tables, without_missing
from mapmore_cli.ingestion.split import held_out, meant_levels
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.sections.logs import FileEntry
from mapmore_cli.storage.spool import counted

FEW = 10  # samples kept, below which a recording is worth a warning
MUCH = 0.5  # fraction dropped, above which it is


def build_dataset(
    slice_: IngestSlice,
    spec_dir: Path,
    *,
    static_run: Path | None = None,
    progress: Progress = lambda *_: None,
    warn: Callable[[str], None] = lambda _: None,
) -> Dataset:
    """Read all recordings and sort their samples into curves; writes nothing.

    `static_run` is the run whose model leaves the damping force; without it, the measured quantity itself is the target.

    Raises
    ------
    DataError
        Files that are missing or broken, levels without samples, held-out data that do not exist.
    SpecError
        Choices that contradict each other, or units of different dimension.
    """
    data, units, target = slice_.data, dict(slice_.units), slice_.measured
    _check(data)
    sources = find_sources(data.files, spec_dir, data.join)
    meter = Meter(sources, progress)
    readings = [reading for source in sources for reading in read_recordings(source, data, units, meter)]
    if data.plateau is not None:
        static = None if static_run is None else static_model(static_run, Quantity(target, units[target]), units)
        readings = [_stepped(reading, slice_, static, warn) for reading in readings]
        units[PLATEAU] = "1"
    levels = level_set(data.levels, [piece for reading in readings for piece in reading.pieces]) if data.levels else None
    recordings, parts = cut_by_level([reading.pieces for reading in readings], levels)
    levels = None if levels is None else with_scatter(levels, parts)
    for warning in (warning for reading in readings for warning in reading.warnings):
        warn(warning)
    for recording in recordings:
        _warn_of_losses(recording, warn)
    if static_run is not None:
        target = DAMPING
        units |= dict.fromkeys((STATIC_FORCE, DAMPING), units[slice_.measured])
    if data.cycles:
        parts = [join_branches(part, data.cycles, slice_.measured) for part in parts]
        units["hysteresis"] = units[slice_.measured]
        target = "hysteresis" if slice_.component == "hysteresis" else target
    masks = held_out(parts, data.split.hold_out, levels, spec_dir)
    curves = joined_curves(parts, masks, levels)
    notes = [note for reading in readings for note in reading.notes]
    notes += [levels.describe()] if levels else []
    notes += meant_levels(data.split.hold_out, levels)
    if data.groups is not None and data.groups.offset:
        known = offsets_of(curves, data.groups.of, target)
        curves = tuple(known.taken_off(curve, target) for curve in curves)
        notes.append(known.describe(target, units[target]))
    return Dataset(
        target=target,
        level=levels.of if levels else None,
        quantities={name: Quantity(name, unit) for name, unit in units.items()},
        recordings=tuple(recordings),
        curves=curves,
        notes=tuple(notes),
    )


def _check(data: Data) -> None:
    """Refuse constants that not every recording has, or that are columns or derived as well, and an order of time that is given up."""
    constants = [set(entry.set) if isinstance(entry, FileEntry) else set() for entry in data.files]
    for name in sorted(set().union(*constants)):
        if name in data.measured or name in data.derive:
            raise SpecError(f"files: '{name}' is set for a file and measured or derived as well", "Keep one of both.")
        if not all(name in given for given in constants):
            raise SpecError(f"files: '{name}' is set for some entries only", "Set it for every entry of `files`.")
    for key in ("last", "last_cycles"):
        if data.cycles and data.split.hold_out and getattr(data.split.hold_out, key) is not None:
            what = f"split.validate: `{key}` needs samples in the order of time, which `cycles` gives up"
            raise SpecError(what, "Hold out levels or files.")


@dataclass(frozen=True)
class ReadLog:
    """One log as recorded: its `pieces` in order of time, a single one where it has no gaps, and what was found in it."""

    pieces: tuple[Recording, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def read_recordings(source: Source, data: Data, units: Mapping[str, str], meter: Meter) -> list[ReadLog]:
    """Read a file and the logs that are joined to it, and bring them into the model's `units`.

    In this order: scale and offset, joined logs, missing values, constants, time stamps and gaps, even time steps, derived quantities,
    conditions to keep samples. Raises DataError naming file, row and column.
    """
    tables = read_tables(source, data, data.missing_rule, units, meter)
    return [_reading(samples, source, data, units) for samples in with_joined(tables, source, data, units, meter)]


def _reading(samples: Samples, source: Source, data: Data, units: Mapping[str, str]) -> ReadLog:
    samples = without_missing(samples, data, data.missing_rule.action)
    constants = {name: counted(partial(_repeated, value), samples.size) for name, value in source.constants.items()}
    whole = clocked(samples.with_columns(constants), data, units)
    finished = [_finished(piece, data, source, units) for piece in whole if piece.size]
    left = [piece for piece in finished if piece.size]
    if not left:
        (finished or whole)[0].some()
    id_ = source.id if samples.element is None else f"{source.id}[{samples.element}]"
    names = [id_] if len(whole) == 1 else [f"{id_}#{number}" for number in range(1, len(left) + 1)]
    recordings = tuple(
        Recording(
            name,
            source.name,
            piece.columns,
            rows_read=piece.size + piece.merged + sum(map(len, piece.left_out.values())),
            dropped={reason: len(rows) for reason, rows in piece.left_out.items()},
            log="" if len(whole) == 1 else id_,
        )
        for name, piece in zip(names, left, strict=True)
    )
    lost = len(whole) - len(left)
    emptied = [f"{samples.label}: {lost} of {len(whole)} pieces between gaps have no sample left"] if lost else []
    notes, doubts = [note for piece in whole for note in piece.notes], [doubt for piece in whole for doubt in piece.doubts]
    return ReadLog(recordings, tuple(notes), (*doubts, *emptied))


def _repeated(value: float, rows: np.ndarray) -> np.ndarray:
    return np.full(len(rows), value, dtype=np.float64)


def _finished(samples: Samples, data: Data, source: Source, units: Mapping[str, str]) -> Samples:
    samples = derived(samples, data.derive, units)
    for condition in (*data.keep, *source.keep):
        samples = kept(samples, condition, units)
    return samples


def _stepped(reading: ReadLog, slice_: IngestSlice, static: Model | None, warn: Callable[[str], None]) -> ReadLog:
    """Return the pieces of a log with their plateau, and with the damping force where a static model is at hand."""
    assert slice_.data.plateau is not None
    pieces = [with_plateau(piece, slice_.data.plateau, slice_.units) for piece in reading.pieces]
    if static is not None:
        pieces = [with_damping(piece, slice_.measured, static, warn) for piece in pieces]
    return replace(reading, pieces=tuple(pieces))


def _warn_of_losses(recording: Recording, warn: Callable[[str], None]) -> None:
    kept, lost = recording.rows_kept, sum(recording.dropped.values())
    reasons = "; ".join(f"{count}: {reason}" for reason, count in recording.dropped.items())
    name = f"{recording.source} ({recording.id})" if recording.log else recording.source
    if kept < FEW:
        warn(f"{name}: only {kept} of {kept + lost} samples are left ({reasons})" if lost else f"{name}: holds only {kept} samples")
    elif kept < (1 - MUCH) * (kept + lost):
        warn(f"{name}: {lost / (kept + lost):.0%} of {kept + lost} samples left out ({reasons})")
