"""Columns are what titles, units and a person say; names of files tell what was held. Nothing is
guessed from the size of values.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded import drafted, write

from mapmore_cli.annexes.drafting.answers import (
    answers_of,
    read_hold,
)
from mapmore_cli.annexes.drafting.by_titles import known_by_titles
from mapmore_cli.annexes.drafting.columns import read_titles
from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.annexes.drafting.name_numbers import numbers_in
from mapmore_cli.annexes.drafting.names import told_by_names
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
        ("force_N_total|raw_force_N", "force", "N"),
        ("Load (kN)", "load", "kN"),
        ("position_mm", "displacement", "mm"),
        ("temperature||42|y_V|value [Pa]", None, None),
    ],
)
def test_titles_say_quantities_and_units(titles, quantity, unit):
    for title in titles.split("|"):
        label = read_label(title)
        assert (label and label.quantity) == quantity, title
        assert unit is None or (label is not None and label.unit == unit), title


@pytest.mark.parametrize(
    ("title", "plain"), [("force_N", True), ("force_N_total", False), ("sensor 3 kPa", False)]
)
def test_a_title_is_plain_if_it_has_nothing_else(title, plain):
    assert read_label(title).plain == plain


@given(st.text())
def test_any_name_of_a_column_or_a_file_can_be_read(name):
    read_label(name)
    told_by_names([name + "_0", name + "_1"])


def table_of(titles):
    titles = titles.split(",")
    raw = {place: [T if not place else WAVES[place % 5]] for place in range(len(titles))}
    return read_titles(laid_out(raw, titles), raw)


def laid_out(columns, titles):
    """The layout of a file with these columns."""
    return FileLayout("csv", tuple(columns), tuple(titles), {}, (), ())


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        ("t_s,P [bar],eps,F_N", "time:s pressure:bar strain:1 force:N"),
        ("t_s,p1_kPa,p2_kPa,q", "time:s p1:kPa p2:kPa q:1"),
        ("time,Force [N],F raw (V),T [degC]", "time:s? force:N F_raw:V T:degC"),
        ("Zeit (ms),Load (kg),P (V)", "time:ms force:kgf P:V"),
        ("t,Motor position,Tip z [mm],P", "time:s? Motor_position:1 Tip_z:mm pressure:kPa?"),
        ("t,position_mm,tip_mm,P (psig)", "time:s? displacement:mm tip:mm pressure:psi"),
        ("t,Temp_1 (°C),Temp_2 (°C)", "time:s? Temp_1:degC Temp_2:degC"),
    ],
)
def test_columns_are_called_by_their_titles_in_their_units(titles, names):
    table = table_of(titles)
    told, _ = known_by_titles(table)
    shown = [f"{name}:{one.unit}{'' if one.sure else '?'}" for name, one in told.items()]
    assert " ".join(shown) == names


@pytest.mark.parametrize(
    ("target", "inputs", "columns"),
    [
        ("tip", "motor", {"Motor_position": ("Motor position", None), "Tip_z": ("Tip z", "mm")}),
        ("Tip z", "Motor position,2", None),
        ("z=Tip z:cm", "Motor_position", {"z": ("Tip z", "cm")}),
        ("2", "1", None),
    ],
)
def test_targets_and_inputs_are_named_by_titles_words_or_places(tmp_path, target, inputs, columns):
    """A CSV written by pandas has an empty first title; it hid all others."""
    rows = (np.arange(400), *WAVES[:3])
    write(tmp_path / "a.csv", rows, ",Motor position,Tip z,Q\n,,mm,\n")
    with pytest.raises(UsageError, match="--columns: no column of numbers is called Mtr"):
        drafted(tmp_path, answers=answers_of(columns="motor=Mtr:mm,tip=Tip z:mm", target="tip"))
    if inputs == "Motor position,2":
        with pytest.raises(UsageError, match="no column of numbers"):
            drafted(tmp_path, answers=answers_of(target="Tip", inputs="motor,lever"))
        return
    draft = drafted(tmp_path, answers=answers_of(target=target, inputs=inputs))
    told = draft.data["columns"]
    assert len(told) == 2
    for name, (title, unit) in (columns or {}).items():
        assert told[name]["column"] == title
        assert unit is None or told[name]["unit"] == unit


def test_of_a_target_neither_copies_nor_what_computes_it_are_inputs(tmp_path):
    drive, force = WAVES[1], 3 * WAVES[0]
    smooth = np.sin(3.0 * (T - 0.4))  # the next samples of it give the force
    columns = {
        "u": drive,
        "q": WAVES[2],
        "sensor": 0.2 * force + 1,
        "late": smooth,
        "torque": force,
    }
    write(tmp_path / "a.csv", {name: values + 1e-9 * T for name, values in columns.items()})
    draft = drafted(tmp_path, answers=answers_of(target="torque"))
    assert list(draft.data["columns"]) == ["u", "q", "torque"]
    assert "left out: sensor (is a linear function of torque" in draft.text()
    assert "late (gives, through a linear filter" in draft.text()
    draft = drafted(tmp_path, answers=answers_of(target="torque", inputs="sensor"))
    assert list(draft.data["columns"]) == ["sensor", "torque"]
    write(tmp_path / "a.csv", {"late": smooth, "torque": force + 1e-9 * T})
    assert list(drafted(tmp_path, answers=answers_of(target="torque")).data["columns"]) == [
        "late",  # is the only input, and stays
        "torque",
    ]


@pytest.mark.parametrize(
    "said",
    [{"columns": ""}, {"hold": "strain:parrots"}, {"hold": "a b"}, {"target": ""}],
)
def test_what_cannot_be_is_refused(said):
    with pytest.raises(UsageError):
        answers_of(**said)


# Names of files
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "numbers"),
    [
        ("10mm_20cm_kinked25_Test8", "length:10 length:20 kinked:25 :8"),
        ("Sample 1 Final 100 grams", ":1 load:100"),
        ("Circle_1bar", "pressure:1"),
        ("P=0.5bar_run3", "pressure:0.5 :3"),
        ("temp_40", "temp:40"),
        ("length 180 mm", "length:180"),
        ("2031-05-04_101112_run/log", ":2031 :5 :4 :101112"),
        ("10 psi/Specimen_RawData_1", "pressure:10 :1"),
        ("Kinked19mm2_Test10", "Kinked:19 :2 :10"),
        ("c5%", "percent:5"),
        ("L=180mm", "length:180"),
        ("run-3_1,5bar", ":3 pressure:1.5"),
    ],
)
def test_numbers_are_read_where_a_unit_or_a_word_stands_beside_them(name, numbers):
    told = [f"{one.quantity}:{one.value:g}" for one in numbers_in(name)]
    assert " ".join(told) == numbers


@pytest.mark.parametrize(
    ("names", "hold", "told"),
    [
        ("2bar_7 3bar_8", "", "pressure/bar:2,3"),
        ("slack c5% c10%", "strain:%", "strain/%:0,5,10"),
        ("temp_20 temp_40 temp_70", "", "temp/:20,40,70"),
        ("temp_20 temp_40 temp_70", "temperature:degC", "temperature/degC:20,40,70"),
        ("run_1 run_2 run_3", "", ""),
        ("finger1 finger2 finger3", "", ""),
        ("finger1 finger2 finger3", "size=finger", "size/:1,2,3"),
        ("a_10psi_b2 a_20psi_b2", "", "pressure/psi:10,20"),
        ("2bar_40% 2bar_60%", "", "percent/%:40,60"),
        ("K_100 K_200", "", ""),
    ],
)
def test_names_tell_what_varies(names, hold, told):
    conditions, _ = told_by_names(names.split(), read_hold(hold) if hold else None)
    shown = [
        f"{one.quantity}/{one.unit}:{','.join(map('{:g}'.format, one.values))}"
        for one in conditions
    ]
    assert " ".join(shown) == told


@pytest.mark.parametrize(
    ("title", "name", "unit"),
    [
        ("s[1]", "s_1", ""),
        ("s[12]", "s_12", ""),
        ("s_12", "s_12", ""),
        ("strain [1]", "strain_0", "1"),
        ("x in mm", "x", "mm"),
        ("gap\uff08mm\uff09", "gap", "mm"),
        ("gap [in]", "gap", "in"),
        ("T1 [degC]", "T1", "degC"),
        *(("vel_mm/s", "vel", "mm/s"), ("v m/s", "v", "m/s"), ("k_N/mm", "k", "N/mm")),
        *(("Zeit t/s", "Zeit_t", "s"), ("Kraft F/N", "Kraft_F", "N"), ("a l/min", "a_l", "")),
        *(
            ("a in m/s²", "a", "m/s^2"),
            ("sigma N/mm2", "sigma", "N/mm^2"),
            ("p in kPa", "p", "kPa"),
        ),
        *(("force/%Fmax", "force_Fmax", "%"), ("v at 50 %", "v_at_50", "")),
        *(
            ("millis", "millis", "ms"),
            ("p (bar(a))", "p", "bara"),
            ("P [kPa(a)]", "P", "kPa_abs"),
            ("tau [N.m]", "tau", "N*m"),
        ),
    ],
)
def test_indices_and_prepositions_are_no_units(title, name, unit):
    layout = FileLayout("csv", (title,), (title,), {}, (), ())
    (column,) = read_titles(layout, {}).values()
    assert (column.name, column.unit) == (name, unit)
