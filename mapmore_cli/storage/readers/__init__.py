"""Readers of recordings, one file each, chosen by `data.reader`.

A reader is a function `read(path, request) -> RawTable`; to add one, write it in a file of its own and name it in `READERS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from mapmore_cli.storage.readers.csv import read_csv
from mapmore_cli.storage.readers.table import RawTable, TableRequest

Reader = Callable[[Path, TableRequest], RawTable]

READERS: Mapping[str, Reader] = {"csv": read_csv}

__all__ = ["READERS", "RawTable", "Reader", "TableRequest"]
