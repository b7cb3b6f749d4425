"""Results on stdout: a table for people, or one JSON document. Nothing else of the program prints there."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from mapmore_cli.domain.foreign import printable

if TYPE_CHECKING:
    from mapmore_cli.cli.views.view import View


def print_document(document: Mapping[str, Any]) -> None:
    """Print one JSON document; NaN and infinities, which JSON does not have, become null."""
    print(json.dumps(plain(document), indent=2, allow_nan=False))


def plain(value: Any) -> Any:
    """Rebuild a document from what JSON knows: arrays and tuples become lists, non-finite numbers None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # NumPy arrays and scalars, without importing NumPy for documents that have none
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def print_view(view: View, as_json: bool) -> None:
    """Print a result as one JSON document, or as its tables with a blank line between."""
    if as_json:
        print_document(view.document)
        return
    from mapmore_cli.reporting.table import to_text

    blocks = [to_text(table).rstrip("\n") for table in view.tables]
    if view.lines:
        blocks.append("\n".join(view.lines))
    print(printable("\n\n".join(blocks)))
