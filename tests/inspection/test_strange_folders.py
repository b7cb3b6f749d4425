"""Folders as laboratories keep them: what names of folders, lines before titles, remarks and clocks
tell is used.
"""

from __future__ import annotations

import numpy as np
import pytest
from recorded import drafted, drafts, write

STRAIN = np.linspace(0.0, 0.15, 40)
THERE_AND_BACK = np.concatenate([STRAIN, STRAIN[::-1]])
T = 0.01 * np.arange(3000)
LEFT, RIGHT = 3 + 2 * np.sin(2 * T[:600]), 3 - 2 * np.sin(2 * T[:600]) + np.sin(5.4 * T[:600])
PAIR = (2 * T[:600], LEFT, RIGHT, 5 * np.tanh(LEFT - RIGHT))  # of muscles at a joint


def force(bar, strain):
    return 40 * bar * (1 - 3 * strain) - 100 * strain


@pytest.mark.parametrize(
    "name", ["{:g} psi/Specimen_RawData_{}.csv", "{:g}psi/{}.csv", "psi_{:g}psi_up/run{}.csv"]
)
def test_pressures_in_names_of_folders_are_levels_and_numbers_of_files_repeats(tmp_path, name):
    for psi in (10, 20, 30, 40):
        for repeat in (1, 2):
            own = force(psi / 14.5, THERE_AND_BACK) + repeat
            write(
                tmp_path / name.format(psi, repeat),
                (0.1 * np.arange(80), 200 * THERE_AND_BACK, own),
                "Time (s),Extension (mm),Load (N)\n",
            )
    data = drafted(tmp_path).data
    assert data["levels"]["of"] == "pressure"
    np.testing.assert_allclose(data["levels"]["at"], [68.9476, 137.895, 206.843, 275.79])
    assert len(data["files"]) == 4


def test_lines_of_fewer_cells_before_the_titles_are_no_titles(tmp_path):
    for number, bar in enumerate((1, 2, 3, 4)):
        columns = (
            0.05 * np.arange(80),
            bar + 0.01 * np.sin(np.arange(80)),
            200 * THERE_AND_BACK,
            force(bar, THERE_AND_BACK),
        )
        head = "Rig 7;;;\nDatum;12.03.2021;;\nZeit [s];Druck [bar];Weg [mm];Kraft [N]\n"
        write(tmp_path / f"Messung_{number:02}.csv", columns, head, ";", ",")
    data = drafted(tmp_path).data
    assert (data["skip_rows"], data.get("header", 1)) == (2, 1)
    assert data["columns"]["pressure"] == {"column": "Druck [bar]", "unit": "bar"}
    assert data["levels"]["at"] == [100, 200, 300, 400]


def test_a_title_that_is_missing_leaves_the_others_above_their_units(tmp_path):
    columns = (
        np.arange(80.0),
        100.0 + np.arange(80) % 40,
        THERE_AND_BACK,
        force(2, THERE_AND_BACK),
    )
    write(tmp_path / "run.csv", columns, ",Druck,eps,Kraft\nNo,kPa,1,N\n")
    told = {name: one["column"] for name, one in drafted(tmp_path).data["columns"].items()}
    assert told == {"pressure": "Druck", "strain": "eps", "force": "Kraft"}


def test_titles_in_a_remark_name_the_columns_by_their_places(tmp_path):
    write(tmp_path / "pair.dat", PAIR, "# a joint\n# time pL pR theta\n", "   ")
    draft = drafted(tmp_path)
    told = {name: one["column"] for name, one in draft.data["columns"].items()}
    assert told == {"time": 0, "pL": 1, "pR": 2, "theta": 3}
    assert draft.output == "theta"


@pytest.mark.parametrize("title", ["set_pressure_kPa", "desired", "Valve", "p_set"])
def test_what_was_commanded_is_no_target_and_no_second_pressure(tmp_path, title):
    command = 200 + 100 * np.sin(T) * np.cos(3.1 * T)
    pressure = np.concatenate([np.full(9, command[0]), command[:-9]])
    write(
        tmp_path / "log.csv",
        (T, pressure, np.tanh(pressure / 200), command),
        f"time,pressure_kPa,bend,{title}\n",
    )
    draft = drafted(tmp_path)
    assert draft.output == "bend"
    assert draft.data["columns"]["pressure"]["column"] == "pressure_kPa"


def test_names_of_files_say_what_tests(tmp_path):
    for name, speed in (("train_1", 1.0), ("train_2", 1.3), ("validation_1", 1.15)):
        t = 0.02 * np.arange(1500)
        pressure = 200 + 100 * np.sin(speed * t) * np.cos(0.31 * t)
        write(
            tmp_path / f"{name}.csv",
            (t, pressure, np.tanh(pressure / 200)),
            "time,pressure_kPa,bend\n",
        )
    asked = drafts(tmp_path, ask=lambda _: "")[0]
    assert (
        drafted(tmp_path).data["split"]
        == asked.data["split"]
        == {"validate": {"files": ["validation_1.csv"]}}
    )
