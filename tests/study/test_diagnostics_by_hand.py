"""How the mistakes of a spec are collected, ordered and worded, by hand."""

from pathlib import Path

import pytest

from mapmore_cli.domain.errors import DataError, MapmoreError, RunWarning, SpecError, explained
from mapmore_cli.study.diagnostics import (
    Mistake,
    _unknown_key,
    _value_in_words,
    did_you_mean,
    raise_if_any,
)
from mapmore_cli.study.loader import _echoes
from mapmore_cli.study.tree import Position, SourceText

ONE, OTHER = (SourceText(name, Path(), "a: 1\nb: 2\n") for name in ("one.yaml", "other.yaml"))


def told(*places):
    """What is told of mistakes at some places, each by its source, line and column."""
    mistakes = [Mistake(Position(*place), "wrong") for place in places]
    with pytest.raises(SpecError) as caught:
        raise_if_any(mistakes)
    return [line for line in str(caught.value).splitlines() if not line.startswith(" ") and line]


def test_mistakes_are_in_the_order_of_the_sources_and_of_their_lines():
    assert raise_if_any([]) is None
    places = [(OTHER, 2, 1), (ONE, 2, 4), (ONE, 1, 1), (ONE, 2, 1), (OTHER, 1, 1), (ONE, 1, 1)]
    assert told(*places) == [
        "other.yaml:1:1: wrong",
        "other.yaml:2:1: wrong",
        "one.yaml:1:1: wrong",
        "one.yaml:2:1: wrong",
        "one.yaml:2:4: wrong",
    ]


@pytest.mark.parametrize(
    ("count", "last"),
    [
        (25, "one.yaml:25:1: wrong"),
        (26, "... and 1 more"),
        (199, "... and 174 more"),
        (200, "... and at least 175 more"),
    ],
)
def test_twenty_five_mistakes_are_shown(count, last):
    lines = told(*((ONE, number, 1) for number in range(1, count + 1)))
    assert (len(lines), lines[-1]) == (min(count, 26), last)


@pytest.mark.parametrize(("size", "first"), [(110, 1), (111, 46)])
def test_the_last_line_of_a_spec_is_shown_whole_if_it_is_not_too_long(size, first):
    """A line has 110 characters at most; of a longer one, what stands around the mistake."""
    line = "".join(chr(ord("a") + place % 26) for place in range(size))
    mistake = Mistake(Position(SourceText("a.yaml", Path(), f"x: 1\n{line}"), 2, 101), "wrong")
    with pytest.raises(SpecError) as caught:
        raise_if_any([mistake])
    _, shown, caret = str(caught.value).splitlines()
    assert shown == f"     2 | {line[first - 1 :]}"
    assert shown[caret.index("^")] == line[100]


@pytest.mark.parametrize(
    ("loc", "said"), [(("a",), "unknown key `a`"), (("b", "a"), "unknown key `a` in `b`")]
)
def test_an_unknown_key_is_told_with_its_section(loc, said):
    assert _unknown_key(loc, []) == (said, None)


@pytest.mark.parametrize(
    ("word", "known", "said"),
    [
        ("PRESSUR", ["strain", "pressure"], "did you mean `pressure`?"),
        ("zzz", ["b", "a", "b"], "known are `b`, `a`"),
        ("zzz", [], None),
    ],
)
def test_a_near_word_is_suggested_and_all_words_otherwise(word, known, said):
    assert did_you_mean(word, known) == said


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "empty"),
        (True, "true"),
        (1.5, "1.5"),
        ([1], "a list"),
        ({}, "a mapping"),
        ("x" * 40, f"the text '{'x' * 40}'"),
        ("x" * 41, f"the text '{'x' * 40}...'"),
    ],
)
def test_a_value_is_described_by_its_type_and_its_beginning(value, words):
    assert _value_in_words(value) == words


@pytest.mark.parametrize(
    ("loc", "echoes"),
    [
        (("name",), True),
        (("fit", "max_terms"), False),
        (("data", "columns", "x"), True),
        (("data", "columns", "x", "unit"), False),
        (("data", "levels", "at", 0), True),
        (("fit", "shape", "x"), False),
    ],
)
def test_parts_whose_removal_would_cause_other_mistakes(loc, echoes):
    assert _echoes(loc) == echoes


def test_a_warning_about_another_run_names_this_run_once():
    warning = RunWarning.of("inner", "odd")
    assert (warning, warning.run, warning.message) == ("inner: odd", "inner", "odd")
    assert RunWarning.of("outer", warning) is warning


def caused(error, cause):
    error.__cause__ = cause
    return error


@pytest.mark.parametrize(
    ("error", "kind", "words"),
    [
        (MemoryError(), MapmoreError, "not enough memory"),
        (OSError(12, "Cannot allocate memory"), MapmoreError, "not enough memory"),
        (PermissionError(13, "no", "a.csv"), DataError, "a.csv: cannot be read"),
        (OSError(36, "File name too long", 200 * "b"), DataError, f"{100 * 'b'}...: file name"),
        (OSError(36, "File name too long", 199 * "b"), DataError, f"{199 * 'b'}: file name"),
        (PermissionError(13, "no"), PermissionError, "no"),
        (caused(SystemError(), KeyboardInterrupt("stop")), KeyboardInterrupt, "stop"),
        (caused(SystemError("odd"), ValueError()), SystemError, "odd"),
    ],
)
def test_faults_of_the_system_are_explained_to_the_user(error, kind, words):
    found = explained(error)
    assert type(found) is kind
    assert words in str(found)
