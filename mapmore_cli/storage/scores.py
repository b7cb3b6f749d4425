"""Read and write `scores.csv` and `scores.json`, the scores of a run."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.foreign import csv_cell
from mapmore_cli.domain.scores import Score, ScoreTable
from mapmore_cli.storage.atomic import write_own
from mapmore_cli.storage.run_record import DAMAGE, read_json

COLUMNS = tuple(field.name for field in fields(Score))
_SCORES = TypeAdapter(tuple[Score, ...])


def write_scores(folder: Path, table: ScoreTable, name: str) -> None:
    """Write `scores.csv` and `scores.json` of the run `name` to `folder`.

    The JSON document is an object with the keys `name`, `target`, `units`, `scores` (a list of
    rows), `failed` (the names of models that could not be fitted), `warnings` and `alerts`. A
    number that is not finite is null in the JSON document, and an empty field in the CSV table. The
    same scores give the same bytes.
    """
    rows = [score_row(score) for score in table.scores]
    document = {
        "name": name,
        "target": next(iter(table.units), None),
        "units": dict(table.units),
        "scores": rows,
        "failed": list(table.failed),
        "warnings": list(table.warnings),
        "alerts": dict(table.alerts),
    }
    write_own(
        folder / "scores.json",
        json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n",
    )
    cells = io.StringIO()
    writer = csv.DictWriter(cells, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {name: csv_cell(cell) if isinstance(cell, str) else cell for name, cell in row.items()}
        for row in rows
    )
    write_own(folder / "scores.csv", cells.getvalue())


def read_scores(path: Path) -> ScoreTable:
    """Return the scores from a `scores.json`. Raises DataError for a file with other contents."""
    try:
        return scores_in(read_json(path))
    except DAMAGE as error:
        problem = f"no table of scores: {type(error).__name__}: {error}"
        raise DataError(
            f"{path}: {problem}", "run `mapmore validate SPEC --force`, which writes it again"
        ) from error


def scores_in(document: Any) -> ScoreTable:
    """Return the scores in a JSON `document`, as read from a `scores.json`. Files of older
    versions, which lack some keys, are read too.

    Raises ValueError, TypeError, KeyError, AttributeError or OverflowError for another document.
    """
    rows = [
        {name: math.nan if cell is None else cell for name, cell in row.items()}
        for row in document["scores"]
    ]
    units = {str(name): str(unit) for name, unit in document["units"].items()}
    return ScoreTable(
        _SCORES.validate_python(rows),
        units,
        tuple(map(str, document.get("failed", ()))),
        tuple(map(str, document.get("warnings", ()))),
        {str(name): str(alert) for name, alert in document.get("alerts", {}).items()},
    )


def score_row(score: Score) -> Mapping[str, str | int | float | None]:
    """Return a score as a row of the table: the value of each column, in the order of the fields of
    `Score`. Numbers are rounded to 12 significant digits, and -0 becomes 0. A number that is not
    finite becomes None.
    """
    row = {column: getattr(score, column) for column in COLUMNS}
    for column, value in row.items():
        if isinstance(value, float):
            row[column] = float(f"{value:.12g}") + 0.0 if math.isfinite(value) else None
    return row


def scores_beside(model: Path) -> tuple[Mapping[str, Any], ...]:
    """Return the rows of the scores.json in the folder of a model; empty if there is no such file,
    or if it cannot be read.
    """
    try:
        return tuple(dict(row) for row in read_json(model.parent / "scores.json")["scores"])
    except DAMAGE:
        return ()
