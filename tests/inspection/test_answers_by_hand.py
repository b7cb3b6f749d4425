"""Answers of a person: names, quantities and ranges of columns, and the courses that are shown."""

import re
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.annexes.drafting import questions
from mapmore_cli.annexes.drafting.answers import (
    Answers,
    answers_of,
    read_group,
    read_hold,
    read_names,
    read_positive,
)
from mapmore_cli.annexes.drafting.by_person import named_by_person, refuse_choice
from mapmore_cli.annexes.drafting.columns import TitledColumn
from mapmore_cli.annexes.drafting.commands import ask
from mapmore_cli.annexes.drafting.draft import Draft, NamedColumn
from mapmore_cli.annexes.drafting.finding import find
from mapmore_cli.annexes.drafting.questions import (
    BLOCKS,
    Asked,
    Option,
    Question,
    _groups,
    _inputs,
    course,
    interview,
)
from mapmore_cli.annexes.drafting.understanding import Understood, _conditions_of, _group_of
from mapmore_cli.annexes.drafting.written_columns import with_columns
from mapmore_cli.domain.errors import UsageError


def test_columns_have_units_scales_and_offsets():
    named = read_names("--columns", "time:ms,_, P=Druck 1:kPa*2.5-1e1,-,force:N*-2,q=7:V+0.5")
    assert {name: (one.column, one.unit, one.scale, one.offset) for name, one in named.items()} == {
        "time": (0, "ms", 1, 0),
        "P": ("Druck 1", "kPa", 2.5, -10),
        "force": (4, "N", -2, 0),
        "q": (7, "V", 1, 0.5),
    }
    assert [one.is_called for one in named.values()] == [False, True, False, True]
    (one,) = read_names("--target", "7").items()
    assert one == ("7", NamedColumn(7))
    assert read_names("--target", "²")["²"].column == "²"  # a digit that is no decimal number
    assert [*read_names("--inputs", "'Kraft, z=1':N,tip[:,0]:mm")] == ["Kraft, z=1", "tip[:,0]"]
    quoted = read_names("--inputs", 'a="Kraft, z=1":N')["a"]
    assert (quoted.column, quoted.unit) == ("Kraft, z=1", "N")


@pytest.mark.parametrize(
    ("option", "text", "words"),
    [
        *(("--columns", "a,a", "a is given twice"), ("--columns", "_, ,-", "no column is named")),
        *(
            ("--columns", "1a", "'1a' is not a valid name"),
            ("--inputs", "1a=x", "not a valid name"),
        ),
        *(("--columns", "force:kPa", "force: "), ("--inputs", "x:furlongs2", "x: ")),
    ],
)
def test_names_that_cannot_be(option, text, words):
    with pytest.raises(UsageError, match=option) as error:
        read_names(option, text)
    assert words in error.value.message


def test_further_answers():
    assert read_hold("strain=kinked:%") == ("strain", "kinked", "%")
    assert read_hold("none") == ("none", "", "")
    assert [read_group(text) for text in ("specimen", "3", "none")] == ["specimen", "3", None]
    with pytest.raises(UsageError, match="--group"):
        read_group("a b")
    assert read_positive("--length", "m", "88mm", "88 mm") == 0.088
    for text in ("0 mm", "-1 mm", "1e999", "x", "5 kPa"):
        with pytest.raises(UsageError, match="--length"):
            read_positive("--length", "m", "88mm", text)
    found = answers_of(
        recordings="a, b[:,0]", sample_time="10 ms", validate=" last ", no_clock=True, length=None
    )
    assert (found.recordings, found.sample_time) == (("a", "b[:,0]"), 0.01)
    assert (found.validate, found.no_clock, found.length) == ("last", True, None)


def test_which_answers_name_columns_by_their_number():
    column, places = {"x": NamedColumn("x")}, {"x": NamedColumn(3)}
    without = (Answers(), Answers(columns=column), Answers(group="a1"), Answers(recordings=("1a",)))
    assert not any(one.has_places for one in without)
    with_places = [Answers(**{key: places}) for key in ("columns", "target", "inputs")]
    with_places += [Answers(inputs={"x": NamedColumn("3..7")}), Answers(group="3")]
    assert all(one.has_places for one in [*with_places, Answers(recordings=("a", "12"))])


def titled(place, title, values, quantity="", unit=""):
    return TitledColumn(
        title or place, place, title, [np.asarray(values)], quantity, True, unit, ""
    )


WAVE = np.array([0.0, 4.0, 1.0, 5.0])
TABLE = {
    one.column: one
    for one in (
        titled(0, "t", [0.0, 1.0, 2.0, 3.0], "time", "s"),
        titled(1, "s1", WAVE),
        titled(2, "s2", WAVE + 1),
        titled(3, "flat", [1.0, 1.0]),
        titled(4, "force", 2 * WAVE, "force"),
    )
}


def named(text, option="--inputs", known=None):
    return named_by_person(read_names(option, text), TABLE, option, known or {})


def test_ranges_and_patterns_of_columns_mean_all_that_move_but_the_time():
    assert [*named("0..3")] == [*named("3..0")] == [*named("S*")] == [*named("s?")] == ["s1", "s2"]
    assert [*named("*")] == ["s1", "s2", "force"]
    for text, words in (("a*", "no column whose values"), ("x=s*", "2 columns whose values")):
        with pytest.raises(UsageError, match=words):
            named(text)
    assert named("x=f*")["x"].column == "force"


NAMES = ["P=100_stretch1", "P=200_stretch4", "P=400_stretch9"]
SET_POINTS = titled(6, "P meas", [], "pressure", "kPa")
SET_POINTS = replace(SET_POINTS, values=[np.full(3, x) for x in (101.0, 201.0, 401.0)])


@pytest.mark.parametrize(
    ("inputs", "columns", "conditions", "measured", "unused"),
    [
        (None, {}, ["pressure", "stretch"], [], ""),
        (None, {"x": SET_POINTS}, ["stretch"], ["x"], "pressure (the column P meas measures it)"),
        ({}, {}, [], [], "pressure (name it with --inputs"),  # it has no unit
        ({"pressure": NamedColumn("pressure")}, {}, ["pressure"], [], "stretch (name it with"),
        # a person calls another column so
        ({"pressure": NamedColumn("s1", is_called=True)}, {}, [], [], "stretch (name it with"),
        (
            {"force": NamedColumn("force")},
            {},
            [],
            [],
            "pressure (name it with --inputs",
        ),
    ],
)
def test_numbers_in_names_are_inputs_unless_a_column_or_a_person_says_something_else(
    inputs, columns, conditions, measured, unused
):
    table = TABLE | {one.column: one for one in columns.values()}
    named_columns = {name: NamedColumn(one.column) for name, one in columns.items()}
    found, names, remark = _conditions_of(
        SimpleNamespace(names=NAMES), table, Answers(inputs=inputs), named_columns
    )
    assert ([one.quantity for one in found], names) == (conditions, measured)
    assert remark.startswith(f"numbers not used: {unused}") if unused else remark == ""


@pytest.mark.parametrize("texts", [("a", "b"), ("a", "Mean", "b", "SD")])
def test_rows_of_means_are_read_as_missing_values_if_their_column_is_used(texts):
    table = TABLE | {"day": TitledColumn("day", 5, "day", [], "", False, "", "", texts=texts)}
    columns = {name: NamedColumn(name, "1") for name in ("force", "s1")}
    known = Understood(columns, ["force"], ["s1"], [], "", {"s2": "why"}, None, [])
    draft = with_columns(Draft({"data": {}}), known, "force", table)
    assert "missing" not in draft.data
    assert draft.notes["data", "columns"].why == "left out: t, s2 (why), flat, day"
    columns |= {"day": NamedColumn("day", "1", texts=True), "s2": NamedColumn("s2", "bar")}
    known = replace(known, group="day", apart=["day"], targets=["force", "s2"])
    draft = with_columns(Draft({"data": {"sample_time": 0.1}}), known, "force", table)
    tokens = [text for text in texts if text in ("Mean", "SD")]
    assert draft.data.get("missing") == ({"tokens": tokens} if tokens else None)
    assert draft.data["recordings"] == {"of": "day"}
    assert [*draft.data["columns"]] == ["force", "s1", "day"]  # another target is no input
    assert draft.data["sample_time"] == 0.1
    assert "units" not in draft.spec
    clock = replace(known, columns=columns | {"time": NamedColumn("t", "s")}, apart=["day", "s1"])
    draft = with_columns(Draft({"data": {"sample_time": 0.1}}), clock, "s2", table)
    assert "sample_time" not in draft.data
    assert draft.data["recordings"] == {"of": ["day", "s1"]}
    assert draft.spec["units"] == {"s2": "kPa"}


def test_groups_are_a_column_by_its_number_or_title_or_else_a_word_in_names():
    assert _group_of(TABLE, None, {}) == (None, {})
    assert _group_of(TABLE, "specimen", {}) == ("specimen", {})
    for said in ("1", "s1"):
        name, columns = _group_of(TABLE, said, {})
        assert (name, columns["s1"].column) == ("s1", "s1")
    name, columns = _group_of(TABLE, "1", {"wave": NamedColumn("s1", "kPa")})
    assert (name, columns["wave"].unit) == ("wave", "kPa")
    with pytest.raises(UsageError, match="--group: no column is called 9"):
        _group_of(TABLE, "9", {})


def test_columns_of_a_person_are_in_the_given_unit():
    one = named("P=s1:kPa*2+1", "--columns")["P"]
    assert (one.column, one.unit, one.why, one.sure) == ("s1", "kPa", "you; 1 to 11 kPa", True)
    force = named("force")["force"]
    assert (force.unit, force.sure) == ("N", False)
    assert named("force:lbf")["force"].sure
    known = {"F": NamedColumn("force", "kN", "why")}
    assert (named("4", known=known)["F"].unit, named("4", known=known)["F"].sure) == ("kN", True)


def test_columns_that_move_are_listed_with_the_command():
    error = refuse_choice(TABLE, "a.csv", "folder", is_map=False)
    listed = [line.split()[:2] for line in error.message.splitlines()[1:]]
    assert listed == [["0", "t"], ["1", "s1"], ["2", "s2"], ["4", "force"]]
    assert "mapmore init folder --target ... --inputs ..." in error.remedy
    # a column that counts its rows is no clock beside a clock
    error = refuse_choice(TABLE | {"n": titled(5, "n", np.arange(4.0))}, "a.csv", "folder", False)
    assert "counts the rows" not in error.message
    bare = {
        place: replace(one, title="", column=place, quantity="", unit="")
        for place, one in enumerate(TABLE.values())
    }
    for step, example, question in (
        (2.0, "pressure=2:bar,time=0:ms  (", "always increases"),
        (1.0, "pressure=2:bar --sample-time 10ms  (", "counts the rows"),
    ):
        clock = replace(bare[0], values=[step * np.arange(4.0)])
        error = refuse_choice(bare | {0: clock}, "a.csv", "folder", is_map=False)
        assert f"--target force=4:N --inputs {example}" in error.remedy
        assert question in error.message.splitlines()[1]
    error = refuse_choice(bare | {1: TABLE["s1"]}, "a.csv", "folder", is_map=False)
    assert "mapmore init folder --target ... --inputs ..." in error.remedy
    two = {place: bare[place] for place in (0, 4)}  # of two columns, the first is the input
    error = refuse_choice(two, "a.csv", "folder", is_map=False)
    assert "--target force=4:N --inputs pressure=0:bar  (" in error.remedy


def test_the_course_of_a_column_in_forty_signs():
    assert course([np.arange(8.0)]) == BLOCKS
    assert course([np.array([0.0, 0.0]), np.array([7.0])]) == "▁▁█"
    assert course([np.array([0.0, 0.49, 0.51, 7.0])]) == "▁▁▂█"
    assert len(course([np.arange(100.0)])) == 40
    assert len(course([np.arange(39.0)])) == 39
    assert course([np.ones(3)]) == "▁▁▁"
    assert course([np.arange(9.0)], 3) == "▁▅█"


@pytest.mark.parametrize(
    ("reply", "inputs"),
    [("", None), ("1,2", ["s1", "s2"]), ("-1", ["s2", "t"]), ("4", UsageError), ("5", UsageError)],
)
def test_the_inputs_are_those_of_a_reply_or_all_others_but_no_target(reply, inputs):
    columns = {name: NamedColumn(name) for name in ("s1", "s2", "t", "force", "x")}
    known = SimpleNamespace(columns=columns, targets=["force", "x"], inputs=["s1", "s2", "t"])
    table = TABLE | {"x": titled(5, "x", WAVE**2)}
    question = _inputs(Asked(table, ["run"], lambda _: known, Answers()))
    with pytest.raises(inputs) if inputs is UsageError else nullcontext():
        found = question.take(reply).inputs
        assert (found and [str(find(table, x.column, "").title) for x in found.values()]) == inputs


def test_a_question_is_asked_on_the_terminal_until_the_reply_is_valid(monkeypatch, capsys):
    options = (Option("7", "P  0 to 1", "▁█"), Option("12", "F"))
    question = Question("What is it?", options, "Write a number", partial(read_names, "the target"))
    monkeypatch.setenv("FORCE_COLOR", "1")
    replies = iter(["_", " 7 ", "b"])
    monkeypatch.setattr("builtins.input", lambda: next(replies))
    assert [ask(question), ask(question)] == [" 7 ", "b"]
    shown = capsys.readouterr()
    assert shown.out == ""
    plain = re.sub(r"\x1b\[[\d;]*m", "", shown.err)
    assert plain.count("What is it?\n   7  P  0 to 1\n      ▁█\n  12  F\n") == 2
    assert plain.count("Write a number > ") == 3
    assert plain.count("no column is named") == 1
    assert "\x1b[1;36m" not in shown.err  # numbers have no colour of their own


def test_the_end_of_the_input_is_an_empty_reply(monkeypatch, capsys):
    def end():
        raise EOFError

    monkeypatch.setattr("builtins.input", end)
    assert ask(Question("What?", (), "", read_group)) == ""
    assert "What?" in capsys.readouterr().err


def test_a_reply_can_be_taken_back(monkeypatch):
    """Questions that need not be asked are passed over on the way back."""

    def question(key):
        def made(asked):
            if key == "skipped":
                return None
            return Question(key, (), "", lambda reply: replace(asked.answers, **{key: reply}))

        return made

    monkeypatch.setattr(
        questions, "QUESTIONS", [question(key) for key in ("group", "skipped", "validate", "like")]
    )
    for replies, texts, found in (
        ("1 2 3", "group validate like", ("1", "2", "3")),
        ("1 b 2 3 4", "group validate group validate like", ("2", "3", "4")),
        ("1 2 b 3 4", "group validate like validate like", ("1", "3", "4")),
        ("b 1 2 3", "group group validate like", ("1", "2", "3")),
    ):
        said, asked = iter(replies.split()), []
        answers = interview(
            *(TABLE, [], lambda _: None, Answers()),
            lambda question, said=said, asked=asked: asked.append(question.text) or next(said),
        )
        assert asked == texts.split()
        assert (answers.group, answers.validate, answers.like) == found


@pytest.mark.parametrize(
    ("names", "words"),
    [(["s1_a", "s1_b", "s2_a"], ["names: 1", "names: 2"]), (["a", "b"], []), ([""], [])],
)
def test_words_in_names_are_offered_as_groups(names, words):
    known = SimpleNamespace(columns={"force": NamedColumn("force")}, targets=["force"])
    asked = Asked(TABLE, names, lambda _: known, Answers())
    question = _groups(asked)
    assert [one.text for one in question.options if not one.number] == words
    assert question.take("specimen").group == "specimen"
    assert question.take("").group is None
    assert _groups(replace(asked, answers=Answers(group="s"))) is None
    only = replace(asked, table={"force": TABLE["force"]})
    assert (_groups(only) is None) == (not words)


@pytest.mark.parametrize(("inputs", "names", "count"), [(1, 1, 21), (1, 2, 20), (2, 2, 21)])
def test_which_questions_are_asked_and_what_they_offer(inputs, names, count):
    named_ones = {name: NamedColumn(name) for name in ("s1", "s2", "force")}
    known = SimpleNamespace(
        columns=named_ones, targets=["force"], inputs=["s1", "s2"][:inputs], conditions=()
    )
    table, asked = TABLE | {"run": titled(5, "run", np.arange(count))}, []
    answers = Answers(target={"force": NamedColumn("force")})
    interview(
        *(table, ["run1", "run2"][:names], lambda _: known, answers),
        lambda question: asked.append(question) or "",
    )
    *of_inputs, held_out, groups = asked
    assert len(of_inputs) == inputs - 1
    assert [[one.number for one in question.options] for question in of_inputs] == [
        ["0", "1", "2", "5"]
    ] * len(of_inputs)
    assert ("every third recording" in held_out.form) is (names > 1)
    assert [one.number for one in held_out.options] == ["1", "2"][:inputs]
    assert ("5" in [one.number for one in groups.options]) is (count <= 20)
