"""The score table as scores.csv and scores.json, with 12 significant digits: written, and read where nothing else is needed."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.foreign import csv_cell
from mapmore_cli.domain.scores import Score, ScoreTable
from mapmore_cli.storage.atomic import write_text

DIGITS = 12
KINDS: Mapping[str, Callable[[Any], Any]] = {f.name: {"str": str, "int": int, "float": float}[str(f.type)] for f in fields(Score)}
COLUMNS = tuple(KINDS)


def write_scores(folder: Path, table: ScoreTable, name: str) -> None:
    """Write `scores.csv` and `scores.json` of the run `name` into `folder`.

    The JSON document is `{"name", "target", "units", "scores": [row, ...], "failed", "warnings"}`: `failed` names models that could not
    be fitted. A number that is not finite is null there, and empty in the CSV. The same scores give the same bytes.
    """
    rows = [score_row(score) for score in table.scores]
    document: dict[str, Any] = {"name": name, "target": next(iter(table.units), None), "units": dict(table.units), "scores": rows}
    document |= {"failed": list(table.failed), "warnings": list(table.warnings)}
    write_text(folder / "scores.json", json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n")
    cells = io.StringIO()
    writer = csv.DictWriter(cells, COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({name: csv_cell(cell) if isinstance(cell, str) else cell for name, cell in row.items()} for row in rows)
    write_text(folder / "scores.csv", cells.getvalue())


def read_scores(path: Path) -> ScoreTable:
    """Return what `write_scores` wrote; raises DataError for a file that says something else."""
    try:
        return scores_in(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError) as error:
        what = f"no table of scores: {type(error).__name__}: {error}"
        raise DataError(f"{path}: {what}", "run `mapmore validate SPEC --force`, which writes it again") from error


def scores_in(document: Any) -> ScoreTable:
    """Return the table in the document of a scores.json, also of older ones, which lack some keys.

    Raises ValueError, TypeError, KeyError, AttributeError or OverflowError for another document.
    """
    scores = tuple(_score(row) for row in document["scores"])
    units = {str(name): str(unit) for name, unit in document["units"].items()}
    return ScoreTable(scores, units, *(tuple(map(str, document.get(key, ()))) for key in ("failed", "warnings")))


def _score(row: Mapping[str, Any]) -> Score:
    """Return a row of the file; null stands for a number that is not finite."""
    values: dict[str, Any] = {n: _text(row[n]) if kind is str else _number(row.get(n), kind) for n, kind in KINDS.items()}
    return Score(**values)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{value!r} is no text")
    return value


def _number(value: Any, kind: Callable[[Any], Any]) -> Any:
    return math.nan if value is None and kind is float else kind(value)


def score_row(score: Score) -> Mapping[str, str | int | float | None]:
    """Return a row of the table, by column in the order of `Score`."""
    return {column: _rounded(getattr(score, column)) for column in COLUMNS}


def _rounded(value: str | int | float) -> str | int | float | None:
    """Return a float to 12 significant digits, without a negative zero; None where it is not finite."""
    if not isinstance(value, float):
        return value
    return float(f"{value:.{DIGITS}g}") + 0.0 if math.isfinite(value) else None


def scores_beside(model: Path) -> tuple[Mapping[str, Any], ...]:
    """Return the rows of the scores.json in the folder of a model; none where it was sent alone, or they cannot be read."""
    try:
        rows = json.loads((model.parent / "scores.json").read_text(encoding="utf-8"))["scores"]
        return tuple(dict(row) for row in rows)
    except (OSError, ValueError, TypeError, KeyError, RecursionError):
        return ()
