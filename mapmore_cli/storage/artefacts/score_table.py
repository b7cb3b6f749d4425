"""The score table as scores.csv and scores.json, with 12 significant digits."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import csv_cell
from mapmore_cli.domain.scores import Score, Validation
from mapmore_cli.storage.atomic import write_text

DIGITS = 12
COLUMNS = tuple(field.name for field in fields(Score))


def write_scores(folder: Path, validation: Validation, name: str) -> None:
    """Write `scores.csv` and `scores.json` of the run `name` into `folder`.

    The JSON document is `{"name", "target", "units", "scores": [row, ...]}`; a number that is not finite is null there, and empty in
    the CSV. The same scores give the same bytes.
    """
    rows = [score_row(score) for score in validation.scores]
    document = {"name": name, "target": next(iter(validation.units), None), "units": dict(validation.units), "scores": rows}
    write_text(folder / "scores.json", json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n")
    table = io.StringIO()
    writer = csv.DictWriter(table, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: csv_cell(cell) if isinstance(cell, str) else cell for name, cell in row.items()} for row in rows)
    write_text(folder / "scores.csv", table.getvalue())


def score_row(score: Score) -> Mapping[str, str | int | float | None]:
    """A row of the table, by column in the order of `Score`."""
    return {column: _rounded(getattr(score, column)) for column in COLUMNS}


def _rounded(value: str | int | float) -> str | int | float | None:
    """A float to 12 significant digits, without a negative zero; None where it is not finite."""
    if not isinstance(value, float):
        return value
    return float(f"{value:.{DIGITS}g}") + 0.0 if math.isfinite(value) else None


def scores_beside(model: Path) -> tuple[Mapping[str, Any], ...]:
    """The rows of the scores.json in the folder of a model; none where it was sent alone, or they cannot be read."""
    try:
        rows = json.loads((model.parent / "scores.json").read_text(encoding="utf-8"))["scores"]
        return tuple(dict(row) for row in rows)
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return ()
