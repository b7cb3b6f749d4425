"""Readers of recordings, one file each, chosen by `data.reader`.

A reader is a function `read(path, request) -> list[RawTable]`, one table for each recording in the file; to add one, write it in a file
of its own and name it in `READERS`. Libraries that only one format needs are imported when it is read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from mapmore_cli.storage.readers.csv import read_csv
from mapmore_cli.storage.readers.hdf5 import read_hdf5
from mapmore_cli.storage.readers.mat import read_mat
from mapmore_cli.storage.readers.table import RawTable, TableRequest
from mapmore_cli.storage.readers.tdms import read_tdms
from mapmore_cli.storage.readers.xlsx import read_xlsx

Reader = Callable[[Path, TableRequest], list[RawTable]]

READERS: Mapping[str, Reader] = {"csv": read_csv, "xlsx": read_xlsx, "mat": read_mat, "hdf5": read_hdf5, "tdms": read_tdms}

__all__ = ["READERS", "RawTable", "Reader", "TableRequest"]
