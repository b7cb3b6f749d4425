"""What a command has to show, in both forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mapmore_cli.reporting.table import Table


@dataclass(frozen=True)
class View:
    """A result as the members of one JSON document, as tables, and as closing lines for people."""

    document: Mapping[str, Any]
    tables: tuple[Table, ...] = ()
    lines: tuple[str, ...] = ()

    def under(self, head: Mapping[str, Any]) -> View:
        """The same view with `head` in front of its document."""
        return View({**head, **self.document}, self.tables, self.lines)
