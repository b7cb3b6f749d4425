"""`mapmore plan`: what to measure next."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
from cli_samples import change_forces, write_recording, write_study


def write(folder: Path, levels: list[int], held_out: tuple[int, ...] = ()) -> Path:
    """The force bends sharply over the pressure above 300 kPa."""
    spec = write_study(folder, levels=levels, held_out=held_out)
    strain = np.linspace(0.0, 0.2, 15)
    for level in levels:
        write_recording(folder, "bench", level, strain, (level + 0.01 * max(level - 300, 0) ** 2) * (1 - 4 * strain))
    return spec


def planned(mapmore, spec: Path, *arguments: object) -> Any:
    return json.loads(mapmore("plan", spec, "--runs", spec.parent / "runs", "--json", "-q", *arguments, code=0).stdout)


LEVELS = [0, 100, 200, 300, 400, 500, 600]


def test_the_next_level_lies_where_the_force_bends(tmp_path, mapmore):
    found = planned(mapmore, write(tmp_path, [*LEVELS[:5], 500]), "--until", "2%", "--cost", "pressure=2")
    assert found["next"][0]["pressure"] > 250
    assert all(one["after"] <= one["half_width"] and one["cost"] == 2 for one in found["next"])
    assert len(found["next"]) == 5
    assert found["until"]["wanted"] > 0
    assert sorted(one["error"] for one in found["next"])[::-1] == [one["error"] for one in found["next"]]


def test_held_out_forces_change_nothing(tmp_path, mapmore):
    spec = write(tmp_path, LEVELS, (500,))
    before = planned(mapmore, spec)
    change_forces(tmp_path / "bench_500.csv", lambda force: np.full(len(force), -7.0))
    assert planned(mapmore, spec)["next"] == before["next"]
    assert before["next"][0]["pressure"] == 500
    assert "pressure=500 is measured and held out: the plan does not use it." in before["notes"]


def test_two_levels_say_the_middle_and_one_says_nothing(tmp_path, mapmore):
    found = planned(mapmore, write(tmp_path, [100, 500]))
    assert [(one["pressure"], one["half_width"]) for one in found["next"]] == [(300.0, None)]
    for path in tmp_path.glob("bench_*.csv"):
        path.unlink()
    mapmore("plan", write(tmp_path, [100]), "--runs", tmp_path / "other", code=4, says="single training level")


def test_points_of_a_map_and_its_figure(tmp_path, mapmore):
    spec = write(tmp_path, LEVELS)
    files = [tmp_path / "plan.svg", tmp_path / "plan.csv"]
    found = planned(mapmore, spec, "--points", 4, "--until", "1%", "-o", files[0], "-o", files[1])
    assert len(found["next"]) == 4
    assert {"pressure", "strain"} <= set(found["next"][0])
    assert files[0].read_text().startswith("<?xml")
    with files[1].open() as file:
        assert [row["what"] for row in csv.DictReader(file)] == ["point"] * 4


def test_the_table_and_the_figure_of_levels(tmp_path, mapmore):
    spec = write(tmp_path, LEVELS)
    result = mapmore("plan", spec, "--runs", tmp_path / "runs", "--until", "0.5", "-o", tmp_path / "plan.svg", code=0)
    assert "half width [N]" in result.stdout
    assert "Equal distances" in result.stdout
    assert "forecast after the first" in (tmp_path / "plan.svg").read_text()
