"""YAML 1.2 core scalars, positions, duplicate keys, and input that means harm."""

import json
import math
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest
import yaml
from common import rows_of
from hypothesis import given
from hypothesis import strategies as st
from spec_examples import STATIC, refusal

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.study.loader import load
from mapmore_cli.study.tree import SourceText, nearest, written
from mapmore_cli.study.yaml_dumper import _CoreDumper, dump
from mapmore_cli.study.yaml_loader import LARGEST, parse, read_source


def tree(text):
    problems = []
    root = parse(SourceText("t.yaml", Path(), text), problems)
    assert not problems
    return root


@pytest.mark.parametrize(
    ("text", "value"),
    [*rows_of("""
1e-3                  0.001
1E5                   100000.0
1.5e+3                1500.0
.5                    0.5
5.                    5.0
-0.0                  -0.0
+1.0                  1.0
12e03                 12000.0
010                   10
-7                    -7
+7                    7
0o10                  8
0x1F                  31
0                     0
no                    "no"
yes                   "yes"
on                    "on"
off                   "off"
y                     "y"
n                     "n"
No                    "No"
true                  true
True                  true
FALSE                 false
tRUE                  "tRUE"
null                  null
Null                  null
~                     null
nULL                  "nULL"
1:30                  "1:30"
190:20:30             "190:20:30"
2024-01-31            "2024-01-31"
2024-01-31T10:00:00Z  "2024-01-31T10:00:00Z"
1_000                 "1_000"
0b101                 "0b101"
0o8                   "0o8"
1e                    "1e"
e5                    "e5"
.                     "."
1.2.3                 "1.2.3"
=                     "="
٣                     "٣"
<<                    "<<"
.inf                  Infinity
-.INF                 -Infinity
'1'                   "1"
"true"                "true"
!!str 12              "12"
!!float 3             3.0
!!int 3               3
""", json.loads), ('', None)],
)  # fmt: skip
def test_scalars_of_yaml_1_2(text, value):
    read = written(tree(f"k: {text}"))["k"]
    assert read == value
    assert isinstance(read, type(value))
    assert isinstance(read, bool) == isinstance(value, bool)


def test_not_a_number():
    assert math.isnan(written(tree("k: .NaN"))["k"])


def test_a_merge_key_is_an_ordinary_key():
    assert written(tree("a: &x {p: 1}\nb: {<<: *x, q: 2}"))["b"] == {"<<": {"p": 1}, "q": 2}


def test_aliases_repeat_a_value():
    assert written(tree("a: &x [1, 2]\nb: *x")) == {"a": [1, 2], "b": [1, 2]}


def test_every_value_knows_its_place():
    root = tree("a:\n  b: [1, {c: two}]\n  é: x\n")
    place = nearest(root, ("a", "b", 1, "c"))
    assert (place.at.line, place.at.column, place.start.column) == (2, 14, 11)
    assert nearest(root, ("a", "é")).at.column == 6
    assert nearest(root, ("a", "missing", "deeper")) is nearest(root, ("a",))


def complaint(text):
    """What the reader says about a text; empty where it is content."""
    try:
        parse(SourceText("t.yaml", Path(), text), [])
    except SpecError as error:
        return str(error)
    return ""


TEXT = st.text(st.characters(codec="utf-8"), max_size=12)
SCALARS = (
    st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats(allow_nan=False) | TEXT
)
LOOKALIKES = [
    "1e-3", "no", "010", "0o10", "1:30", "~", "", "null", "+1", ".inf", "2024-01-31", "true",
        "a: b", "- x", "# c", "0x1",
        "a\x85b", "a\u2028b", "a\u2029b",
]  # fmt: skip


@given(
    st.dictionaries(
        TEXT.filter(lambda key: "${" not in key),
        st.recursive(
            SCALARS,
            lambda inner: (
                st.lists(inner, max_size=3)
                | st.dictionaries(TEXT.filter(lambda key: "${" not in key), inner, max_size=3)
            ),
        ),
    )
)
def test_what_is_dumped_is_read_back(value):
    text = dump(value).replace("${", "$${")
    back = written(tree(text))
    assert back == value
    assert repr(back) == repr(value)  # 1 and 1.0 and True are equal, but not the same


@pytest.mark.parametrize("text", LOOKALIKES)
def test_text_that_looks_like_something_else_stays_text(text):
    assert written(tree(dump({"k": text}))) == {"k": text}


@given(
    st.text(st.sampled_from(" \t\n-:,[]{}&*!|>'\"%@`#?ab1.\x00\x85\ufeff$"), max_size=30)
    | st.text(max_size=30)
)
def test_any_text_is_read_or_refused(text):
    message = complaint(text)
    assert not message or message.startswith("t.yaml:")


@given(
    st.integers(0, len(STATIC) - 1),
    st.sampled_from(
        ["\t", "[", "}", ":", "&a", "*a", "!", "'", "\n", "- ", "\x07", "%", "${", "é"]
    ),
)
def test_a_spec_with_one_slip_is_read_or_refused_with_a_place(place, slip):
    message = complaint(STATIC[:place] + slip + STATIC[place:])
    assert not message or message.startswith("t.yaml:")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["spec.yaml: the file is empty", "needs at least"]),
        ("# only a remark\n", ["the file is empty"]),
        ("- a\n- b\n", ["spec.yaml:1:1: the top level of a spec must be a mapping", "key: value"]),
        ("just text", ["spec.yaml:1:1: the top level of a spec must be a mapping"]),
        ("name: a\ndata:\n\tfiles: []\n", ["spec.yaml:3:1", "indent with spaces"]),
        ("name: a\nname: b\n", ["spec.yaml:2:1: key `name` is given twice; the first is on line 1",
            "remove one"]),
        ("name: a: b\n", ["spec.yaml:1:8", "in quotes"]),
        ("name: [a\nb: c\n", ["spec.yaml:2:2", "bracket"]),
        ('name: "a\n', ["not valid YAML"]),
        ("name: a\n---\nname: b\n", ["spec.yaml:2:1", "one file holds one spec"]),
        ('name: a\nmuscle: "\\U00110000"\n', ["spec.yaml:2:10", "not a Unicode character"]),
        ("name: *nowhere\n", ["spec.yaml:1:7", "&name"]),
        ("1: x\n", ["spec.yaml:1:1: `1` is not text", "quote it"]),
        ("{[a]: x}\n", ["spec.yaml:1:2", "this key is not text"]),
        ("name: !!python/object/apply:os.system [ls]\n", ["spec.yaml:1:7"]),
        ("name: !!python/name:os.system x\n", ["tag !!python/name:os.system"]),
        ("name: !!timestamp 2024-01-01\n", ["tag !!timestamp"]),
        ("name: !!int x\n", ["'x' is not a valid int"]),
        ("name: " + "9" * 5000, ["spec.yaml:1:7"]),
        ("name: a\0b\n", ["spec.yaml:1:8: the text contains the control character #x0000"]),
        (b"name: a\nmuscle: {name: caf\xe9}\n", ["spec.yaml:2:19: byte 0xe9 is not UTF-8",
            "save the file as UTF-8"]),
        ("name: grün\n".encode("utf-16"), ["spec.yaml:1:1: byte 0xff is not UTF-8"]),
        (b"\x89HDF\r\n\x1a\n" + bytes(range(256)), ["spec.yaml:1:1: byte 0x89"]),
    ],
)  # fmt: skip
def test_unreadable_files(tmp_path, text, words):
    message = refusal(tmp_path, text)
    assert all(word in message for word in words), message


def test_a_byte_order_mark_is_no_part_of_the_text(tmp_path):
    assert "unknown key `nam`" in refusal(tmp_path, b"\xef\xbb\xbfnam: x\n")


def test_a_spec_of_five_megabytes_is_read(tmp_path):
    path = tmp_path / "long.yaml"
    path.write_bytes(b"#" * LARGEST)
    assert len(read_source(path).text) == LARGEST


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(SpecError, match="no such file"):
        load(tmp_path / "none.yaml")
    with pytest.raises(SpecError, match="is a directory"):
        load(tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name: " + "[" * 100_000, "levels deep"),
        ("name: " + "{a: " * 5000, "levels deep"),
        ("\n".join(" " * i + "a:" for i in range(500)), "levels deep"),
        ("a: &a [x]\n" + "".join(f"{c}: &{c} [{','.join(['*' + p] * 9)}]\n" for p,
            c in pairwise("abcdefghi")), "multiply"),
        ("a: &a [*a]\n", "contains itself"),
        ("a: &a {b: *a}\n", "contains itself"),
        ("".join(f"a{i}: &a{i} [{f'*a{i - 1}' if i else 1}]\n" for i in range(200)),
            "nest too deeply"),
        ("name: " + "x" * 6_000_000, "larger than 5000 kB"),
        ("name: " + "x" * 900_000, "`name` is too long: 900000 characters"),
        ("name: '" + "x" * 900_000 + "'", "`name` is too long: 900000 characters"),
    ],
)  # fmt: skip
def test_hostile_input_is_refused_in_good_time(tmp_path, text, words):
    start = time.perf_counter()
    message = refusal(tmp_path, text)
    assert words in message
    assert len(message) < 2000
    assert time.perf_counter() - start < 10


@pytest.mark.parametrize(
    ("text_of", "deepest"),
    [
        (lambda n: f"a: {'[' * n}x{']' * n}", 38),  # and the document, and the text
        (lambda n: "a0: &a0 []\n" + "".join(f"a{i}: &a{i} [*a{i - 1}]\n" for i in range(1, n)), 40),
    ],
)
def test_forty_levels_are_read(text_of, deepest):
    assert tree(text_of(deepest))
    with pytest.raises(SpecError, match=r"levels deep|nest too deeply"):
        tree(text_of(deepest + 1))


def test_a_long_list_is_no_bomb_and_aliases_still_are(tmp_path):
    """What is counted is what aliases repeat."""
    assert len(written(tree(f"runs: [{'1,' * 51_000}]"))["runs"]) == 51_000
    one = "a: &a [" + ",".join(["1"] * 999) + "]\n"  # a thousand values with the list itself
    assert tree(one + "b: [" + ",".join(["*a"] * 50) + "]\n")
    assert "multiply" in refusal(tmp_path, one + "b: [" + ",".join(["*a"] * 51) + "]\n")


def test_specs_with_a_thousand_variations_are_read_by_their_tree_once(tmp_path):
    source = SourceText("s.yaml", tmp_path, "a: [1, 2]\na: 3\n")
    problems = []
    assert parse(source, problems) is parse(replace(source), problems)
    assert [problem.message for problem in problems] == [
        problems[0].message
    ] * 2  # each reading tells of a key that stands twice


def test_the_reference_reader_agrees_where_both_versions_of_yaml_do():
    assert written(tree(STATIC)) == yaml.safe_load(STATIC)


@pytest.mark.parametrize("word", ["on", "Off", "yes", "NO", "y"])
def test_other_readers_of_yaml_see_the_words_that_we_wrote(word):
    text = dump({word: word})
    assert yaml.safe_load(text) == written(tree(text)) == {word: word}


def test_a_document_is_written_key_by_key_as_it_is_written_whole():
    """What is kept of one document is not taken for what only equals it."""
    kept = (1, True, 1.0, "1", [1, True], {"a": 1}, {"a": 1.0}, {}, [], None, {"é": 1, "b": 2})
    for one in kept:
        whole = {"x": one, "longer": list(range(40)), "y": {"z": one}}
        text = yaml.dump(whole, Dumper=_CoreDumper, sort_keys=False, allow_unicode=True, width=120)
        assert dump(whole) == text
    assert dump({}) == "{}\n"


@pytest.mark.parametrize(
    ("value", "words"),
    [
        ("{column: P [kPa], unit: kPa}", ["`P [kPa]` has `[` in it", 'quotes: `"P [kPa]"`']),
        ("{column: P: kPa, unit: kPa}", ["`P: kPa` has `:` in it", 'quotes: `"P: kPa"`']),
        ("{column: P #1, unit: kPa}\n  b: 2", ["`P #1` has `#` in it", 'quotes: `"P #1"`']),
        ("[kPa] P", ["`[kPa] P` has `[` in it", "quotes"]),
        ("{z: 0,25, k: 1}", ["`0,25` has a decimal comma", "`0.25`"]),
        ("{k: 1, z: -1,5 mm}", ["`-1,5 mm` has a decimal comma", "`-1.5 mm`"]),
    ],
)
def test_marks_without_quotes_and_decimal_commas_are_called_so(tmp_path, value, words):
    message = refusal(tmp_path, f"name: a\ndata:\n  a: {value}\n")
    assert all(word in message for word in words), message


def test_a_number_without_a_key_before_it_is_no_decimal_comma(tmp_path):
    assert "`5` is not text" in refusal(tmp_path, "name: {a: x, 5}\n")
