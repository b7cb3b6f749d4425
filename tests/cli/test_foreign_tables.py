"""Tables that another program wrote, for `predict` and `invert`: read by options, or refused with
one that helps.
"""

import csv
from pathlib import Path

import pytest

from mapmore_cli.cli.table_options import BY_OPTIONS
from mapmore_cli.pipeline import foreign
from mapmore_cli.pipeline.foreign import TableOptions

EXPECTED = "pressure,strain,force_predicted,outside_range\n150.0,0.05,127.5,false\n"
COLUMNS = ("--columns", "pressure=P [bar]", "--columns", "strain=eps [%]")
BAR = ("--units", "pressure=bar,strain=%")
READ = {
    "decimal comma in quotes": ('pressure,strain\n"150,0","0,05"\n', ["--decimal", ","]),
    "semicolons": ("strain;pressure\n0,05;150\n", ["--delimiter", ";", "--decimal", ","]),
    "whitespace": ("pressure strain\n150  0.05\n", ["--delimiter", "whitespace"]),
    "units": ("P [bar],eps [%]\n1.5,5\n", [*COLUMNS, *BAR]),
    "other titles": ("P,eps\n150,0.05\n", ["--columns", "pressure=P", "--columns", "strain=1"]),
    "a title with a comma": ('"P, left",strain\n150,0.05\n', ["--columns", "pressure=P, left"]),
    "thousands": (
        "pressure;strain\n150.000;0,05\n",
        [*("--delimiter", ";", "--decimal", ",", "--thousands", "."), "--units", "pressure=Pa"],
    ),
    "twice": ("pressure,strain,pressure\n150,0.05,7\n", ["--columns", "pressure=0"]),
}


@pytest.mark.parametrize("case", READ)
def test_a_table_is_read_as_options_say(case, tmp_path, model_file, mapmore):
    text, options = READ[case]
    (tmp_path / "t.csv").write_text(text)
    result = mapmore("predict", model_file, tmp_path / "t.csv", *options, code=0)
    header, row = result.stdout.splitlines()
    found = dict(zip(header.split(","), row.split(","), strict=True))
    assert [float(found[name]) for name in ("pressure", "strain", "force_predicted")] == [
        pytest.approx(value) for value in (150, 0.05, 127.5)
    ]


def test_texts_in_the_column_recording_are_carried_through(tmp_path, model_file, mapmore):
    (tmp_path / "t.csv").write_text(
        'Trial;pressure;strain\nT 01;150;0,05\n"a,b";150;0,05\n;150;0,05\n'
    )
    options = ["--delimiter", ";", "--decimal", ","]
    said = mapmore("predict", model_file, tmp_path / "t.csv", *options, code=0).stdout
    assert "recording" not in said
    options += ["--columns", "recording=Trial"]
    said = mapmore("predict", model_file, tmp_path / "t.csv", *options, code=0).stdout
    place = said.splitlines()[0].split(",").index("recording")
    assert [row[place] for row in csv.reader(said.splitlines()[1:])] == ["T 01", "a,b", ""]
    options[-1] = "recording=Run"
    mapmore("predict", model_file, tmp_path / "t.csv", *options, code=4, says="no column 'Run'")


@pytest.mark.parametrize(
    ("text", "remedy", "options"),
    [
        ("pressure;strain\n150;0,05\n", '`delimiter: ";"`', ""),
        ('pressure,strain\n"150,0",0.05\n', '`decimal: ","`', ""),
        ("P [bar],strain\n1.5,0.05\n", "P [bar], strain", ""),
        ("pressure [bar],strain\n1.5,0.05\n", "Did you mean 'pressure [bar]'?", ""),
        ("pressure,strain\n150 kPa,0.05\n", "`unit: kPa`", ""),
        ("pressure,strain,pressure\n150,0.05,7\n", "Give its 0-based index", ""),
        ("pressure;strain\nfoo;0\n", "\n  correct the cell, or list it", "--delimiter ;"),
        (
            "pressure;strain\n950;0\n1.050;0\n",
            'write `thousands: "."` at the column',
            "--delimiter ;",
        ),
    ],
)
def test_the_remedy_names_the_options(text, remedy, options, tmp_path, model_file, mapmore):
    (tmp_path / "t.csv").write_text(text)
    call = ("predict", model_file, tmp_path / "t.csv", *options.split())
    mapmore(*call, code=4, says=(remedy, BY_OPTIONS))


def test_a_binary_file_is_called_so_by_every_command(tmp_path, model_file, mapmore, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("t.csv").write_bytes(bytes(range(256)) * 9)
    columns = "columns: {pressure: {column: p, unit: kPa}, force: {column: F, unit: N}}"
    Path("s.yaml").write_text(f"name: s\ntarget: force\ndata: {{files: [t.csv], {columns}}}")
    for line in (f"predict {model_file} t.csv", "init t.csv", "check s.yaml", "run s.yaml"):
        mapmore(*line.split(), code=4, says="t.csv: is no text file, but a binary file")


def test_workbooks_parquet_and_utf16_are_read_as_they_are(tmp_path, model_file, mapmore):
    book = pytest.importorskip("openpyxl").Workbook()
    pa, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    for row in (["P [bar]", "eps"], [1.5, 0.05]):
        book.active.append(row)
    book.active["B2"].number_format = "0.0%"
    book.save(tmp_path / "t.xlsx")
    titles = ("--columns", "pressure=P [bar]", "--columns", "strain=eps")
    options = (*titles, "--units", "pressure=bar")
    assert mapmore("predict", model_file, tmp_path / "t.xlsx", *options, code=0).stdout == EXPECTED
    says = "its title says bar\n  write `--units pressure=bar`"
    mapmore("predict", model_file, tmp_path / "t.xlsx", *titles, code=4, says=says)
    percent = (*options, "--units", "strain=%")
    says = "'eps' is shown in per cent"
    mapmore("predict", model_file, tmp_path / "t.xlsx", *percent, code=4, says=says)
    table = pa.table({"pressure": [150.0], "strain": [0.05]})
    parquet.write_table(table, tmp_path / "t.parquet")
    (tmp_path / "t.txt").write_text("pressure,strain\n150,0.05\n", encoding="utf-16")
    for name in ("t.parquet", "t.txt"):
        assert mapmore("predict", model_file, tmp_path / name, code=0).stdout == EXPECTED
    fields = [pa.field("pressure", pa.float64(), metadata={"units": "psi"}), table.schema[1]]
    parquet.write_table(table.cast(pa.schema(fields)), tmp_path / "t.parquet")
    says = "'pressure' is in psi according to the file"
    mapmore("predict", model_file, tmp_path / "t.parquet", code=4, says=says)


@pytest.mark.parametrize(
    ("name", "encoding", "is_foreign"),
    [
        ("t.csv", "utf-8", False),
        ("t.csv", "utf-16", True),
        ("t.of_nobody", "utf-8", False),  # an ending that no reader has
        ("t.mat", "utf-8", True),
    ],
)
def test_tables_that_are_read_as_recordings_are(tmp_path, name, encoding, is_foreign):
    assert foreign.is_foreign(tmp_path / name, TableOptions(units={"strain": "%"}))
    assert not foreign.is_foreign(tmp_path / name, TableOptions())  # is missing
    (tmp_path / name).write_text("pressure,strain\n", encoding=encoding)
    assert foreign.is_foreign(tmp_path / name, TableOptions()) == is_foreign


def test_invert_reads_them_too(tmp_path, model_file, mapmore):
    (tmp_path / "t.csv").write_text("F [N];strain\n127,5;0,05\n")
    call = ("invert", model_file, tmp_path / "t.csv", "--for", "pressure", "--delimiter", ";")
    options = ("--decimal", ",", "--columns", "force=F [N]")
    result = mapmore(*call, *options, code=0)
    found = dict(zip(*(line.split(",") for line in result.stdout.splitlines()), strict=True))
    assert float(found["pressure_found"]) == pytest.approx(150)
    mapmore(*call, "--units", "load=N", code=2, says="the table cannot contain 'load'")
    mapmore(
        "predict", model_file, "-", "--decimal", ",", code=2, says="stdin is always read as CSV"
    )
    mapmore("predict", model_file, tmp_path / "t.csv", "--decimal", "x", code=2, says="decimal")
