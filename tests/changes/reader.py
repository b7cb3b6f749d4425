"""A reader: one JSON object a line, which is the template of a plug-in put into our folder."""

from pathlib import Path

TEMPLATE = Path(__file__).parents[2] / "docs/examples/plugin/mapmore_template/reader.py"
FILE = "storage/readers/jsonl.py"
PATCH = {FILE: TEMPLATE.read_text(encoding="utf-8")}
WORKS = """
from mapmore_cli.storage.readers import READERS, TableRequest, reader_of
from mapmore_cli.study.sections.logs import Logs
path = Path("a.jsonl")
path.write_text('{"t": 0, "P": 3}\\n{"t": 1, "P": 4}\\n')
reader = reader_of(path)
(table,) = reader.read(path, TableRequest("a.jsonl", ("P",)))
assert table.columns["P"].tolist() == [3, 4]
assert list(reader.peek(path, 2))
assert "json_lines" in str(Logs.model_json_schema())
"""
HALVES = {}
"""None: a file without a `READER` belongs to another one, and no reader is declared elsewhere."""
