"""Describe the layout of a file: its reader, the settings of the reader, and its columns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from mapmore_cli.storage.tables import SourceColumn


@dataclass(frozen=True)
class FileLayout:
    """Layout of a file: how it is read, and which columns it has.

    - `reader`: name of the reader. `settings`: the keys of `data` with which the file is read.
    - `columns`: names of the columns in a spec: addresses if the file is a tree, otherwise unique
      titles, otherwise 0-based indices.
    - `titles`, `units`: titles and units of the columns as written in the file; an empty text for a
      column that has none.
    - `alike`: the sheets of a workbook that have this layout, if there are several.
    - `tables`: numbers of the tables in the file that have this layout, if the file has several
      tables below each other or side by side. `above` holds the words above each of these tables,
      which may differ from file to file.
    - `left`: the sheets or tables of the file that have another layout.
    - `numeric`: indices of columns of numbers.
    """

    reader: str
    columns: tuple[SourceColumn, ...]
    titles: tuple[str, ...]
    settings: dict[str, Any]
    units: tuple[str, ...]
    numeric: tuple[int, ...] = field(compare=False, repr=False)
    alike: tuple[str, ...] = ()
    left: tuple[str, ...] = ()
    tables: tuple[int, ...] = ()
    above: tuple[str, ...] = field(default=(), compare=False, repr=False)

    @property
    def is_map(self) -> bool:
        """Return True for a map of values over two quantities, which is read as a table with a row
        for each cell of the map.
        """
        return self.settings.get("table") == "map"
