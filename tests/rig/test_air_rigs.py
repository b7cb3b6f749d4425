"""H's random motion and joint, and P's muscle behind a regulator: the laws that they obey, and what
is published.
"""

import csv
from functools import cache

import pytest
from pages import PUBLISHED
from rig_cases import spec

FREE = {1.4: 1.7, 3.0: 6.4, 4.0: 8.8, 5.0: 9.9, 6.0: 10.3}
"""Free contraction (cm) of the muscle at pressures in bar, as P's data suggest it."""


@cache
def hanging():
    found = spec("waveforms/validation")
    return found.experiment, found.experiment.hung(found.muscle, found.hysteresis)


@pytest.mark.parametrize(("bar", "centimetres"), FREE.items())
def test_free_contraction_is_what_the_published_data_suggest(bar, centimetres):
    setup, muscle = hanging()
    start, end = (
        setup.resting_strain(muscle, pressure, 0.0)
        for pressure in (float(setup.regulator.wanted(0.0)), bar * 1e5)
    )
    assert 100 * muscle.muscle.length * (end - start) == pytest.approx(centimetres, abs=0.3)


def test_the_waveforms_are_those_of_the_published_table():
    """P table 2, its column of types read with the names."""
    with (PUBLISHED / "p_table_2.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    lows, swings = ([float(row[key]) for row in rows] for key in ("offset_V", "amplitude_V"))
    told = [
        (
            row["experiment"],
            low,
            low + swing,
            float(row["frequency_Hz"]),
            int(row["wavelengths"]),
            float(row["load_kg"]),
        )
        for row, low, swing in zip(rows, lows, swings, strict=True)
    ]
    waveforms = spec("waveforms/validation").experiment.waveforms
    assert [
        (each.name, each.low, each.high, each.frequency, each.wavelengths, each.load)
        for each in waveforms
    ] == told
    shapes = {each.name: each.shape for each in waveforms}
    assert shapes == dict.fromkeys(shapes, "sine") | {"triangle": "triangle", "square": "square"}
