"""Columns are what titles, units and a person say; names of files tell what was held. Nothing is
guessed from the size of values.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import drafted, write

from mapmore_cli.annexes.drafting.answers import Answers, read_columns, read_hold
from mapmore_cli.annexes.drafting.columns import TitledColumns, named_by_titles, target_of
from mapmore_cli.annexes.drafting.draft import NamedColumn
from mapmore_cli.annexes.drafting.filenames import held_in_names, number_in, read_names, words_of
from mapmore_cli.annexes.drafting.groups import Group
from mapmore_cli.annexes.drafting.preview import Preview
from mapmore_cli.annexes.drafting.start import start
from mapmore_cli.checking.names import read_label
from mapmore_cli.domain.errors import UsageError

T = 0.01 * np.arange(400)
WAVES = [np.sin(speed * T) for speed in (3.0, 4.1, 5.7, 7.9, 9.3)]


@pytest.mark.parametrize(
    ("titles", "quantity", "unit"),
    [
        ("pressure_kPa|mpr_sensor_kPa", "pressure", "kPa"),
        ("P [bar]", "pressure", "bar"),
        ("Pressure (psi)", "pressure", "psi"),
        ("pressureMPa", "pressure", "MPa"),
        ("cmd_kPa|desired|simulated force|u_V", "input", None),
        ("t", "time", None),
        ("time_ms", "time", "ms"),
        ("Time (s)", "time", "s"),
        ("eps", "strain", None),
        ("strain_pct|contraction [%]", "strain", "%"),
        ("contraction_frac", "strain", "1"),
        ("F", "force", None),
        ("force_N_total", "force", "N"),
        ("Load (kN)", "load", "kN"),
        ("position_mm", "displacement", "mm"),
        ("temperature||42|y_V", None, None),
    ],
)
def test_titles_say_quantities_and_units(titles, quantity, unit):
    for title in titles.split("|"):
        label = read_label(title)
        assert (label and label.quantity) == quantity, title
        assert unit is None or (label is not None and label.unit == unit), title


@given(st.text())
def test_any_name_of_a_column_or_a_file_can_be_read(name):
    read_label(name)
    read_names([name + ".csv", name + "_1.csv"])


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        ("t_s,P [bar],eps,F_N", "time:s pressure:bar strain:1? force:N"),
        ("t_s,p1_kPa,p2_kPa,q", "time:s p1_kPa:kPa p2_kPa:kPa q:1"),
        ("tout,Force [N],F raw (V),T [degC]", "time:s? force:N F_raw_V:V T_degC:degC"),
        ("Zeit (ms),Load (kg),P (V)", "time:ms force:kgf pressure:kPa?"),
        ("t,Motor position,", "time:s? displacement:m? column_2:1"),
    ],
)
def test_columns_are_called_by_their_titles(titles, names):
    places = list(enumerate(titles.split(",")))
    raw = {place: [T if not place else WAVES[place]] for place, _ in places}
    told = named_by_titles(TitledColumns(dict(places), raw))
    assert (
        " ".join(f"{name}:{one.unit}{'' if one.sure else '?'}" for name, one in told.items())
        == names
    )
    assert [one.column for one in told.values()] == [place for place, _ in places]


def test_copies_constants_and_counters_are_left_out():
    columns = {"F raw (V)": 3 * WAVES[0], "F [N]": 2 - WAVES[0], "x": WAVES[1], "n": np.arange(400)}
    raw = {name: [values] for name, values in {**columns, "T": 21 + 0 * T}.items()}
    told = named_by_titles(TitledColumns({name: name for name in raw}, raw))
    assert {name: one.column for name, one in told.items()} == {
        "force": "F [N]",
        "displacement": "x",
    }


@pytest.mark.parametrize(
    ("names", "target"),
    [
        ("time pressure strain force temperature", "force"),
        ("time pressure displacement", "displacement"),
        ("p1 p2 angle", "angle"),
        ("u y", "y"),
        ("displacement force", "force"),
        ("a b", None),
        ("pressure y z", None),
        ("p1 tip_pos_x tip_pos_y", None),
        ("cmd pressure", None),
        ("y", None),
    ],
)
def test_the_target_is_what_titles_leave_no_choice_of(names, target):
    assert target_of(names.split(), is_driven=False) == target


def test_a_choice_is_refused_with_the_columns_and_the_command(tmp_path):
    write(tmp_path / "log.txt", [T, *WAVES[:2]], mark="\t")
    with pytest.raises(UsageError, match="do not say what is to be predicted") as refusal:
        start(tmp_path, tmp_path)
    assert "\n  1   -1 to 1" in refusal.value.message
    assert "--columns" in str(refusal.value.remedy)
    told = Answers(read_columns("time:s,u:V,y"), target="y")
    assert drafted(tmp_path, answers=told).output == "y"
    with pytest.raises(UsageError, match="'z' is to follow"):
        drafted(tmp_path, answers=Answers(told.columns, target="z"))


def test_columns_are_said_by_place_or_by_title():
    told = read_columns("time:ms,_,force=Load Cell:N*1.744-18.6,pressure:mbar-1013")
    assert told == {
        "time": NamedColumn(0, "ms"),
        "force": NamedColumn("Load Cell", "N", scale=1.744, offset=-18.6),
        "pressure": NamedColumn(3, "mbar", offset=-1013.0),
    }
    three = Group((), (), Preview("csv", 3, ("a", "b", "c")))
    four = Group((), (), Preview("csv", 4, None))
    assert Answers(told).about(three) == {}
    assert list(Answers(told).about(four)) == ["time", "pressure"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "time:s",
        "a b:s,force:N",
        "force:kPa,pressure:bar",
        "force:N,force:N,time:s",
        "x:parrots,y",
    ],
)
def test_columns_that_cannot_be_are_refused(text):
    with pytest.raises(UsageError):
        read_columns(text)
    with pytest.raises(UsageError):
        read_hold("strain:parrots")


# Names of files
# --------------------------------------------------------------------------------------------------


def test_names_of_files_tell_groups_conditions_and_repeats():
    names = [
        f"10mm_{size}_{state}_Test{n}.csv.gz"
        for size in ("10cm", "20cm")
        for state in ("Unkink", "kinked25")
        for n in (8, 9)
    ]
    parts = read_names(names)
    assert [part.group for part in parts] == [("10cm",)] * 4 + [("20cm",)] * 4
    assert [part.condition for part in parts[:4]] == ["Unkink", "Unkink", "kinked25", "kinked25"]
    assert words_of("10 psi/Specimen 1.csv") == ["10psi", "Specimen", "1"]
    assert [part.condition for part in read_names(["2bar_7.csv", "3bar_8.csv"])] == ["2bar", "3bar"]


@pytest.mark.parametrize(
    ("word", "number"),
    [
        ("kinked25", (25, None)),
        ("200kPa", (200, "kPa")),
        ("1.5bar", (1.5, "bar")),
        ("12%", (12, "%")),
        ("Kinked19mm2", (19, "mm")),
        ("Unkinked", None),
        ("200grams", (200, "gf")),
        ("2kg", (2, "kgf")),
    ],
)
def test_numbers_in_words(word, number):
    assert number_in(word) == number


@pytest.mark.parametrize(
    ("words", "hold", "quantity", "values"),
    [
        ("2bar 3bar", "", "pressure", [200, 300]),
        ("slack c5%", "", "strain", [0, 0.05]),
        ("L=180mm L=200mm", "", "length", [0.18, 0.2]),
        ("Unkinked Kinked9mm", "", "displacement", [0, 0.009]),
        ("100g 200g", "", "load", [0.980665, 1.96133]),
        ("kinked25 kinked50", "strain:%", "strain", [0.25, 0.5]),
        ("kinked25 kinked50", "", None, []),
        ("2bar 3mm", "", None, []),
    ],
)
def test_units_in_names_tell_what_was_held(words, hold, quantity, values):
    told = held_in_names(words.split(), read_hold(hold) if hold else None)
    assert (told and told[0]) == quantity
    assert [one.value for one in told[1]] == pytest.approx(values) if told else not values
