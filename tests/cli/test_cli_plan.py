"""`mapmore plan`: what to measure next."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

SPEC = """\
schema_version: 1
name: bench
data:
  files: ["bench_*.csv"]
  columns: {{pressure: {{column: P, unit: kPa}}, strain: {{column: eps}}, force: {{column: F, unit: N}}}}
  levels: {{of: pressure, at: {levels}}}
{split}target: static
segment: {{strain: none}}
dictionary: [{{polynomial: {{of: [strain], order: 2}}}}]
report: {{figures: [], formats: [csv]}}
"""


def write(folder: Path, levels: list[int], split: str = "") -> Path:
    """The force bends sharply over the pressure above 300 kPa."""
    strain = np.linspace(0.0, 0.2, 15)
    for level in levels:
        force = (level + 0.01 * max(level - 300, 0) ** 2) * (1 - 4 * strain)
        lines = [f"{level},{e:.5f},{f:.4f}" for e, f in zip(strain, force, strict=True)]
        (folder / f"bench_{level}.csv").write_text("\n".join(["P,eps,F", *lines]) + "\n")
    spec = folder / "bench.yaml"
    spec.write_text(SPEC.format(levels=levels, split=split))
    return spec


def planned(mapmore: Callable[..., Any], spec: Path, *arguments: object) -> Any:
    result = mapmore("plan", spec, "--runs", spec.parent / "runs", "--json", "-q", *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    return json.loads(result.stdout)


LEVELS = [0, 100, 200, 300, 400, 500, 600]


def test_the_next_level_lies_where_the_force_bends(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    found = planned(mapmore, write(tmp_path, [*LEVELS[:5], 500]), "--until", "2%", "--cost", "pressure=2")
    assert found["next"][0]["pressure"] > 250
    assert all(one["after"] <= one["half_width"] and one["cost"] == 2 for one in found["next"])
    assert len(found["next"]) == 5
    assert found["until"]["wanted"] > 0
    assert sorted(one["error"] for one in found["next"])[::-1] == [one["error"] for one in found["next"]]


def test_held_out_forces_change_nothing(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    spec = write(tmp_path, LEVELS, "  split: {validate: {pressure: [500]}}\n")
    before = planned(mapmore, spec)
    path = tmp_path / "bench_500.csv"
    header, *rows = path.read_text().splitlines()
    path.write_text("\n".join([header, *(f"500,{row.split(',')[1]},-7" for row in rows)]) + "\n")
    assert planned(mapmore, spec)["next"] == before["next"]
    assert before["next"][0]["pressure"] == 500
    assert "pressure=500 is measured and held out: the plan does not use it." in before["notes"]


def test_two_levels_say_the_middle_and_one_says_nothing(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    found = planned(mapmore, write(tmp_path, [100, 500]))
    assert [(one["pressure"], one["half_width"]) for one in found["next"]] == [(300.0, None)]
    for path in tmp_path.glob("bench_*.csv"):
        path.unlink()
    alone = mapmore("plan", write(tmp_path, [100]), "--runs", tmp_path / "other")
    assert alone.exit_code == 4
    assert "single training level" in alone.stderr


def test_points_of_a_map_and_its_figure(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    spec = write(tmp_path, LEVELS)
    files = [tmp_path / "plan.svg", tmp_path / "plan.csv"]
    found = planned(mapmore, spec, "--points", 4, "--until", "1%", "-o", files[0], "-o", files[1])
    assert len(found["next"]) == 4
    assert {"pressure", "strain"} <= set(found["next"][0])
    assert files[0].read_text().startswith("<?xml")
    with files[1].open() as file:
        assert [row["what"] for row in csv.DictReader(file)] == ["point"] * 4


def test_the_table_and_the_figure_of_levels(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    spec = write(tmp_path, LEVELS)
    result = mapmore("plan", spec, "--runs", tmp_path / "runs", "--until", "0.5", "-o", tmp_path / "plan.svg")
    assert result.exit_code == 0
    assert "half width [N]" in result.stdout
    assert "Equal distances" in result.stdout
    assert "forecast after the first" in (tmp_path / "plan.svg").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--until", "much"), "is no size"),
        (("--until", "-1%"), "is no size"),
        (("--cost", "pressure"), "is no price"),
        (("--cost", "force=3"), "the plan does not set it"),
        (("-o", "plan.doc"), "neither a figure nor a table"),
        (("--points", "0"), "greater than or equal to 1"),
    ],
)
def test_what_cannot_be_planned(tmp_path: Path, mapmore: Callable[..., Any], arguments: tuple[str, ...], words: str) -> None:
    result = mapmore("plan", write(tmp_path, LEVELS), "--runs", tmp_path / "runs", *arguments)
    assert result.exit_code == 2
    assert words in result.stderr
