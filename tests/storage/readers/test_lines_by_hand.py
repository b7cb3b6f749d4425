"""Lines, encodings, records and rates of files, by hand; in blocks of a few bytes."""

import io
from pathlib import Path

import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import Noted
from mapmore_cli.storage.tables import lines as module
from mapmore_cli.storage.tables.lines import Lines, csv_records, encoding_of, name_of_packed
from mapmore_cli.storage.tables.overview import NumberColumn, _log, _sample_time


@pytest.mark.parametrize(
    ("head", "encoding"),
    [
        *(("a;b", "utf-8"), ("größe", "utf-8"), ("", "utf-8")),
        *((b"gr\xf6\xdfe", "cp1252"), (b"\x81\x8d", "latin-1"), ("ö".encode()[:1], "utf-8")),
        *(("a;b".encode("utf-16"), "utf-16"), (b"\xfe\xff\x00a", "utf-16")),
        *(("a;b;c".encode("utf-16-le"), "utf-16-le"), ("a;b;c".encode("utf-16-be"), "utf-16-be")),
        *((text.encode("gbk"), "gb18030") for text in ("时间(秒);压力", "拉力")),
        *((text.encode("shift_jis"), "shift_jis") for text in ("圧力(kPa)", "ひずみ", "カメ1")),
        *((text.encode("cp1252"), "cp1252") for text in ("ÄÖÜ ÀÉ ä", "l’été – “n”", "²³ µm °C")),
        ("Young’s modulus".encode("cp1252"), "cp1252"),
        ("时间(秒);压力".encode("gbk")[:-1], "gb18030"),
        # at least half of the characters of two bytes are frequent letters
        *(("力（".encode("gbk"), "gb18030"), ("力（）".encode("gbk"), "cp1252")),
        (b"a;b" + b"\0" * 99, "utf-8"),
        # more than 35 of 100 bytes are zeros among the upper bytes
        (b"a\0" * 36 + b"aa" * 14, "utf-16-le"),
        (b"a\0" * 35 + b"aa" * 15, "utf-8"),
        (b"\0a" * 36 + b"aa" * 14, "utf-16-be"),
    ],
)
def test_the_encoding_of_a_text(head, encoding):
    assert encoding_of(head if isinstance(head, bytes) else head.encode()) == encoding


def test_suffixes_of_compression_are_left_out():
    names = ("a.csv.gz", "a.csv.BZ2", "a.csv.xz", "a.csv", "gz.csv", "a.gz.csv")
    assert [*map(name_of_packed, names)] == [*["a.csv"] * 4, "gz.csv", "a.gz.csv"]


def lines_of(data):
    return Lines(io.BytesIO(data), "utf-8", "surrogateescape", "a.csv", None)


@pytest.mark.parametrize("chunk", [1, 2, 3, 100])
def test_lines_end_in_three_ways_and_padding_is_no_text(chunk, monkeypatch):
    monkeypatch.setattr(module, "CHUNK", chunk)
    lines = lines_of(b"\xef\xbb\xbfa\r\nb\rc\n\nd\xc3\xa9")
    assert [*lines] == ["a\r\n", "b\r", "c\n", "\n", "dé"]
    assert (lines.rows, lines.taken, lines.padding) == (5, 14, 0)
    for end in (b"\0\0\0", b"\x1a\0\0", b"\0\r\n\0\0"):
        lines = lines_of(b"1\n2\n" + end)
        assert [*lines] == ["1\n", "2\n"]
        assert lines.padding == 3
    assert [*lines_of(b"abc\xc3def\n")] == ["abc\udcc3def\n"]  # half a letter among others
    lines = lines_of(b"1,2\n2,\0\n")
    assert [*lines] == ["1,2\n", "2,\0\n"]
    assert lines.padding == 0  # but a damaged cell
    lines = lines_of(b"1\n\0\n2\n")
    assert [*lines] == ["1\n", "\0\n", "2\n"]
    assert lines.padding == 0


def test_blocks_hold_whole_lines(monkeypatch):
    monkeypatch.setattr(module, "CHUNK", 5)
    lines, blocks = lines_of(b"12\n34\n5\r6"), []
    while block := lines.block():
        blocks.append(block)
        lines.take(block, block.count(b"\n"))
    assert b"".join(blocks) == b"12\n34\n5\r6"
    assert blocks == [b"12\n", b"34\n5\r", b"6"]
    assert (lines.taken, lines.rows) == (9, 2)


@pytest.mark.parametrize(("kept", "last"), [(100, ["34", "5", "6"]), (4, ["5", "6"])])
def test_the_last_lines_of_a_text_are_whole(monkeypatch, kept, last):
    for name, number in (("CHUNK", 4), ("KEPT", kept), ("LAST_LINES", 3)):
        monkeypatch.setattr(module, name, number)
    lines = lines_of(b"12\n34\n5\n6")
    assert len([*lines]) == 4
    assert lines.last_lines() == last
    whole = lines_of(b"5\n6")
    assert [*whole] == ["5\n", "6"]
    assert whole.last_lines() == ["5", "6"]


def test_lines_and_texts_that_are_no_tables(monkeypatch):
    monkeypatch.setattr(module, "CHUNK", 4)
    monkeypatch.setattr(module, "LONGEST", 8)
    for text in (b"1\n12345678\n", b"12345678\n"):
        assert "".join(lines_of(text)).encode() == text
    device = lines_of(b"\0" * 8)
    device.endless = True
    assert [*device] == []
    with pytest.raises(DataError, match=r"a.csv:row 2: is longer"):
        list(lines_of(b"1\n1234567890123\n"))
    with pytest.raises(DataError, match=r"zero:row 1: is longer"):
        list(module.lines_of(Path("/dev/zero"), print))  # a device without an end
    assert [*lines_of(b"\0" * 40)] == []


def records(*lines, row=0):
    return [*csv_records(iter(lines), ",", "a.csv", row)]


def test_records_of_fields_and_the_number_of_their_last_line():
    assert records("a,b\n", '"1\n', '2",3\n', "4,5", row=2) == [
        ("a,b\n", ["a", "b"], 3),
        ('"1\n2",3\n', ["1\n2", "3"], 5),
        ("4,5", ["4", "5"], 6),
    ]
    assert records('"20"1.2,3\n')[0][1] == ['"20"1.2', "3"]
    assert records('"a\x0b1,2",3\n')[0][1] == ["a\x0b1,2", "3"]  # a tabulator ends no line
    for swallowed in (['"1\n', "2,3\n", '4",5\n'], ['"1\n', "2\n"], ['"1\n', "a,3\n", '4",5\n']):
        with pytest.raises(DataError, match=r"a.csv:row 2: a quotation mark opens here"):
            records("a,b\n", *swallowed)


def of(length, group="", title="x", values=(0.0,), address="x"):
    return NumberColumn(address, title, group, length, np.array(values), Noted())


def test_the_log_is_the_longest_group_of_two_columns():
    one = of(9, "g"), of(9, "g"), of(9, ""), of(7, "h"), of(7, "h"), of(20, "i")
    assert _log(one) == [*one[:3]]
    assert _log(one[3:5]) == [*one[3:5]]
    apart = of(9, "h", address="b"), of(9, "i", address="a"), of(8, "j")
    assert _log(apart) == [apart[1], apart[0]]
    assert _log([of(1, "g"), of(1, "g")]) == []
    assert _log(one[5:]) == []
    more = [of(5, "a"), of(5, "a"), of(5, "b"), of(5, "b"), of(5, "b")]
    assert _log(more) == more[2:]


@pytest.mark.parametrize(
    ("title", "value", "step"),
    [
        *(("fs", 100.0, 0.01), ("Sample Rate", 3.0, 0.333333333333), ("dt", 0.02, 0.02)),
        *(("time_step", 5.0, 5.0), ("fs", 0.0, None), ("dt", -1.0, None), ("dt", np.inf, None)),
        *(("gain", 2.0, None), (None, 2.0, None)),
    ],
)
def test_rates_and_steps_are_known_by_their_names(title, value, step):
    assert _sample_time([of(2, title="fs", values=(1.0, 2.0)), of(1, "", title, (value,))]) == step
