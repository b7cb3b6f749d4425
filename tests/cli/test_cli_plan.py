"""`mapmore plan`: what to measure next."""

import csv

import numpy as np
from cli_samples import write_recording, write_study


def write(folder, levels):
    """The force bends sharply over the pressure above 300 kPa."""
    spec = write_study(folder, levels=levels, held_out=())
    strain = np.linspace(0.0, 0.2, 15)
    for level in levels:
        write_recording(
            folder,
            "bench",
            level,
            strain,
            (level + 0.01 * max(level - 300, 0) ** 2) * (1 - 4 * strain),
        )
    return spec


LEVELS = [0, 100, 200, 300, 400, 500, 600]


def test_a_single_level_says_nothing_and_levels_have_no_forecast(tmp_path, mapmore):
    mapmore(
        "plan", write(tmp_path, [100]), "--runs", tmp_path / "other", code=4, says="only one level"
    )
    mapmore("plan", write(tmp_path, LEVELS), "--until", "2%", code=2, says="--points")


def test_points_of_a_map_and_its_figure(tmp_path, document):
    spec = write(tmp_path, LEVELS)
    files = [tmp_path / "plan.svg", tmp_path / "plan.csv"]
    asked = ("--points", 4, "--until", "1%", "-o", files[0], "-o", files[1])
    found = document("plan", spec, "-q", *asked)
    assert len(found["next"]) == 4
    assert {"pressure", "strain"} <= set(found["next"][0])
    assert files[0].read_text().startswith("<?xml")
    with files[1].open() as file:
        assert [row["what"] for row in csv.DictReader(file)] == ["point"] * 4
