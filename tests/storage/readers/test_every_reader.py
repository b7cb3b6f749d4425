"""What holds for every reader: it tells of what is no file of its kind."""

import sys
from pathlib import Path

import pytest
from common import files_without_parts
from reading import refusal

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage import readers
from mapmore_cli.storage.readers import READERS
from mapmore_cli.storage.tables import IN_MEMORY, RawTable, Reader, reading, refuse_bombs


def test_every_file_of_the_folder_declares_a_reader_that_a_test_names():
    assert files_without_parts("readers", Reader, readers) == set()
    tests = "".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    assert [name for name in READERS if f'"{name}"' not in tests] == []


def test_no_two_readers_claim_a_suffix():
    suffixes = [suffix for reader in READERS.values() for suffix in reader.suffixes]
    assert len(set(suffixes)) == len(suffixes)
    assert all(suffix.startswith(".") and suffix == suffix.lower() for suffix in suffixes)


def test_columns_have_numbers_in_all_formats_but_those_that_name_each_column():
    assert {reader.name for reader in READERS.values() if not reader.by_index} == {
        "parquet",
        "tdms",
    }


@pytest.mark.parametrize("reader", READERS)
def test_a_file_that_vanished(tmp_path, reader):
    refusal(["cannot be read: No such file"], reader, tmp_path / "gone", 0, header=0)


@pytest.mark.parametrize(
    "content", [b"", b"t,F\n0,1\n", bytes(600), b"\x7fELF" * 100, b"\xd0\xcf\x11\xe0" + bytes(600)]
)
@pytest.mark.parametrize("reader", [name for name in READERS if name != "csv"])
def test_a_file_of_another_kind(tmp_path, reader, content):
    (tmp_path / "a").write_bytes(content)
    assert refusal([], reader, tmp_path / "a", "g/c").startswith("a.")


@pytest.mark.parametrize(
    ("reader", "module", "library"),
    [
        ("xlsx", "python_calamine", "python-calamine"),
        ("tdms", "nptdms", "npTDMS"),
    ],
)
def test_a_library_that_is_missing(tmp_path, monkeypatch, reader, module, library):
    monkeypatch.setitem(sys.modules, module, None)
    refusal(
        [
            f"a.{reader}: ",
            f"needs {library}, which is not installed",
            "pip install 'mapmore[formats]'",
        ],
        reader,
        tmp_path / "a",
        "t",
    )


@pytest.mark.parametrize(
    ("fault", "kind", "message"),
    [
        (FileNotFoundError(2, "none"), DataError, "a.csv: cannot be read: none"),
        (OSError("odd\n end"), DataError, "a.csv: the file is damaged, or is no text: odd end"),
        (KeyError(), DataError, "a.csv: the file is damaged, or is no text: KeyError"),
        # SciPy reads a variable before it has a value
        (UnboundLocalError("x"), DataError, "a.csv: the file is damaged, or is no text: x"),
        (DataError("is odd"), DataError, "a.csv: is odd"),
        (DataError("a.csv:row 2: is odd"), DataError, "a.csv:row 2: is odd"),
        (NameError("x"), NameError, "x"),
        (ImportError("x"), ImportError, "x"),
    ],
    ids=repr,
)
def test_errors_of_parsers_name_the_file_and_faults_of_the_program_do_not(fault, kind, message):
    with pytest.raises(kind) as told, reading("a.csv", "text"):
        raise fault
    assert getattr(told.value, "message", str(told.value)) == message


@pytest.mark.parametrize(
    ("most", "packed", "size"), [(100_000_000, 1, None), (1000, 1, 1000), (2000, 10, 1000)]
)
def test_data_may_unpack_to_a_limit_and_to_two_hundred_times_their_size(most, packed, size):
    refuse_bombs("a", most, packed, size)
    with pytest.raises(DataError, match="a unpacks from"):
        refuse_bombs("a", most + 1, packed, size)


def test_a_sample_has_a_place_in_its_file_or_in_memory():
    table = RawTable({}, [7, 9], "a.csv", "index")
    assert table.at(1) == "a.csv:index 9"
    assert RawTable({}, [7, 9], "a", IN_MEMORY).at(0) == "a, row 7 (from 0)"
