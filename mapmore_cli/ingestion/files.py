"""Collect everything on which the stage `ingest` depends: its part of the spec, and the files that
the entries of `data.files` name. Also report the progress of reading.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Literal

from mapmore_cli.domain.errors import DataError, SpecError, Warn
from mapmore_cli.fitting.kinds.dictionary import derivations_of, units_of
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.ingestion.globs import expand, is_file_named, relative_name
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables import RawTable, WhichTable
from mapmore_cli.storage.tables.lines import name_of_packed
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.logs import FileEntry, Join, Keep, SourceColumn
from mapmore_cli.study.sections.split import Split

Component = Literal["static", "hysteresis", "damping"]


@dataclass(frozen=True)
class IngestSlice:
    """Settings on which the stage `ingest` depends.

    - `data`: section `data` of the spec.
    - `measured`: measured quantity from which the target is computed.
    - `component`: part of the measured quantity that is modelled.
    - `units`: the model's unit of every quantity.
    - `static`: spec of the run whose model is subtracted to obtain the damping force.
    - `also`: further quantities that are modelled.
    """

    data: Data
    measured: str
    component: Component
    units: Mapping[str, str]
    static: str | None = None
    also: tuple[str, ...] = ()


def slice_of(spec: ExperimentSpec) -> IngestSlice:
    """Return the part of the spec that ingest reads. Settings for cross-validation are not
    included, because ingest does not need them.
    """
    split = Split(validate=spec.data.split.hold_out)
    by_group = any(isinstance(rule, dict) for rule in spec.data.uncertainty.values())
    groups = spec.data.groups
    groups = groups if groups and (groups.has_effects or by_group) else None
    component: Component = "static"
    if spec.target == "hysteresis" or spec.target == "damping":
        component = spec.target
    return IngestSlice(
        data=spec.data.model_copy(
            update={"split": split, "groups": groups, "derive": derivations_of(spec)}
        ),
        measured=spec.target_quantity,
        component=component,
        units=units_of(spec),
        static=spec.needs.static if component == "damping" else None,
        also=spec.also,
    )


@dataclass(frozen=True)
class Log:
    """A file to read, or a `table` in memory.

    - `name`: name of the file relative to the folder of the spec.
    - `sheet`, `table_below`: sheet of a workbook, and table within a file, that the spec requests
      for this file; None if it requests none.
    - `columns`: columns that have another name or unit in this file than in the other files.
    """

    path: Path
    name: str
    sheet: str | None
    table: RawTable | None = field(default=None, kw_only=True)
    table_below: WhichTable | None = field(default=None, kw_only=True)
    columns: Mapping[str, SourceColumn] = field(default_factory=dict, kw_only=True)

    @property
    def bytes(self) -> int:
        """Size of the file; 0 for a table in memory."""
        return self.path.stat().st_size if self.table is None else 0


@dataclass(frozen=True)
class Source(Log):
    """A file of `data.files`: the id of its recording, constants for quantities that no column
    holds, conditions on its samples, and the logs that are joined to it.
    """

    id: str
    constants: Mapping[str, float]
    keep: Sequence[Keep]
    joined: tuple[Log, ...]


Entries = Sequence[str | FileEntry]


Tables = Mapping[str, RawTable]
"""Recordings in memory, by their names in `data.files`."""

NO_TABLES: Tables = MappingProxyType({})


def find_sources(
    entries: Entries,
    folder: Path,
    joins: Sequence[Join] = (),
    tables: Tables = NO_TABLES,
    bad: bool | Sequence[str] = False,
    warn: Warn = lambda _: None,
) -> tuple[Source, ...]:
    """Return the files that `data.files` names, in the order of its entries, each with its joined
    logs. Files of one glob are sorted by path. If an entry has the name of one of the `tables`,
    this table in memory is used instead of a file. Files named in `bad` (`data.skip_bad_files`) are
    left out, but only after all files were paired with the logs to join. `warn` is called if a glob
    leads into results of mapmore.

    Raises DataError if a glob matches nothing, if two entries name the same file, or if the logs to
    join cannot be paired with the files; SpecError if two recordings have the same id.
    """
    found = _found(entries, folder, tables, may_be_empty=bool(bad), warn=warn)
    ids = [
        entry.id or automatic
        for (_, entry), automatic in zip(found, _automatic([log for log, _ in found]), strict=True)
    ]
    for name, times in Counter(ids).items():
        if times > 1:
            raise SpecError(
                f"files: {times} recordings have the id '{name}'", "Give each an `id` of its own."
            )
    logs = [_logs_to_join(join, len(found), folder, warn) for join in joins]
    left_out = [] if isinstance(bad, bool) else bad
    return tuple(
        Source(
            log.path,
            log.name,
            log.sheet,
            ids[i],
            entry.set,
            entry.keep,
            tuple(joined[i] for joined in logs),
            table=log.table,
            table_below=log.table_below,
            columns=log.columns,
        )
        for i, (log, entry) in enumerate(found)
        if not any(is_file_named(log.name, path, folder) for path in left_out)
    )


def _found(
    entries: Entries,
    folder: Path,
    tables: Tables = NO_TABLES,
    may_be_empty: bool = False,
    warn: Warn = lambda _: None,
) -> list[tuple[Log, FileEntry]]:
    """Return every file together with the entry of `data.files` that names it. If several entries
    name sheets or tables of the same file, the file is returned once for each of them.
    """
    files: dict[tuple[str, str | None, WhichTable | None], tuple[Log, FileEntry]] = {}
    for entry in (FileEntry(path=entry) if isinstance(entry, str) else entry for entry in entries):
        table = tables.get(entry.path)
        paths = [folder / entry.path]
        if table is None:
            paths = expand(entry.path, folder, may_be_empty, warn)
        if entry.id is not None and len(paths) > 1:
            raise SpecError(
                f"files: the id '{entry.id}' is given to {len(paths)} files ({entry.path})",
                "Name a single file, or remove the id.",
            )
        for path in paths:
            name = relative_name(path, folder)
            part = (name, entry.sheet, entry.table)
            if part in files:
                before = files[part][1].path
                which = ":".join(map(str, filter(None, part)))
                raise DataError(
                    f"{which}: is named twice, by '{before}' and by '{entry.path}'",
                    "change the patterns of `files` so that each file matches one of them",
                )
            log = Log(
                path,
                name,
                entry.sheet,
                table=table,
                table_below=entry.table,
                columns=entry.columns,
            )
            files[part] = (log, entry)
    return list(files.values())


def _automatic(logs: Sequence[Log]) -> list[str]:
    """Return an id for each log, made from the name of its file. If several sheets or tables of one
    file are read, the sheet or table is appended to the id, for example `book[Run1]`.
    """
    sheets = Counter(log.name for log in logs)
    ids = dict(zip(sheets, unique_ids([*sheets]), strict=True))
    return [
        f"{ids[log.name]}[{part}]"
        if sheets[log.name] > 1
        and (part := ":".join(map(str, filter(None, (log.sheet, log.table_below)))))
        else ids[log.name]
        for log in logs
    ]


def _logs_to_join(join: Join, count: int, folder: Path, warn: Warn) -> list[Log]:
    """Return, for each of `count` files, the log that is joined to it. A single log is joined to
    every file; several logs are joined to the files one by one, in their order.
    """
    logs = [log for log, _ in _found(join.files, folder, warn=warn)]
    if len(logs) not in (1, count):
        names = ", ".join(log.name for log in logs[:4])
        message = (
            f"join: {len(logs)} files cannot be paired with {count} of `data.files`: {names} ..."
        )
        raise DataError(
            message, "Name one file for each, in the same order, or a single file for all."
        )
    return logs if len(logs) == count else logs * count


def unique_ids(sources: Sequence[str]) -> list[str]:
    """Return unique names for recordings, made from the names of their files without the suffixes
    of compression and format. Parent folders are added if names repeat.
    """
    parts = [PurePosixPath(_without_suffix(source)).parts for source in sources]
    depth = [1] * len(parts)
    while True:
        ids = ["-".join(part[-n:]) for part, n in zip(parts, depth, strict=True)]
        times = Counter(ids)
        longer = [
            min(n + 1, len(part)) if times[name] > 1 else n
            for name, part, n in zip(ids, parts, depth, strict=True)
        ]
        if longer == depth:
            return ids
        depth = longer


def _without_suffix(source: str) -> str:
    stem = name_of_packed(source)
    suffixes = [suffix for reader in READERS.values() for suffix in reader.suffixes]
    return (
        next((stem.removesuffix(suffix) for suffix in suffixes if stem.endswith(suffix)), stem)
        or source
    )


MEGABYTE = 10**6


class Meter:
    """Counter that calls `progress` with the number of bytes that were read so far from all logs of
    a study. If a log is joined to several files, it is read and counted once for each of them.

    `texts` holds, for each quantity whose column contains texts, the number that represents each
    text. A text has the same number in all logs.
    """

    def __init__(self, sources: Sequence[Source], progress: Progress) -> None:
        self._progress = progress
        self._total = sum(log.bytes for source in sources for log in (source, *source.joined))
        self._before = 0
        self.texts: dict[str, dict[str, float]] = {}

    def within(self, log: Log) -> Callable[[int], None]:
        """Begin to count the bytes of another log. Return a function that the reader of this log
        calls with the number of bytes that it has read so far.
        """
        before = self._before
        self._before += log.bytes

        def tell(read: int) -> None:
            self._progress("MB read", (before + read) // MEGABYTE, -(-self._total // MEGABYTE))

        tell(0)
        return tell
