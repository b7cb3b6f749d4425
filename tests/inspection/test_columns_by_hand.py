"""Every constant of what drafts take from the values of a column and from names, by hand."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from mapmore_cli.annexes.drafting.answers import Hold
from mapmore_cli.annexes.drafting.by_titles import kind_to_predict, known_by_titles, target_of
from mapmore_cli.annexes.drafting.clocks import PARTS, clock_in_parts
from mapmore_cli.annexes.drafting.columns import (
    SINCE_1970,
    TitledColumn,
    read_titles,
    unit_of_clock,
)
from mapmore_cli.annexes.drafting.draft import (
    HEAD,
    Draft,
    NamedColumn,
    Note,
    range_of,
    scaled,
    yaml_text,
)
from mapmore_cli.annexes.drafting.finding import find, listed
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.name_groups import files_for_tests, group_words, numbered_groups
from mapmore_cli.annexes.drafting.name_numbers import NameNumber, is_repeat, numbers_in
from mapmore_cli.annexes.drafting.names import (
    NamedCondition,
    offers_of,
    stem_of,
    told_by_names,
)
from mapmore_cli.annexes.drafting.page import drawing
from mapmore_cli.annexes.drafting.spelling import spelt, words
from mapmore_cli.annexes.drafting.understanding import _measured
from mapmore_cli.annexes.drafting.written_columns import with_strain
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.study.units import convert


def column(*values, title="", place=0, quantity="", unit="", **more):
    arrays = [np.asarray(one, dtype=float) for one in values]
    return TitledColumn(title or place, place, title, arrays, quantity, False, unit, "", **more)


@pytest.mark.parametrize(
    ("year", "within"), [(1999, False), (2000, True), (2099, True), (2101, False)]
)
def test_clocks_of_this_century_show_their_unit(year, within):
    start = float(np.datetime64(f"{year}-01-02", "s").astype(np.int64))
    for unit, second in {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}.items():
        clock = [np.array([start, start + 0.5]) * second]
        assert unit_of_clock(clock) == (unit if within else "s")
    assert unit_of_clock([np.array(SINCE_1970)]) == unit_of_clock([np.ones(1)]) == "s"
    step, (first, last) = 20.0 * np.arange(3), SINCE_1970
    clocks = (first + step, last - 40 + step, first - 20 + step, last - 20 + step)
    assert [unit_of_clock([clock]) for clock in clocks] == ["s", "s", "ms", "ms"]


@pytest.mark.parametrize(
    ("step", "unit"), [(1, "ms"), (100, "ms"), (101, "s"), (0.5, "s"), (1.5, "s"), (0, "s")]
)
def test_whole_numbers_that_rise_by_one_to_a_hundred_are_ms(step, unit):
    assert unit_of_clock([step * np.arange(5), np.zeros(1)]) == unit


def test_a_clock_may_step_back_once_in_a_hundred_and_may_seldom_repeat():
    long = np.arange(301.0)
    three, four = long.copy(), long.copy()
    three[[50, 100, 150]] -= 3
    four[[50, 100, 150, 200]] -= 3
    assert column(three, long).rises
    assert not column(long, four).rises
    assert column([0, 0, 1, 1, 2]).rises
    assert not column([0, 0, 0, 1, 1, 2]).rises
    assert not column([0, 1], [1]).rises
    assert not column([1, 1], [1, 1]).moves
    assert column([1, 1], [2, 2]).moves


@pytest.mark.parametrize("turn", [24, 60, 1000, 3600, 86400])
def test_where_a_clock_starts_again(turn):
    step = turn / 12
    clock = step * np.arange(30) % turn
    assert column(clock, clock[3:]).turn == turn
    assert column(clock[:5]).turn == column(clock - step).turn == 0
    assert column(clock, [turn, 0.0]).turn != turn
    # it begins at most one and a half steps above zero, and ends as near below the turn
    late = np.tile(np.arange(3.0, turn - 2, 2), 3)
    assert column(late).turn == turn
    assert column(np.tile(step * np.arange(1.6, 12), 3)).turn == 0
    assert column(np.tile(step * np.arange(0, 10.4), 3)).turn == 0


@pytest.mark.parametrize(("last", "turn"), [(60, 60), (59, 0)])
def test_a_clock_may_repeat_each_second(last, turn):
    assert column(np.tile(np.repeat(np.arange(last), 3), 3)).turn == turn


def test_counters_rise_by_one_and_blocks_have_five_rows():
    assert column([3, 4, 5], [0, 1]).counts
    assert not column([3, 4, 6]).counts
    assert not column([3, 4], [1]).counts
    number = np.repeat([1, 2, 3], 5)
    assert column(number).blocks == column(number - 1).blocks == 3
    assert column(number, number).blocks == 6
    assert column(number[:-1]).blocks == 0  # fewer rows on average
    for other in (number + 1, 2 * number - 1, np.roll(number, 1), np.ones(20)):
        assert column(other).blocks == 0
    assert column([1] * 9, [2] * 9).blocks == 0  # files tell them apart already
    assert column().blocks == 0
    assert column(number, quantity="force").blocks == column(number, unit="N").blocks == 0
    assert column(texts=["a", "b"], numbered=[np.repeat([1.0, 2.0], 5)]).blocks == 2


def test_parts_of_a_clock_stay_below_their_turns():
    seconds = np.arange(150.0) + 0.5
    table = {
        name: column(values, title=name, place=place)
        for place, (name, values) in enumerate(
            {"time hh": seconds // 3600, "time mm": seconds // 60, "time ss": seconds % 60}.items()
        )
    }
    assert clock_in_parts(table) == {"time hh": "h", "time mm": "min", "time ss": "s"}
    for title, faulty in {
        "time ss": seconds % 61,
        "time mm": seconds / 60,
        "time hh": np.full(150, -1.0),
    }.items():
        units = clock_in_parts({**table, title: column(faulty, title=title)}).values()
        assert [*units] == (["min", "s"] if title == "time hh" else [])
    # the seconds of a minute are not those of an hour
    assert not clock_in_parts({name: table[name] for name in ("time hh", "time ss")})
    assert not clock_in_parts(table | {"time ss": column(seconds[1:] % 60, title="time ss")})
    # no part starts again
    assert not clock_in_parts({name: column([0, 0, 1], title=name) for name in table})


@pytest.mark.parametrize(
    ("minutes", "seconds", "is_clock"),
    [
        (([0, 0, 1], [5, 5, 5]), ([58, 59, 0], [0, 1, 2]), True),
        (([0, 0, 1], [5, 5, 5]), ([58, 59, 0], [0, 60, 61]), False),
        (([0, 0, 1], [5, 5, 5.5]), ([58, 59, 0], [0, 1, 2]), False),
        (([0, 0, 1], [-5, -5, -5]), ([58, 59, 0], [0, 1, 2]), False),
        (([0, 0, 1],), ([29, 30, 0],), True),  # the largest part of a minute is at least its half
        (([0, 0, 1],), ([28, 29, 0],), False),
        (([0, 0, 1], [0, 0]), ([29, 30, 0], [1, 2, 3]), False),
    ],
)
def test_parts_of_a_clock_suit_each_other_in_every_file(minutes, seconds, is_clock):
    parts = {"mm": column(*minutes, title="mm"), "ss": column(*seconds, title="ss", place=1)}
    assert clock_in_parts(parts) == ({"mm": "min", "ss": "s"} if is_clock else {})
    # the last word of a title is the unit
    moved = {f"{key} of x": replace(one, title=f"{key} of x") for key, one in parts.items()}
    assert clock_in_parts(moved) == {}
    assert bool(clock_in_parts({**parts, "mm": replace(parts["mm"], title="t mm")})) == is_clock
    last = {**parts, "mm": replace(parts["mm"], title="mm x")}
    assert clock_in_parts(last) == {}


@pytest.mark.parametrize(("steps_back", "is_clock"), [(1, True), (2, False)])
def test_a_clock_in_parts_may_step_back_once_in_a_hundred(steps_back, is_clock):
    time = np.arange(101.0)
    time[[50, 70][:steps_back]] -= 5
    parts = {"mm": column(time // 60, title="mm"), "ss": column(time % 60, title="ss", place=1)}
    assert bool(clock_in_parts(parts)) == is_clock


@pytest.mark.parametrize(("coarser", "finer"), [*combinations(PARTS, 2)])
def test_a_part_restarts_when_the_part_before_it_increases(coarser, finer):
    turn = round(convert(1.0, coarser, finer))
    last, first = PARTS[coarser].split()[-1], PARTS[finer].split()[0]

    def found(finer_numbers):
        coarse = column([1_700_000_000.0, 1_700_000_001.0, 1_700_000_001.0], title=last)
        return [*clock_in_parts({last: coarse, first: column(finer_numbers, title=first)}).values()]

    assert found([turn - 1, 0, 1]) == [coarser, finer]
    assert found([turn, 0, 1]) == []
    assert found([turn - 1, turn - 0.5, 0]) == []  # it goes back while the other part stays


def test_reasons_why_columns_are_left_out():
    time = column(0.1 * np.arange(40), title="t", quantity="time", unit="s", place=9)
    wave = np.sin(np.arange(40.0))
    others = [
        (column(title="words", place=1), "holds no numbers"),
        (column(np.ones(40), title="flat", place=2), "never changes"),
        (column(7.0 * np.arange(40), title="t2", unit="ms", place=3), "second clock"),
        (column(wave, title="simulated y", place=4), "was computed"),
        (column(np.repeat(np.arange(8), 5), title="red run", place=5), "numbers recordings"),
        (column(np.arange(40), title="n", place=6), "counts its rows"),
        (column(0.3 * np.arange(40), place=7), "always increases"),
        (column(wave + 1, title="a", place=8), ""),
        (column(wave + 1, title="b", place=10), "is a linear function of a"),
    ]
    columns, left_out = known_by_titles({one.column: one for one, _ in [(time, ""), *others]})
    assert [*columns] == ["time", "a"]
    assert [*left_out] == [one.column for one, why in others if why]
    for one, why in others:
        assert why in left_out.get(one.column, "")


CLOCK = column(0.1 * np.arange(40), title="t", quantity="time", unit="s", place=0)
WAVE = np.sin(np.arange(40.0))


def noisy(title, quantity="", unit="", place=1):
    """A column like no other."""
    values = np.random.default_rng(place).normal(size=40)
    return column(values, title=title, quantity=quantity, unit=unit, place=place)


def plain(title, quantity, unit="", place=1):
    return replace(noisy(title, quantity, unit, place), plain=True)


def known(*columns):
    return known_by_titles({one.column: one for one in columns})


@pytest.mark.parametrize(
    ("values", "why"),
    [
        (np.tile(np.arange(12) * 5.0, 3), "restarts from zero at 60; if it is the clock"),
        (np.append(np.arange(5.0), 0), "its clock is set back"),
        (np.array([0.0, 0, 0, 1, 0]), "its clock is set back"),
        (np.array([0.0, 0, 0, 0, 1, 0]), "repeats most of its values"),
    ],
)
def test_why_a_time_is_no_clock(values, why):
    time = column(values, title="time", quantity="time", unit="s")
    assert known(time, noisy("a"))[1]["time"].startswith(why)
    if "repeats" in why:  # in one of two files
        time = replace(time, values=[values, np.array([0.0, 1, 2, 0])])
        assert known(time, noisy("a"))[1]["time"].startswith(why)


def test_a_clock_in_parts_is_one_quantity_and_no_other_column_is_a_clock():
    seconds = np.arange(150.0) + 0.5
    parts = [column(seconds // 60, title="mm"), column(seconds % 60, title="ss", place=1)]
    other = column(seconds, title="t", quantity="time", unit="s", place=2)
    columns, left_out = known(*parts, other, noisy("x", place=3))
    assert [*columns] == ["time", "x"]
    assert columns["time"].parts == {"mm": "min", "ss": "s"}
    assert (columns["time"].column, left_out) == ("mm", {"t": "is a second clock"})


def test_of_two_copies_the_one_whose_title_says_more_is_kept():
    orders = [
        [("u", "", "", False), ("F", "force", "", False)],
        [("F", "force", "", False), ("F N", "force", "N", False)],
        [("F of", "force", "N", False), ("F", "force", "N", True)],
        [("d", "displacement", "mm", True), ("eps", "strain", "mm", True)],
        [("l", "length", "mm", True), ("d", "displacement", "mm", True)],
    ]
    for said in orders:
        for order in (said, said[::-1]):
            copies = [
                replace(column(k + WAVE, title=title, quantity=quantity, unit=unit), plain=is_plain)
                for k, (title, quantity, unit, is_plain) in enumerate(order)
            ]
            _, left_out = known(*copies)
            assert left_out == {said[0][0]: f"is a linear function of {said[1][0]}"}
    # a force and a position that look alike are both kept
    force, strain = (column(WAVE, title=one, quantity=one, unit="1") for one in ("force", "strain"))
    assert known(force, strain)[1] == {}


@pytest.mark.parametrize(
    ("columns", "names"),
    [
        ([plain("F", "force")], ["force"]),
        ([plain("F", "load")], ["force"]),  # who tests materials says load
        ([plain("F", "force"), plain("L", "load", place=2)], ["force", "load"]),
        ([plain("x", "displacement")], ["x"]),  # an x without a unit says nothing
        ([plain("x", "displacement", "mm")], ["displacement"]),
        ([plain("strain", "strain")], ["strain"]),
        ([plain("P1", "pressure"), plain("P2", "pressure", place=2)], ["P1", "P2"]),
        ([plain("P", "pressure"), noisy("pressure b", "pressure", "bar", 2)],
         ["pressure", "pressure_b"]),
        ([noisy("force left", "force", "N"), noisy("P", "pressure", "bar", 2)], ["force", "P"]),
        ([noisy("force left", "force")], ["force_left"]),
        ([noisy("a", place=4), noisy("time", place=5)], ["a", "time_5"]),
        ([noisy("a"), noisy("a ", place=6)], ["a", "column_6"]),
    ],
)  # fmt: skip
def test_a_quantity_has_the_plainest_title(columns, names):
    assert [*known(CLOCK, *columns)[0]] == ["time", *names]


@pytest.mark.parametrize(
    ("name", "titled", "kind"),
    [
        *(("force", None, "force"), ("F_left", None, "force"), ("pressure", None, "drive")),
        *(("strain", None, "position"), ("colour", None, "")),
        ("a", noisy("a"), ""),
        ("a", column([1, 2, 1, 2], title="a"), "drive"),  # a switch
        ("F", column([1, 2, 1, 2], title="F", quantity="force"), "unclear"),
        *(("P1", noisy("P1", "pressure"), "drive"), ("Pab", noisy("Pab", "pressure"), "unclear")),
        ("u", noisy("u", "input"), "drive"),
        *(("F", noisy("F", "load"), "unclear"), ("F", plain("F", "load"), "force")),
    ],
)  # fmt: skip
def test_what_a_title_says_of_prediction(name, titled, kind):
    assert kind_to_predict(name, titled) == kind


@pytest.mark.parametrize(
    ("kinds", "driven", "target"),
    [
        *(("force", False, None), ("force", True, 0), ("force drive", False, 0)),
        *(("force position", False, 0), ("force force drive", False, None)),
        *(("position", False, None), ("position drive", False, 0), ("position", True, 0)),
        *(("position position drive", False, None), ("drive", True, None)),
        *((", drive", False, 0), (",", False, None), (",", True, None), (", , drive", False, None)),
        *((", force drive", False, None), (", position drive", False, None)),
        ("force unclear drive", False, None),
    ],
)
def test_what_is_predicted(kinds, driven, target):
    named = {str(place): kind.strip(",") for place, kind in enumerate(kinds.split(" "))}
    assert target_of(named, driven) == (None if target is None else str(target))


def test_numbers_in_names_have_words_units_and_signs():
    read = numbers_in("runA_P=1,5bar_20.5mm_x-3")
    assert read == [
        NameNumber("P", "bar", 1.5, True),
        NameNumber("", "mm", 20.5),
        NameNumber("x", "", 3.0),
    ]
    assert [one.shown for one in read] == ["P 1.5bar", "20.5mm", "x 3"]
    assert [one.quantity for one in read] == ["pressure", "length", ""]
    for word, unit, is_set, quantity in [
        *(
            ("load", "g", False, "load"),
            ("", "kpa", False, "pressure"),
            ("P", "", True, "pressure"),
        ),
        *(("P", "", False, ""), ("run", "", False, ""), ("run", "mm", False, "length")),
        *(("stretch", "mm", False, "stretch"), ("s", "%", False, "percent"), ("", "", False, "")),
    ]:
        assert NameNumber(word, unit, 1.0, is_set).quantity == quantity, (word, unit)
    assert all(map(is_repeat, ("run", "Muscle", "no", "ID")))
    assert not any(map(is_repeat, ("a", "v", "load", "")))


def test_conditions_are_in_the_units_of_models():
    assert NamedCondition("pressure", "bar", (1.0, 2.5)).in_model_units == [100, 250]
    assert NamedCondition("stiffness", "", (1.0, 2.5)).in_model_units == [1, 2.5]
    found, remarks = told_by_names(["a_100kPa_run1", "a_200kPa_run2", "a_run3"])
    assert found == []
    assert remarks == ["a 100kpa ...", "run 1 ..."]
    (found,), remarks = told_by_names(["P=100", "P=200", "P=400"])
    assert (found.quantity, found.values, found.sure) == ("pressure", (100, 200, 400), True)
    assert (told_by_names(["P=100", "P=200"], known=["pressure"])) == ([], [])


@pytest.mark.parametrize(
    ("numbers", "means", "wave", "measured"),
    [
        ((1, 2, 3), (0.1, 0.2, 0.3), 0.02, True),
        ((1, 2, 3), (0.1, 0.2, 0.3), 0.03, False),  # moves about as much as it is set
        ((1, 2, 3), (-0.1, -0.2, -0.3), 0.0, True),
        ((1, 2, 3), (0.1, 0.2, 0.32), 0.0, False),
        ((1, 2, 2), (0.1, 0.2, 0.2), 0.0, False),
        ((1, 2), (0.1, 0.2), 0.0, False),
        ((1, 2, 3), (0, 4, 8), 0.9, True),
        ((1, 2, 3), (0, 4, 8), 1, False),
        ((1, 2, 3), (0, 4, 8), np.array([0, 1, 0]), False),  # one of them moves as much
    ],
)
def test_set_points_in_names_of_what_a_column_measures(numbers, means, wave, measured):
    ends = zip(means - np.broadcast_to(wave, len(means)), means + np.asarray(wave), strict=True)
    table = {"x": column([5, 6], [6, 5]), "y": column(*ends)}
    name = "y" if measured else None
    assert _measured(NamedCondition("bag", "", numbers), table) == name
    table["y"] = replace(table["y"], quantity="force", unit="N")
    many = tuple(np.repeat(numbers, 2))  # of six files, every second is looked at
    assert _measured(NamedCondition("load", "gf", many), table) == name
    assert (
        _measured(NamedCondition("bag", "", numbers), table) is None
    )  # the force may be predicted


@pytest.mark.parametrize(
    ("names", "words_of_offer"),
    [
        (["P100", "P200", "P400", "P500", "P600"], "P100 P200 P400 P500 ..."),
        (["P100_s1", "P200_s1", "P100_s2", "P200_s2"], "`--hold pressure=P:kPa`"),
        (["F10", "F20", "F50"], "`--hold force=F:N`"),
        (["P500", "P200", "P100"], "P100 P200 P500 ..."),
        (["P1", "P2", "P3"], ""),
        (["P100", "P200", "Q"], ""),
        (["P100kPa", "P200kPa"], ""),
        (["mark100", "mark200"], ""),
    ],
)
def test_letters_with_numbers_are_offered_as_levels(names, words_of_offer):
    offers = [*offers_of(names)]
    assert len(offers) == bool(words_of_offer)
    assert all(words_of_offer in one for one in offers)


def test_groups_by_the_number_behind_their_word_then_the_letter_then_the_words():
    assert group_words(["muscle 2 run1", "muscle_B run2"], "muscle") == ["2", "B"]
    assert group_words(["s1_run1", "s2_run1"], "sample") == ["1", "2"]
    assert group_words(["soft_run1_5kPa", "stiff_run2_5kPa"], "muscle") == ["soft__", "stiff__"]
    assert group_words(["10cm_1", "20cm_1"], "muscle") == ["10cm_", "20cm_"]
    assert group_words(["7", "8"], "muscle") == ["7", "8"]
    assert group_words(["muscle 1 run2", "arm run3"], "muscle") == ["muscle 1 ", "arm "]
    assert group_words(["muscle 1 a", "muscle 1 b"], "muscle") == ["muscle 1 a", "muscle 1 b"]
    for first, other in (("red", "blue"), ("S1", "S12"), ("Sample 1", "Sample 2")):
        for form in ("{}_pull_{}bar", "pull_{}_{}bar"):
            groups = group_words(
                [form.format(word, bar) for word in (first, other) for bar in "12"], "specimen"
            )
            assert [groups.index(one) for one in groups] == [0, 0, 2, 2]
    groups = numbered_groups(["s7", "s5", "s7"], "sample")
    assert (groups.values, groups.sure) == ((2, 1, 2), True)


def test_held_out_files_are_named_by_what_they_are_for():
    files = [Path(one) for one in ("a_train.csv", "b_training.csv", "a_test.csv", "val-2.csv")]
    assert files_for_tests(files) == ["a_test.csv", "val-2.csv"]
    assert files_for_tests(files[:2]) == files_for_tests(files[2:]) == []
    for other in ("c.csv", "train_test.csv"):
        assert files_for_tests([*files, Path(other)]) == []
    assert stem_of("a/b.1.csv.gz") == "a/b.1"


def test_letters_of_other_scripts_are_spelt():
    assert spelt("Kraft äöß é") == "Kraft aoss e"
    assert [spelt(one) for one in ("θ1", "Πίεση", "θεση", "д", "力")] == [
        *("theta1", "piese", "these", "de", "u529b"),
    ]
    assert words("Fx_10 [kPa]") == ["fx", "10", "kpa"]


def test_numbers_of_a_draft_have_ten_digits_and_notes_stand_beside_or_above():
    assert str(Note("\x1b[2J\nb")) == "# \\x1b[2J b"  # no command to a terminal
    notes = {("a",): Note("why"), ("b",): Note("x" * 100), ("c",): Note("y " * 60, sure=False)}
    spec = {"a": 0.1 + 0.2, "b": [2.0, 1 / 3], "c": "z" * 26, "name": True}
    text = yaml_text(spec, notes, "#").splitlines()
    assert text[1:3] == ["name: true", "a: 0.3  # why"]
    assert text[3] == f"b: [2, 0.3333333333]  # {'x' * 100}"
    assert [line[:9] for line in text[4:]] == ["# CHECK: ", "c: zzzzzz"]
    # 132 characters fit in a line, 133 do not
    for more, lines in ((0, 1), (1, 2)):
        note = {("a",): Note("x" * (132 - len("a: 1  # ") + more))}
        assert len(yaml_text({"a": 1}, note, "#").splitlines()) == 1 + lines


def test_columns_of_a_draft_name_only_what_is_unusual():
    assert NamedColumn("P").as_spec() == {"column": "P"}
    assert NamedColumn("P", "1").as_spec() == {"column": "P"}
    assert NamedColumn("P %", "1").as_spec() == {"column": "P %", "unit": "1"}
    full = NamedColumn("P", "kPa", scale=2.0, offset=1.0, texts=True).as_spec()
    assert full == {"column": "P", "unit": "kPa", "scale": 2.0, "offset": 1.0, "texts": True}
    assert NamedColumn(3).refers_to("3")
    assert not NamedColumn(3, is_called=True).refers_to("3")
    assert not NamedColumn("3").refers_to("4")
    assert range_of([np.array([1.0, -2.0]), np.array([3.14159])], "N") == "-2 to 3.142 N"
    np.testing.assert_array_equal(scaled(np.array([2.0, 4.0, 3.0])), [0, 1, 0.5])
    np.testing.assert_array_equal(scaled(np.ones(2)), [0, 0])


def test_a_draft_has_sections_keys_and_notes():
    empty = Draft({"name": "a", "data": {"files": ["x"]}, "target": "static"}, tips=("try b", "c"))
    assert (empty.name, empty.output, empty.open, empty.bad_files) == ("a", "force", {}, "")
    draft = empty.with_data("levels", {"of": "P"}, "by name", sure=False)
    draft = draft.with_section("units", {"P": "bar"}, "titles").with_data("skip_bad_files", True)
    assert draft.spec["data"] == {"files": ["x"], "levels": {"of": "P"}, "skip_bad_files": True}
    assert draft.open == {("data", "levels"): Note("by name", sure=False)}
    assert draft.notes["units",] == Note("titles")
    assert empty.with_data("files", ["y"], "why").open == {}
    assert draft.bad_files == ""
    for sure, files in ((False, "b.csv"), (True, "")):
        assert draft.noted(("data", "skip_bad_files"), "b.csv", sure).bad_files == files
    assert draft.noted(("name",), None) is draft
    outputs = [draft.with_section("target", one).output for one in ("static", "damping", "strain")]
    assert outputs == ["force", "damping", "strain"]
    nested = draft.noted(("data", "levels", "of"), "why")
    rest = nested.without_data("levels")
    assert (rest.data, [*rest.notes]) == ({"files": ["x"], "skip_bad_files": True}, [("units",)])
    assert (empty.data, empty.notes) == ({"files": ["x"]}, {})  # each change makes a copy
    modeline, head, *lines = draft.text().splitlines()
    assert modeline.startswith("# yaml-language-server")
    assert head == HEAD
    assert lines == [
        *("# CHECK: try b", "# CHECK: c", "name: a", "data:", "  files: [x]"),
        *("  levels: {of: P}  # CHECK: by name", "  skip_bad_files: true"),
        *("units: {P: bar}  # titles", "target: static"),
    ]


def test_long_values_and_columns_of_a_draft_have_lines_of_their_own():
    columns = {"P": {"column": "p" * 60, "unit": "bar"}, "F": {"column": "f"}}
    spec = {"extra": 1, "data": {"columns": columns, "files": [f"{k:020}" for k in range(9)]}}
    notes = {("data", "columns", "F"): Note("why"), ("data", "files"): Note("w\n x", sure=False)}
    lines = yaml_text(spec, notes, "#").splitlines()
    assert lines[1:3] == ["data:", "  columns:"]
    assert lines[3] == "    P:"
    assert lines[4].startswith("      column: pppp")
    (force,) = (line for line in lines if line.startswith("    F:"))
    assert force == "    F: {column: f}  # why"
    (first,) = (place for place, line in enumerate(lines) if line.startswith("  files:"))
    assert lines[first].endswith("# CHECK: w x") or lines[first - 1] == "  # CHECK: w x"
    assert lines[-1] == "extra: 1"


def test_where_a_column_is_read():
    parts = NamedColumn("h", parts={"h": "h", 3: "min"})
    assert parts.as_spec() == {"columns": ["h", 3], "format": "h min"}
    assert (parts.places, NamedColumn("P").places) == ({"h", 3}, {"P"})


def test_a_drawing_of_a_column_is_scaled_to_its_box():
    y = [np.array([1.0, 3.0]), np.array([2.0])]
    assert 'd="M0.0 200.0 L200.0 0.0 L400.0 100.0"' in drawing(y)
    assert 'd="M400.0 200.0 L0.0 0.0 L0.0 100.0"' in drawing(y, [np.array([7.0, 5.0, 5.0])])
    assert 'viewBox="-2 -2 404 204"' in drawing(y)
    for count, points in ((600, 600), (601, 600)):
        path = drawing([np.arange(float(count))]).partition("d=")[2]
        assert path.count(" L") == points - 1
        assert path.startswith('"M0.0 200.0')
        assert path.endswith('L400.0 0.0"/></svg>')


@pytest.mark.parametrize(
    ("values", "scaling", "rule"),
    [
        ([0.0, 3.0], {}, "displacement/0.2"),
        ([-3.0, 2.0], {}, "-displacement/0.2"),
        ([-2.0, 2.0], {}, "displacement/0.2"),
        ([-2.0, -2.0], {}, "-displacement/0.2"),
        ([0.0, 3.0], {"scale": -1.0}, "-displacement/0.2"),
        ([0.0, 3.0], {"offset": -2.0}, "-displacement/0.2"),
    ],
)
def test_a_displacement_contracts_where_it_mostly_moves(values, scaling, rule):
    entry = {"column": "d", **scaling}
    draft = Draft({"data": {"columns": {"displacement": entry}}}, raw={"d": [np.array(values)]})
    made, measured = with_strain(draft, 0.2, {})
    assert (made.data["derive"], measured) == ({"strain": rule}, "displacement")
    assert not made.notes["data", "derive"].sure
    lengths = Draft({"data": {"columns": {"length": {"column": "l"}}}})
    assert with_strain(lengths, 0.2, {})[0].data["derive"] == {"strain": "(0.2 - length)/0.2"}
    assert with_strain(lengths, 0.2, {"strain": [1.0]})[1] == ""


def titled(*titles, units=(), **values):
    """Columns as they are read from files whose titles are these."""
    layout = FileLayout("csv", titles, titles, {}, tuple(units), ())
    raw = {title: [np.array([0.0, 1.0, 2.0])] for title in titles} | values
    return read_titles(layout, raw)


@pytest.mark.parametrize(
    ("title", "line", "quantity", "unit", "source"),
    [
        ("P [bar]", "", "pressure", "bar", "title"),
        ("force", "N", "force", "N", "the file's units"),
        *(("F [V]", "", "", "V", "title"), ("pressure", "", "pressure", "", "")),
        *(("ms", "", "", "ms", "title"), ("Angle_deg", "", "", "deg", "title")),
        ("strain [%]", "1", "strain", "1", "the file's units"),
        *(("x", "", "displacement", "", ""), ("abc", "", "", "", "")),
        ("力（N）", "", "force", "N", "title"),
    ],
)
def test_titles_and_units_of_files(title, line, quantity, unit, source):
    (one,) = titled(title, units=(line,)).values()
    assert (one.quantity, one.unit, one.source) == (quantity, unit, source)
    assert quantity or not one.plain


@pytest.mark.parametrize(
    ("title", "name"),
    [
        *(
            ("Angle_deg", "Angle"),
            ("angle [deg]", "angle"),
            ("s[12]", "s_12"),
            ("9 a", "column_9_a"),
        ),
        *(("", "column_3"), ("time", "time_3"), ("a" * 41, "a" * 40), ("strain", "strain_3")),
    ],
)
def test_names_are_made_of_titles(title, name):
    assert column([1.0], title=title, place=3).name == name


def test_columns_become_quantities_with_reasons():
    pressure = column([0.0, 2.0], title="P", quantity="pressure")
    sure = replace(pressure, unit="bar").as_quantity("pressure")
    assert (sure.unit, sure.why, sure.sure) == ("bar", "title; 0 to 2 bar", True)
    asked = pressure.as_quantity("pressure")
    assert (asked.unit, asked.sure) == ("kPa", False)
    assert "its title gives no unit: is it kPa?" in asked.why
    strain = column([0.0, 0.2], title="eps", quantity="strain").as_quantity("strain")
    assert (strain.unit, strain.sure) == ("1", True)
    other = column([0.0, 0.2], title="colour").as_quantity("colour")
    assert (other.unit, other.sure) == ("1", True)
    clock = column(np.arange(5)).as_quantity("time")
    assert (clock.unit, clock.why[:23]) == ("ms", "it always increases: is")
    assert not column([0, -12.6], unit="rad").as_quantity("bend").sure  # more than two turns
    assert column([0, 4 * np.pi], unit="rad").as_quantity("bend").sure
    texts = column(title="day", texts=("a", "b")).as_quantity("day")
    assert (texts.unit, texts.texts) == ("1", True)
    assert column(title="day", texts=("a", "b", "c")).described == "day  3 texts, a to c"
    assert pressure.described == "P  0 to 2"
    assert [*map(len, (column().kinds, pressure.kinds))] == [0, 2]
    assert not column().moves
    assert column(texts=("Mean", "a", "SD")).summaries == ["Mean", "SD"]
    unnamed = column([0.0], place=4)
    assert (unnamed.called, unnamed.asked_for) == ("column 4", "4")
    assert column(title="a b").asked_for == "'a b'"


def test_columns_are_found_by_name_place_title_then_a_word():
    table = titled("Force left", "Force right", "x", "2")
    asked = {"Force left": 0, "x": 2, 1: 1, "right": 1, "force  RIGHT": 1, "2": 3}
    asked |= {"left force": 0}  # all words in another order
    assert {wanted: find(table, wanted, "--x").place for wanted in asked} == asked
    with pytest.raises(UsageError, match="--x: several columns are called force") as error:
        find(table, "force", "--x")
    assert "Force left, Force right" in error.value.remedy
    assert "x" not in error.value.remedy.partition(": ")[2]
    with pytest.raises(UsageError, match="--x: no column of numbers is called y") as error:
        find(table, "y", "--x")
    assert "Force left, Force right, x, 2" in error.value.remedy
    empty = {**table, "day": column(title="day", place=4)}
    with pytest.raises(UsageError, match="no column of numbers is called day"):
        find(empty, "day", "--x")
    with pytest.raises(UsageError, match="day has no numbers, and no text"):
        find(empty, "day", "--x", texts=True)
    with pytest.raises(UsageError, match="no column is called y"):
        find(empty, "y", "--x", texts=True)
    named = {**empty, "day": column(title="day", place=4, texts=("a",))}
    assert find(named, "day", "--x", texts=True).place == 4
    assert [*listed(named, but=["x"])] == [0, 1, 3]


def test_a_clock_of_several_files_must_be_of_this_century_in_all():
    start = 1.7e9
    assert unit_of_clock([np.array([start * 1e3]), np.array([start * 1e3 + 5])]) == "ms"
    assert unit_of_clock([np.array([start * 1e3, start * 1e3 + 0.5]), np.array([0.0])]) == "s"
    assert unit_of_clock([np.array([start * 1e3]), np.array([5e12, 5e12 + 0.5])]) == "s"


@pytest.mark.parametrize(
    ("name", "word", "unit", "values"),
    [
        *(("mass", "m", "g", (5, 7, 9)), ("mass", "", "N", (5, 7, 9)), ("mas", "", "", None)),
        *((name, "", "", (1, 1, 4)) for name in ("turn", "tur", "turning")),
        *(("t", "", "", None), ("mass", "urn", "", (1, 1, 4)), ("mass", "x", "", None)),
        *(("other", "", "kPa", None), ("other", "", "kgf", (5, 7, 9))),
    ],
)
def test_a_person_names_numbers_by_word_quantity_or_unit(name, word, unit, values):
    names = ["m5g_turn1", "m7g_turn1", "m9g_turn4"]
    if values is None:
        with pytest.raises(UsageError, match=f"--hold: no column is called {name}, and no number"):
            told_by_names(names, Hold(name, word, unit))
        return
    conditions, _ = told_by_names(names, Hold(name, word, unit))
    assert {one.quantity: one.values for one in conditions}[name] == values


def test_a_name_without_a_number_means_zero():
    ((found,), _) = told_by_names(["kg2", "kg5", "empty"], Hold("load", "kg", "N"))
    assert (found.values, found.sure) == ((2, 5, 0), False)
    assert "0 for 'empty', which has no number" in found.why
    assert told_by_names(["a", "b"], Hold("none")) == ([], [])
    with pytest.raises(UsageError, match="no number in the names"):  # it is equal in all names
        told_by_names(["load3_a", "load3_b"], Hold("load"))
