"""Read recordings: each module in this folder reads one format. A new format is added by a module
with a `READER`.

The declaration `READER` (of the type `Reader`) determines all of the following: the value of
`data.reader`, the keys of the spec that apply to the format, the suffixes of its files, which are
left out in ids of recordings, and how `init` reads such a file. If only one format needs a library,
the library is imported when such a file is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from pathlib import Path

from mapmore_cli.domain import plugins
from mapmore_cli.storage.tables import RawTable, Reader, TableRequest
from mapmore_cli.storage.tables.beginnings import begins_like
from mapmore_cli.storage.tables.gate import gated
from mapmore_cli.storage.tables.lines import head_of, name_of_packed

__all__ = ["READERS", "RawTable", "Reader", "TableRequest", "reader_of", "suffix_of"]

_PARTS = {part.name: part.value for part in sorted(plugins.parts("readers", Reader, __name__))}
READERS: Mapping[str, Reader] = {
    name: gated(reader, _PARTS.values()) for name, reader in _PARTS.items()
}
"""All readers by name, in alphabetical order."""


def suffix_of(path: Path) -> str:
    """Return the suffix that indicates the format, in lower case: `.csv` for `a.csv.gz`."""
    return Path(name_of_packed(path.name.casefold())).suffix


def reader_of(path: Path) -> Reader | None:
    """Return the reader for a file. It is found by the first bytes of the file, or, if no reader
    recognises them, by the suffix of its name. If several readers recognise the first bytes, the
    one that also has the suffix is preferred. Return None if there is no reader.
    """
    # the beginning of a pipe is not examined, because a pipe can be read only once
    head = head_of(path) if path.is_file() else b""
    named = [reader for reader in READERS.values() if suffix_of(path) in reader.suffixes]
    begun = (reader for reader in chain(named, READERS.values()) if begins_like(reader, head))
    return next(chain(begun, named), None)
