"""Describe the layout of a file: its reader, the settings of the reader, and its columns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from mapmore_cli.storage.tables import SourceColumn


@dataclass(frozen=True)
class Layout:
    """Layout of a file: its `reader`, and the `settings` of `data` with which it is read.

    - `columns`: names of the columns in a spec: addresses if the file is a tree, otherwise unique
      titles, otherwise 0-based indices.
    - `titles`, `units`: titles and units of the columns as written in the file; an empty text for a
      column that has none.
    - `alike`: the sheets of a workbook that have this layout, if there are several. `left` are the
      other sheets of the workbook.
    - `tables`: numbers of the tables in the file that have this layout, if the file has several
      tables below each other or side by side. `left` are the other tables. `above` holds the words
      above each of the tables, which may differ from file to file.
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
        """Return True for a map of cells, which is read as a table with a row for each cell."""
        return self.settings.get("table") == "map"
