"""What a draft proposes beside its settings, by hand: tips, sessions, and answers that are divided
between two logs.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.annexes.drafting.answers import Answers, Hold
from mapmore_cli.annexes.drafting.columns import TitledColumn
from mapmore_cli.annexes.drafting.draft import Draft, NamedColumn
from mapmore_cli.annexes.drafting.proposal import (
    _Proposal,
    _shared_out,
    _with_measured_strain,
    _with_sessions,
)
from mapmore_cli.annexes.drafting.understanding import Understood

ROWS = np.arange(200)
WAVE = np.sin(ROWS)


def titled(title, *values, place=0, quantity="", **more):
    series = [np.asarray(x, dtype=float) for x in values]
    return TitledColumn(title, place, title, series, quantity, True, "", "", **more)


def table_of(*columns):
    return {one.column: one for one in columns}


U, Y, RUN = titled("u", WAVE), titled("y", WAVE**2), titled("run", np.repeat([1, 2, 3, 4], 50))
KNOWN = Understood(
    {"u": NamedColumn("u"), "y": NamedColumn("y")}, ["y"], ["u"], [], "", {}, None, []
)
DRAFT = Draft({"data": {"columns": {}}})


def tips(*columns, answers=None, known=KNOWN, draft=DRAFT, names=(), is_map=False):
    study = SimpleNamespace(names=names, layout=SimpleNamespace(is_map=is_map))
    table = table_of(U, Y, *columns)
    return [*_Proposal(study, None, table, answers or Answers(), known)._tips(draft)]


@pytest.mark.parametrize(
    ("rows", "more", "is_asked"),
    [
        *((200, {}, True), (199, {}, False), (200, {"answers": Answers(no_clock=True)}, False)),
        (200, {"draft": DRAFT.with_data("columns", {"time": {}})}, False),
        (200, {"draft": DRAFT.with_data("levels", {})}, False),
        (200, {"draft": DRAFT.with_data("sample_time", 0.1)}, False),
        (200, {"is_map": True}, False),
    ],
)
def test_a_long_recording_without_a_clock_or_levels_is_asked_for_the_time_between_rows(
    rows, more, is_asked
):
    table = table_of(*(replace(one, values=[one.values[0][:rows], WAVE[:9]]) for one in (U, Y)))
    study = SimpleNamespace(names=(), layout=SimpleNamespace(is_map=more.get("is_map", False)))
    proposal = _Proposal(study, None, table, more.get("answers", Answers()), KNOWN)
    found = [*proposal._tips(more.get("draft", DRAFT))]
    assert [tip.partition(",")[0] for tip in found] == ["no column is a clock"] * is_asked


def test_a_clock_that_runs_backwards_is_named_in_the_tip():
    (tip,) = tips(titled("t", ROWS[::-1], quantity="time"))
    assert tip.startswith("t runs backwards")
    (tip,) = tips(titled("n", ROWS[::-1]), titled("t", ROWS, quantity="time"))
    assert tip.startswith("no column is a clock")


def test_blocks_of_rows_are_proposed_as_recordings_unless_they_have_a_purpose():
    clock = Answers(no_clock=True)
    (tip,) = tips(RUN, answers=clock)
    assert tip.startswith("each value of run is in one block of rows; if each of the 4 blocks")
    assert "`--recordings run`" in tip
    assert tips(RUN, answers=replace(clock, recordings=("run",))) == []
    as_input = replace(KNOWN, columns=KNOWN.columns | {"run": NamedColumn("run")})
    assert tips(RUN, answers=clock, known=replace(as_input, group="run")) == []
    named = {"run": NamedColumn("run")}
    assert len(tips(RUN, answers=clock, known=as_input)) == 1
    known = replace(as_input, inputs=["u", "run"])
    for key in ("inputs", "columns"):  # a person named it
        assert tips(RUN, answers=replace(clock, **{key: named}), known=known) == []
    assert len(tips(RUN, answers=replace(clock, target=named), known=known)) == 1


def test_rows_of_means_are_told_unless_their_column_is_read():
    texts = titled("day", texts=("a", "Mean", "SD"))
    (tip,) = tips(texts, answers=Answers(no_clock=True))
    assert tip.startswith("rows with Mean, SD in day are read as samples")
    read = replace(KNOWN, columns=KNOWN.columns | {"day": NamedColumn("day")})
    assert tips(texts, answers=Answers(no_clock=True), known=read) == []


def test_numbers_behind_a_letter_in_names_are_offered_unless_a_quantity_was_held():
    names = ["P100", "P300"]
    (tip,) = tips(names=names, answers=Answers(no_clock=True))
    assert "--hold pressure=P:kPa" in tip
    assert tips(names=names, answers=Answers(no_clock=True, hold=Hold("none"))) == []


@pytest.mark.parametrize(
    ("effects", "group", "groups", "is_asked"),
    [
        (["gain"], "day", {"of": "day", "gain": True}, False),
        (["offset", "gain"], "day", {"of": "day", "offset": True, "gain": True}, False),
        ([], "day", None, False),
        (["gain"], None, None, True),
        ([], None, None, True),
    ],
)
def test_recordings_that_differ_with_equal_inputs_may_be_sessions(effects, group, groups, is_asked):
    for is_large in (False, True):
        apart = SimpleNamespace(
            effects=effects, is_large=is_large, words=lambda: "a differs from b"
        )
        draft = _with_sessions(DRAFT, apart, group)
        assert draft.data.get("groups") == groups
        assert (("data", "reader") in draft.notes) == is_asked
        if is_asked:
            note = draft.notes["data", "reader"]
            line = "".join(f", {effect}: true" for effect in effects)
            assert note.why.startswith("a differs from b; do they belong to different sessions?")
            assert f"`groups: {{of: session{line}}}`" in note.why
            assert note.sure != is_large
    assert _with_sessions(DRAFT, None, group) is DRAFT


def test_columns_that_a_person_names_belong_to_the_log_that_has_them():
    here, there = NamedColumn("u"), NamedColumn("p")
    assert _shared_out({"a": here, "b": there}, table_of(U, Y)) == ({"a": here}, {"b": there})


@pytest.mark.parametrize(
    ("titles", "inputs", "length", "names"),
    [
        (("length", "displacement"), {"strain": "strain", "u": "u"}, 0.1, ["u", "length"]),
        (("displacement",), {"strain": "strain"}, 0.1, ["displacement"]),
        (("displacement",), {"strain": "strain"}, None, ["strain"]),
        (("displacement",), {"u": "u"}, 0.1, ["u"]),
        (("displacement", "strain"), {"strain": "strain"}, 0.1, ["strain"]),
        (("displacement",), {"strain": "y"}, 0.1, ["strain"]),  # a person calls `y` a strain
        ((), {"strain": "strain"}, 0.1, ["strain"]),
    ],
)
def test_an_input_strain_without_a_column_is_computed_from_what_was_measured(
    titles, inputs, length, names
):
    columns = (
        replace(titled(title, WAVE + np.cos((k + 2) * ROWS), quantity=title, place=k), unit="mm")
        for k, title in enumerate(titles)
    )
    said = {name: NamedColumn(column) for name, column in inputs.items()}
    found = _with_measured_strain(Answers(inputs=said, length=length), table_of(U, Y, *columns))
    assert [*found.inputs] == names
