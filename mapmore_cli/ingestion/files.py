"""What ingest depends on: its slice of the spec, the recordings that it names, and how far their reading has come."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.fitting.kinds.dictionary import derivations_of, units_of
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.sections.logs import FileEntry, Join, Keep
from mapmore_cli.storage.globs import expand, relative_name, unique_ids


@dataclass(frozen=True)
class IngestSlice:
    """What ingest depends on: the quantity that is `measured`, its `component` to model, and the model's unit of every quantity.

    `static` is the spec of the run whose model leaves the damping force.
    """

    data: Data
    measured: str
    component: Literal["static", "hysteresis", "damping"]
    units: Mapping[str, str]
    static: str | None = None


def slice_of(spec: ExperimentSpec) -> IngestSlice:
    """Return the part of the spec that ingest reads; cross-validation is no business of its."""
    split = spec.data.split.model_copy(update={"leave_one_level_out": False, "leave_one_group_out": False})
    groups = spec.data.groups if spec.data.groups is not None and spec.data.groups.offset else None
    component: Literal["static", "hysteresis", "damping"] = "static"
    if spec.target in ("hysteresis", "damping"):
        component = "hysteresis" if spec.target == "hysteresis" else "damping"
    return IngestSlice(
        data=spec.data.model_copy(update={"split": split, "groups": groups, "derive": derivations_of(spec)}),
        measured=spec.target_quantity,
        component=component,
        units=units_of(spec),
        static=spec.needs.static if component == "damping" else None,
    )


@dataclass(frozen=True)
class Log:
    """A file to read, its name relative to the spec's folder, and the sheet of it where its entry names one."""

    path: Path
    name: str
    sheet: str | None


@dataclass(frozen=True)
class Source(Log):
    """A file of `data.files`: its recording's id, quantities that no column of it holds, what is kept of it, and the logs joined to it."""

    id: str
    constants: Mapping[str, float]
    keep: Sequence[Keep] = ()
    joined: tuple[Log, ...] = ()


Entries = Sequence[str | FileEntry]


def find_sources(entries: Entries, folder: Path, joins: Sequence[Join] = ()) -> tuple[Source, ...]:
    """Return the files of `data.files` in the order of the entries, those of one glob sorted by path, each with its joined logs.

    Raises DataError where a glob finds nothing, a file is named twice, or joined logs cannot be paired; SpecError where recordings
    share an id.
    """
    found = _found(entries, folder)
    ids = [entry.id or automatic for (_, entry), automatic in zip(found, _automatic([log for log, _ in found]), strict=True)]
    for name in ids:
        if ids.count(name) > 1:
            raise SpecError(f"files: {ids.count(name)} recordings have the id '{name}'", "Give each an `id` of its own.")
    logs = [_paired(join, len(found), folder) for join in joins]
    return tuple(
        Source(log.path, log.name, log.sheet, ids[i], entry.set, entry.keep, tuple(joined[i] for joined in logs))
        for i, (log, entry) in enumerate(found)
    )


def _found(entries: Entries, folder: Path) -> list[tuple[Log, FileEntry]]:
    """Every file with the entry that names it; sheets that entries name one by one are files of their own."""
    found: dict[tuple[str, str | None], tuple[Log, FileEntry]] = {}
    for entry in (FileEntry(path=entry) if isinstance(entry, str) else entry for entry in entries):
        paths = expand(entry.path, folder)
        if entry.id is not None and len(paths) > 1:
            raise SpecError(f"files: id '{entry.id}' is given to {len(paths)} files ({entry.path})", "Name a single file, or drop the id.")
        for path in paths:
            name = relative_name(path, folder)
            if (name, entry.sheet) in found:
                before = found[name, entry.sheet][1].path
                raise DataError(f"{name}: named twice, by '{before}' and '{entry.path}'", "make the patterns of `files` disjoint")
            found[name, entry.sheet] = (Log(path, name, entry.sheet), entry)
    return list(found.values())


def _automatic(logs: Sequence[Log]) -> list[str]:
    """Ids after the files; where one is read sheet by sheet, with the sheet behind it, as `book[Run1]`."""
    names = list(dict.fromkeys(log.name for log in logs))
    ids = dict(zip(names, unique_ids(names), strict=True))
    several = {name for name in names if sum(log.name == name for log in logs) > 1}
    return [f"{ids[log.name]}[{log.sheet}]" if log.name in several and log.sheet else ids[log.name] for log in logs]


def _paired(join: Join, count: int, folder: Path) -> list[Log]:
    """Return the log to join to each of `count` files: the same for all, or one for each, in order."""
    logs = [log for log, _ in _found(join.files, folder)]
    if len(logs) == 1:
        return logs * count
    if len(logs) != count:
        raise DataError(
            f"join: {len(logs)} files cannot be paired with {count} of `data.files`: {', '.join(log.name for log in logs[:4])} ...",
            "Name one for each, in the same order, or a single one for all.",
        )
    return logs


MEGABYTE = 10**6


class Meter:
    """Counts the bytes of all logs of a study, joined ones each time that they are read, and tells `progress`."""

    def __init__(self, sources: Sequence[Source], progress: Progress) -> None:
        self._progress = progress
        self._total = sum(log.path.stat().st_size for source in sources for log in (source, *source.joined))
        self._before = 0

    def within(self, log: Log) -> Callable[[int], None]:
        """Begin with a log; the function returned is told how many bytes of it have been read."""
        before = self._before
        self._before += log.path.stat().st_size

        def tell(read: int) -> None:
            self._progress("MB read", (before + read) // MEGABYTE, -(-self._total // MEGABYTE))

        tell(0)
        return tell
