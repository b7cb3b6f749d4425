"""A reader: one JSON object a line, which is the template of a plug-in put into our folder."""

from pathlib import Path

TEMPLATE = Path(__file__).parents[2] / "docs/examples/plugin/mapmore_template/reader.py"
FILE = "storage/readers/jsonl.py"
PATCH = {FILE: TEMPLATE.read_text(encoding="utf-8")}
WORKS = """
from mapmore_cli.annexes.drafting.preview import preview
from mapmore_cli.ingestion.files import unique_ids
from mapmore_cli.storage.readers import READERS, TableRequest, reader_of
from mapmore_cli.study.sections.logs import Logs
path = Path("a.jsonl")
path.write_text("".join(f'{{"t": {n}, "P": {n + 3}, "who": "me"}}\\n' for n in range(40)))
reader = reader_of(path)
(table,) = reader.read(path, TableRequest("a.jsonl", ("P",)))
assert table.columns["P"].tolist() == list(range(3, 43))
assert list(reader.peek(path, 2))
assert preview(path).columns == ("t", "P")
assert unique_ids(["a.jsonl"]) == ["a"]
assert "json_lines" in str(Logs.model_json_schema())
logs = {"files": ["a.jsonl"], "reader": "json_lines", "columns": {"time": {"column": "t"}}}
assert Logs.model_validate(logs).reader == "json_lines"
try:
    Logs.model_validate({**logs, "decimal": ","})
except ValueError as error:
    assert "cannot use `decimal`" in str(error), error
else:
    raise AssertionError("a key was taken that the reader does not know")
"""
HALVES = {
    "that is not declared": (
        {FILE: PATCH[FILE].partition("READER = ")[0]},
        "storage/readers/test_every_reader.py::"
        "test_every_file_of_the_folder_declares_a_reader_that_a_test_names",
    )
}
