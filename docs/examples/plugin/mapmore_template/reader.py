"""Recordings with one JSON object in each line: `{"t": 0.0, "P": 101.2}`."""

import json
from pathlib import Path

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import RawTable, Reader, TableRequest
from mapmore_cli.storage.tables.rows import table_of_records


def read(path: Path, request: TableRequest) -> list[RawTable]:
    """Return the wanted columns as one recording."""
    records = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            # as pairs of key and value: of two equal keys, `json` would keep the last
            records.append((number, json.loads(line, object_pairs_hook=list)))
        except ValueError as fault:
            raise DataError(
                f"{request.label}:row {number}: not JSON ({fault})", "write one object per line"
            ) from fault
    return [table_of_records(records, request)]


READER = Reader("json_lines", read, suffixes=(".jsonl",), by_index=False)
