"""What loggers write: time stamps, words for missing values, several sheets, encodings of their
country.
"""

import gzip
from datetime import datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ingest_samples import COLUMNS, csv_text, steps
from reading import refused, workbook

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.cells import stamp_of
from mapmore_cli.storage.tables.lines import encoding_of, guess_encoding


@given(st.datetimes(min_value=datetime(1971, 1, 1), max_value=datetime(2100, 1, 1)))
def test_stamps_keep_their_distance(stamp):
    """Whatever the zone is taken to be, a second later is a second later."""
    later = stamp.replace(microsecond=0)
    first, second = (stamp_of(str(one)) for one in (later, stamp))
    assert second[1] - first[1] == pytest.approx(stamp.microsecond / 1e6, abs=1e-6)


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_words_and_numbers_for_missing_values(ingest, delimiter):
    text = "t,P,eps,F\n0,80,0.1,1\n1,---,0.1,2\n2,80,0.1,-999\n3,80,0.1,4\n".replace(",", delimiter)
    with refused("row 3, column P: '---' is not a number", "missing: {tokens:"):
        ingest({"a.csv": text}, delimiter=delimiter)
    dataset = ingest({"a.csv": text}, delimiter=delimiter, missing={"tokens": ["---", -999]})
    np.testing.assert_array_equal(dataset.recordings[0].columns["force"], [1, 4])
    assert dict(dataset.recordings[0].dropped) == {"missing value": 2}


def rows(text):
    """The cells of a text, with its numbers."""
    return [
        [float(cell) if cell[:1].isdigit() or cell[:1] == "-" else cell for cell in line.split(",")]
        for line in text.splitlines()
    ]


@pytest.fixture
def book(tmp_path):
    path = tmp_path / "book.xlsx"
    workbook(path, Run1=rows(steps(80)), Run2=rows(steps(150)), Notes=[["made", "by", "hand"]])
    return path


def ids(dataset):
    return [recording.id for recording in dataset.recordings]


def test_every_sheet_that_a_glob_names_is_a_recording(ingest, book):
    dataset = ingest({}, files=[book.name], reader="xlsx", sheet="Run*")
    assert ids(dataset) == ["book[Run1]", "book[Run2]"]
    assert [recording.columns["pressure"][0] for recording in dataset.recordings] == [80, 150]
    with pytest.raises(DataError, match=r"book\.xlsx: there is no sheet 'Lauf\*'"):
        ingest({}, files=[book.name], reader="xlsx", sheet="Lauf*")


def test_sheets_one_by_one(ingest, book):
    files = [
        {"path": book.name, "sheet": "Run2", "set": {"load": 2.0}},
        {"path": book.name, "sheet": "Run1", "set": {"load": 1.0}},
    ]
    dataset = ingest({}, files=files, reader="xlsx")
    assert ids(dataset) == ["book[Run2]", "book[Run1]"]
    assert [recording.columns["load"][0] for recording in dataset.recordings] == [2, 1]
    assert ids(ingest({}, files=files[:1], reader="xlsx")) == ["book"]
    with pytest.raises(DataError, match="named twice"):
        ingest({}, files=[files[0], files[0]], reader="xlsx")


def test_empty_sheets_are_no_recordings(ingest, tmp_path):
    workbook(tmp_path / "b.xlsx", Sheet1=rows(steps(80)), Sheet2=[], Sheet3=[])
    assert ids(ingest({}, files=["b.xlsx"], reader="xlsx", sheet="*")) == ["b[Sheet1]"]


GERMAN = csv_text(t=np.arange(3.0), P=80.0, eps=0.1, F=1.0).replace("eps", "Dehnung µ", 1)


@pytest.mark.parametrize(
    "encoding", ["cp1252", "utf-16", "utf-16-le", "utf-16-be", "utf-8", "utf-8-sig"]
)
@pytest.mark.parametrize("zipped", [False, True])
def test_the_guessed_encoding_reads_the_file(ingest, tmp_path, encoding, zipped):
    content = GERMAN.encode(encoding)
    (tmp_path / "a.csv").write_bytes(gzip.compress(content) if zipped else content)
    columns = {**COLUMNS, "strain": {"column": "Dehnung µ"}}
    dataset = ingest({}, columns=columns, encoding=guess_encoding(tmp_path / "a.csv"))
    np.testing.assert_array_equal(dataset.recordings[0].columns["strain"], [0.1, 0.1, 0.1])


@pytest.mark.parametrize("encoding", ["cp1252", "utf-16"])
def test_the_reader_suggests_the_encoding(ingest, encoding):
    with refused("not a text file in UTF-8", f"write `encoding: {encoding}`"):
        ingest({"a.csv": GERMAN.encode(encoding)})


@given(st.binary(max_size=300))
def test_an_encoding_is_guessed_for_any_bytes(content):
    encoding = encoding_of(content)
    # of a character of several bytes, a part may be left
    if not encoding.startswith("utf-16"):
        is_strict = encoding in ("cp1252", "latin-1")
        content.decode(encoding, errors="strict" if is_strict else "ignore")
