"""Readers of recordings, one file each: whoever puts a file with a `READER` into this folder has
added a format.

The words of `data.reader`, the keys that each has a use for, the suffixes that ids of recordings
leave out, and what `init` does with a file all follow from that declaration (`Reader`). Libraries
that only one format needs are imported when it is read.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from pathlib import Path

from mapmore_cli.domain import plugins
from mapmore_cli.storage.tables import RawTable, Reader, TableRequest
from mapmore_cli.storage.tables.gate import gated
from mapmore_cli.storage.tables.lines import head_of, name_of_packed

__all__ = ["READERS", "RawTable", "Reader", "TableRequest", "reader_of", "suffix_of"]

READERS: Mapping[str, Reader] = {
    part.name: gated(part.value) for part in sorted(plugins.parts("readers", Reader, __name__))
}
"""Every reader by its name, in the order of the alphabet."""


def suffix_of(path: Path) -> str:
    """Return the suffix that tells the format, in lower case: `.csv` of `a.csv.gz`."""
    return Path(name_of_packed(path.name.casefold())).suffix


def reader_of(path: Path) -> Reader | None:
    """Return the reader for files that begin like this one, or that have such a name; None where no
    reader claims it.
    """
    begin = head_of(path) if path.is_file() else b""  # what a pipe gives is not given twice
    begun = (one for one in READERS.values() if one.begins and begin.startswith(one.begins))
    named = (one for one in READERS.values() if suffix_of(path) in one.suffixes)
    return next(chain(begun, named), None)
