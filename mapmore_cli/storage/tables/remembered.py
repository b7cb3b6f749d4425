"""Tables that were read before, for a command that looks at the same files again and again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.storage.tables.table import RawTable, Reader, SourceColumn, TableRequest

MOST_NUMBERS = 20_000_000
"""That are kept: 160 MB."""


@dataclass(frozen=True)
class _Kept:
    """The tables of a file with the request that they answered."""

    path: Path
    request: TableRequest
    tables: Sequence[RawTable]

    @property
    def size(self) -> int:
        """How many numbers they hold."""
        return sum(len(table.rows) * (1 + len(table.columns)) for table in self.tables)

    def answers(self, path: Path, request: TableRequest, of_rows: bool) -> bool:
        """Return True where the tables have what is asked for.

        A table of rows has the columns of a smaller request as well; of a tree, arrays of other lengths would have cut it.
        """
        known, asked = self.request.columns, request.columns
        enough = known == asked or (of_rows and {*asked} <= {*known})
        return self.path == path and enough and _bare(self.request) == _bare(request)

    def chosen(self, columns: Sequence[SourceColumn], label: str) -> list[RawTable]:
        """Return the wanted columns, under the name that the file has now."""
        was = len(self.request.label)
        return [
            replace(table, columns={name: table.columns[name] for name in columns}, label=label + table.label[was:])
            for table in self.tables
        ]


_KEPT: ContextVar[list[_Kept] | None] = ContextVar("tables read before", default=None)


@contextmanager
def remembered() -> Iterator[None]:
    """Within, no table is read twice; files are taken not to change."""
    token = _KEPT.set([])
    try:
        yield
    finally:
        _KEPT.reset(token)


def read_with(reader: Reader, path: Path, request: TableRequest) -> list[RawTable]:
    """Return the tables of a file as `reader.read` gives them, those of before where they are remembered."""
    kept = _KEPT.get()
    if kept is None:
        return reader.read(path, request)
    place = path.resolve()
    found = next((one for one in kept if one.answers(place, request, "header" in reader.keys)), None)
    if found is not None:
        request.progress(path.stat().st_size)
        return found.chosen(request.columns, request.label)
    read = _Kept(place, request, reader.read(path, request))
    if read.size + sum(one.size for one in kept) <= MOST_NUMBERS:
        kept.append(read)
    return list(read.tables)


def _bare(request: TableRequest) -> TableRequest:
    """Return the request without what does not change how a file is read."""
    return replace(request, columns=(), label="", progress=_untold)


def _untold(_bytes: int) -> None:
    """Nobody waits for what was read."""
