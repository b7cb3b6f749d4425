"""Which files an output replaces: none that is read; by a chosen name, those of mapmore alone."""

import gzip
import json
import os
import shutil
from pathlib import Path

import pytest

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.pipeline.tables_in_memory import tables_of, write_tables
from mapmore_cli.storage.inputs import files_read, is_read, note_read
from mapmore_cli.storage.outputs import (
    WRITTEN,
    refuse_early,
    write_bytes,
    write_chosen,
    written_as_text,
)


def test_a_file_that_was_read_is_known_by_each_of_its_names(tmp_path):
    places = [tmp_path / name for name in ("a", "link", "other")]
    for place in (places[0], places[2]):
        place.touch()
    os.link(places[0], places[1])
    with files_read():
        note_read([places[0]])
        assert [*map(is_read, [*places, tmp_path / "none"])] == [True, True, False, False]


def test_a_file_with_a_chosen_name_replaces_those_of_mapmore_alone(tmp_path):
    place = tmp_path / "not" / "there"
    assert write_chosen(place, {"a.c": b"1", "b.csv": b"1"}) == [place / "a.c", place / "b.csv"]
    write_chosen(place, {"a.c": b"2", "b.csv": b"1"})
    (place / "d.c").write_bytes(b"/* mine, beside the code of mapmore */")
    (place / "b.csv").write_bytes(b"1, edited")
    with pytest.raises(WriteError, match=r"d\.c: .* not written by mapmore"):
        write_chosen(place, {"a.c": b"3", "d.c": b"3"})
    with pytest.raises(WriteError, match=r"b\.csv: the file exists, .* was changed afterwards"):
        write_chosen(place, {"a.c": b"3", "b.csv": b"3"})
    (place / "e.c").symlink_to("d.c")
    with pytest.raises(WriteError, match=r"e\.c: is a link"):
        write_chosen(place, {"e.c": (place / "d.c").read_bytes()})
    moved = shutil.copytree(place, tmp_path / "moved")
    write_chosen(moved, {"a.c": b"3"})
    assert [(folder / "a.c").read_bytes() for folder in (place, moved)] == [b"2", b"3"]


def test_files_that_were_replaced_before_a_kill_may_be_replaced_again(tmp_path, monkeypatch):
    write_chosen(tmp_path, {"a.c": b"1", "b.c": b"1"})

    def killed_at_b(path, data):
        if path.name == "b.c":
            raise KeyboardInterrupt
        path.write_bytes(data if isinstance(data, bytes) else data.encode())

    for new in (b"2", b"3"):
        with monkeypatch.context() as patch:
            patch.setattr("mapmore_cli.storage.outputs.write_own", killed_at_b)
            with pytest.raises(KeyboardInterrupt):
                write_chosen(tmp_path, {"a.c": new, "b.c": new})
        for name in ("a.c", "b.c"):
            refuse_early(tmp_path / name, chosen=True)
    write_chosen(tmp_path, {"a.c": b"4", "b.c": b"4"})
    assert {len(each) for each in json.loads((tmp_path / WRITTEN).read_text()).values()} == {64}
    (tmp_path / "a.c").write_bytes(b"2")  # as the first of the two, but nobody is at work now
    with pytest.raises(WriteError, match="was changed afterwards"):
        refuse_early(tmp_path / "a.c", chosen=True)


@pytest.mark.parametrize(
    "left",
    [None, "", "[1]", "{", '{"a.c": 1}', "[" * 100_000, f'{{"{"x" * 5000}": ""}}'],
    ids=range(7),
)
def test_without_its_note_a_file_with_a_chosen_name_is_kept(tmp_path, left):
    write_chosen(tmp_path, {"a.c": b"1"})
    (tmp_path / WRITTEN).unlink() if left is None else (tmp_path / WRITTEN).write_text(left)
    with pytest.raises(WriteError, match=r"a\.c: the file exists, and "):
        write_chosen(tmp_path, {"a.c": b"2"})
    write_chosen(tmp_path, {"a.c": b"1"})  # the same contents are noted again
    (tmp_path / WRITTEN).rename(tmp_path / "note")
    (tmp_path / WRITTEN).symlink_to("note")
    with pytest.raises(WriteError, match="is a link"):
        write_chosen(tmp_path, {"a.c": b"2"})
    assert (tmp_path / "a.c").read_bytes() == b"1"


def test_files_read_within_a_command_are_kept_until_its_end(tmp_path):
    with files_read():
        with files_read() as inner:
            note_read([tmp_path / "a", tmp_path / "gone"])
        assert inner == {tmp_path / "a", tmp_path / "gone"}
        (tmp_path / "a").write_text("a")
        with pytest.raises(WriteError, match="this command reads the file"):
            write_bytes(tmp_path / "a", b"b")
    write_bytes(tmp_path / "a", b"c")
    assert (tmp_path / "a").read_text() == "c"


def test_tables_in_memory_replace_no_recording_of_the_user(tmp_path):
    """`Fitted.to_yaml` writes them beside the spec, under names of its own."""
    tables, place = tables_of([{"x": [1.0, 2.0]}], {"x": "x"}, {"x": "1"}), tmp_path / "a_data"
    (path,) = write_tables(tables, place)
    assert write_tables(tables, place) == [path]
    path.write_text("mine")
    with pytest.raises(WriteError, match="not written by mapmore"):
        write_tables(tables, place)
    assert path.read_text() == "mine"


def test_an_output_that_is_noted_may_not_be_read_later(tmp_path):
    for name in "abc":
        (tmp_path / name).write_text(name)
    with files_read():
        refuse_early(tmp_path / "a")
        refuse_early(tmp_path / "new")
        note_read([tmp_path / "b", tmp_path / "gone"])
        (tmp_path / "hard").hardlink_to(tmp_path / "a")
        with files_read():  # a command within another one
            for name in ("a", "hard"):
                with pytest.raises(WriteError, match="this command reads the file"):
                    note_read([tmp_path / name])
        with pytest.raises(WriteError, match="this command reads the file"):
            refuse_early(tmp_path / "b")
    note_read([tmp_path / "a"])
    refuse_early(tmp_path / "b")


def test_a_chosen_name_is_refused_early_if_the_file_is_of_somebody_else(tmp_path):
    (tmp_path / "a.c").write_text("mine")
    refuse_early(tmp_path / "a.c")
    with pytest.raises(WriteError, match="not written by mapmore"):
        refuse_early(tmp_path / "a.c", chosen=True)
    (tmp_path / "empty").write_text("")
    refuse_early(tmp_path / "empty", chosen=True)
    os.mkfifo(tmp_path / "pipe")
    refuse_early(tmp_path / "pipe")
    with pytest.raises(WriteError, match="is a pipe, a socket or a device"):
        refuse_early(tmp_path / "pipe", chosen=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.c", "empty", "pipe"]


def test_the_same_text_gives_the_same_packed_bytes(tmp_path):
    path = tmp_path / "a.csv.gz"
    with written_as_text(path) as text:
        text.write("ü\r\n")
    packed = path.read_bytes()
    assert gzip.decompress(packed) == "ü\r\n".encode()
    assert packed[3:8] == bytes(5)  # no name, and no time
    with written_as_text(tmp_path / "a.csv") as text:
        text.write("ü\n")
    assert (tmp_path / "a.csv").read_bytes() == "ü\n".encode()


def test_text_goes_into_a_pipe_and_never_over_it(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    with written_as_text(tmp_path / "pipe") as text:
        text.write("ü\r\n")
    assert os.read(reader, 9) == "ü\r\n".encode()
    os.close(reader)
    with pytest.raises(WriteError, match="is a folder"):
        write_bytes(tmp_path, b"")
    with pytest.raises(WriteError, match="cannot be written"):
        refuse_early(Path())
