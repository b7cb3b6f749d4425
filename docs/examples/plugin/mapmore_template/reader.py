"""Recordings with one JSON object a line: `{"t": 0.0, "P": 101.2}`."""

import json
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import RawTable, Reader, TableRequest


def read(path: Path, request: TableRequest) -> list[RawTable]:
    """Return the wanted columns as one recording; NaN where a line lacks one."""
    lines = path.read_text(encoding="utf-8").splitlines()
    try:
        rows = [json.loads(line) for line in lines]
    except ValueError as fault:
        raise DataError(
            f"{request.label}: is no JSON ({fault})", "write one object a line"
        ) from fault
    for column in request.columns:
        if not any(column in row for row in rows):
            raise DataError(f"{request.label}: no line has `{column}`", "name a key of the lines")
    columns = {
        column: np.array([row.get(column, np.nan) for row in rows], dtype=float)
        for column in request.columns
    }
    return [RawTable(columns, np.arange(1, len(rows) + 1), request.label)]


READER = Reader(name="json_lines", read=read, suffixes=(".jsonl",), by_index=False)
