"""`mapmore predict`: row for row, byte for byte, in any number of chunks."""

import csv
import gzip
import io
import math
from collections import deque
from itertools import chain, repeat

import pytest
from cli_samples import by_hand, hand_model
from common import peak_memory
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.domain.errors import DataError
from mapmore_cli.pipeline.predict import predicted_lines

MODEL = hand_model()
TABLE = "pressure,note,strain\n150,first,0.05\n100,second,0.2\n"

numbers = st.floats(-1e3, 1e3).map(lambda x: format(x, ".6g"))
cells = st.one_of(numbers, st.sampled_from(["", " ", "nan", "inf"]))
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\r\x00"), max_size=12)
rows = st.lists(st.tuples(cells, cells, texts), max_size=25)


def table_of(content, end="\n"):
    text = io.StringIO()
    writer = csv.writer(text, lineterminator=end)
    writer.writerow(["strain", "pressure", "remark"])
    writer.writerows(content)
    return io.StringIO(text.getvalue(), newline="").readlines()


@given(rows, st.integers(1, 30), st.sampled_from(["\n", "\r\n"]))
def test_chunks_have_no_influence(content, chunk, end):
    lines = table_of(content, end)
    assert "".join(predicted_lines(MODEL, lines, "t", chunk)) == "".join(
        predicted_lines(MODEL, lines, "t")
    )


@given(rows)
def test_every_row_stays_as_it_was_and_gains_two_fields(content):
    before = "".join(table_of(content))
    after = list(
        csv.reader(
            io.StringIO("".join(predicted_lines(MODEL, table_of(content), "t", 4)), newline="")
        )
    )
    assert after[0] == ["strain", "pressure", "remark", "force_predicted", "outside_range"]
    assert [tuple(row[:3]) for row in after[1:]] == [
        tuple(row) for row in list(csv.reader(io.StringIO(before, newline="")))[1:]
    ]
    for strain, pressure, _, predicted, outside in after[1:]:
        values = [float(cell) if cell.strip() else math.nan for cell in (pressure, strain)]
        if all(map(math.isfinite, values)):
            assert float(predicted) == pytest.approx(by_hand(*values), rel=1e-9, abs=1e-9)
            assert outside in ("true", "false")
        else:
            assert (predicted, outside) == ("", "")


def test_bytes_are_kept():
    lines = [
        '  pressure ,"a ""quoted"", name",strain\r\n',
        '1.50e2,"two\n',
        'lines", 0.050 \r\n',
        "\n",
        "100,007,0.2",
    ]
    assert list(predicted_lines(MODEL, lines, "t", 1)) == [
        '  pressure ,"a ""quoted"", name",strain,force_predicted,outside_range\r\n',
        '1.50e2,"two\nlines", 0.050 ,127.5,false\r\n',
        "\n",
        "100,007,0.2,20,true",
    ]


def test_outside_of_the_range_of_each_curve():
    points = {
        "100,0.1": "false",
        "100,0.15": "true",
        "150,0.15": "false",
        "99,0.05": "true",
        "200,0.2": "false",
        "200,-0.01": "true",
    }
    lines = ["pressure,strain\n", *(f"{point}\n" for point in points)]
    assert [line.strip().rsplit(",", 1)[1] for line in predicted_lines(MODEL, lines, "t")][
        1:
    ] == list(points.values())


def test_an_output_that_no_input_reaches_is_outside():
    lines = ["force,strain\n", "127.5,0.05\n", "1e12,0.05\n", "20,0.2\n"]
    found = [*predicted_lines(MODEL, lines, "t", turned_for="pressure")]
    assert [line.split(",")[2:] for line in found] == [
        ["pressure_predicted", "outside_range\n"],
        ["150", "false\n"],
        ["200", "true\n"],  # the end that comes nearest
        ["100", "true\n"],
    ]


@pytest.mark.parametrize(
    ("points", "warned"),
    [(["99,0.05", ",", "200,0.3"], True), (["99,0.05", "150,0.05"], False), ([",0.1"], False)],
)
def test_a_table_whose_every_row_lies_outside_is_warned_of(points, warned):
    warnings = []
    lines = ["pressure,strain\n", *(f"{point}\n" for point in points)]
    list(predicted_lines(MODEL, lines, "t", chunk=1, warn=warnings.append))
    expects = "the model expects pressure [kPa], strain [1]"
    assert warnings == [f"t: every row lies outside the training range; {expects}"] * warned


@pytest.mark.parametrize(
    ("text", "place", "remedy"),
    [
        ("", "t: the table is empty", "pressure [kPa], strain [1]"),
        ("pressure,strian\n1,2\n", "no column 'strain'", "Did you mean 'strian'?"),
        ("pressure,strain,strain\n1,2,3\n", "'strain' occurs 2 times", ""),
        (
            "pressure,strain\n1,2\n1,high\n",
            "t:row 3, column strain: 'high' is not a number",
            "leave it empty",
        ),
        ("pressure,strain\n1_0,2\n", "t:row 2, column pressure: '1_0' is not a number", ""),
        ("pressure,strain\n1,2\n1\n", "t:row 3: has 1 fields, but the header has 2", ""),
        ("pressure,strain\n1,2,3\n", "t:row 2: has 3 fields, but the header has 2", ""),
        (
            "pressure,strain,force_predicted\n1,2,3\n",
            "already has a column force_predicted",
            "rename",
        ),
        ("pressure,strain,outside_range\n1,2,3\n", "already has a column outside_range", "rename"),
        ('pressure,remark,strain\n1,"two\nlines",0\n1,x,wrong\n', "t:row 4, column strain", ""),
    ],
)
def test_broken_tables(text, place, remedy):
    with pytest.raises(DataError) as caught:
        list(predicted_lines(MODEL, text.splitlines(keepends=True), "t"))
    assert place in caught.value.message
    assert remedy in str(caught.value)


def test_memory_is_bounded():
    def peak(n):
        lines = chain(["pressure,strain\n"], repeat("150,0.05\n", n))
        return peak_memory(lambda: deque(predicted_lines(MODEL, lines, "t", 200), maxlen=0))

    peak(400)  # imports and caches
    assert peak(20_000) < 2 * peak(1_000)


def test_file_to_file(model_file, tmp_path, mapmore):
    table, out = tmp_path / "t.csv", tmp_path / "out.csv"
    table.write_text(TABLE)
    result = mapmore("predict", model_file, table, "-o", out)
    assert (result.exit_code, result.output) == (0, "")
    assert out.read_text() == (
        "pressure,note,strain,force_predicted,outside_range\n150,first,0.05,127.5,false\n"
        "100,second,0.2,20,true\n"
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.csv", "t.csv"]
    mapmore("predict", model_file, table, "-o", table, code=0)  # which replaces itself
    assert table.read_text() == out.read_text()


def test_standard_streams_carry_any_bytes(model_file, mapmore):
    table = b"pressure,note,strain\n" + b"150,\xff\xe9 not utf-8,0.05\n"
    result = mapmore("predict", model_file, "-", stdin=b"\xef\xbb\xbf" + table)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout_bytes.splitlines()[1] == b"150,\xff\xe9 not utf-8,0.05,127.5,false"
    assert result.stdout_bytes.startswith(b"pressure,note")


def test_gzip_in_and_out(model_file, tmp_path, mapmore):
    table, out = tmp_path / "t.csv.gz", tmp_path / "a.csv.gz"
    table.write_bytes(gzip.compress(TABLE.encode()))
    mapmore("predict", model_file, table, "-o", out, code=0)
    assert gzip.decompress(out.read_bytes()).splitlines()[1] == b"150,first,0.05,127.5,false"


def test_damaged_gzip(model_file, tmp_path, mapmore):
    (tmp_path / "t.csv.gz").write_bytes(gzip.compress(TABLE.encode() * 99)[:-20])
    mapmore(
        "predict", model_file, tmp_path / "t.csv.gz", code=4, says="t.csv.gz: the file is damaged"
    )


def test_a_mistake_leaves_the_old_output(model_file, tmp_path, mapmore):
    table, out = tmp_path / "t.csv", tmp_path / "out.csv"
    table.write_text(TABLE + "150,third,oops\n")
    out.write_text("old")
    mapmore(
        "predict", model_file, table, "-o", out, code=4, says="t.csv:row 4, column strain: 'oops'"
    )
    assert out.read_text() == "old"
    assert len(list(tmp_path.iterdir())) == 2


def test_grid_has_both_ends(model_file, mapmore):
    result = mapmore("predict", model_file, "--grid", "strain=0:0.1:0.05,pressure=100:200:100")
    assert result.stdout == (
        "strain,pressure,force_predicted,outside_range\n"
        "0,100,100,false\n0,200,200,false\n0.05,100,80,false\n0.05,200,175,false\n"
        "0.1,100,60,false\n0.1,200,150,false\n"
    )


def test_megabytes_are_told_of_all(model_file, tmp_path, mapmore, monkeypatch):
    for wait in ("PATIENCE", "LINE_EVERY"):
        monkeypatch.setattr(f"mapmore_cli.cli.progress.{wait}", 0.0)
    row = "150,0.05" + " " * 132 + "\n"
    (tmp_path / "t.csv").write_text("pressure,strain\n" + 20_000 * row)
    told = mapmore("predict", model_file, tmp_path / "t.csv", code=0).stderr
    assert "MB read: 2 of 3" in told.splitlines()
