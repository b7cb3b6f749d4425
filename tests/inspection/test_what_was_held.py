"""What was held: a person, names, and values that stay in each recording say so."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from mapmore_cli.annexes.drafting.draft import Draft
from mapmore_cli.annexes.drafting.experiment import find_held, goes_in_cycles
from mapmore_cli.annexes.drafting.held_out import with_split
from mapmore_cli.domain.recording import Recording

T = np.arange(0, 40, 0.02)
LOOP = 1 - np.abs(T / 20 - 1)
BOTH = ("pressure", "strain")
LEVELS = np.array([[1], [2], [3]])


def recording(**columns):
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    return Recording("r", "r.csv", arrays, len(columns["pressure"]), {})


def strokes(pressures, rows=slice(None)):
    """Strokes there and back, each at a pressure or the course of one."""
    return [
        recording(time=T[rows], pressure=(pressure + 0 * T)[rows], strain=0.2 * LOOP[rows])
        for pressure in pressures
    ]


@pytest.mark.parametrize(
    ("pressures", "at", "off"),
    [
        (
            np.random.default_rng(3).normal([[80], [150], [250], [350]], 0.7, (4, T.size)),
            [80, 150, 250, 350],
            0.7,
        ),
        # a closed or slow supply: the pressure dwells at both ends of every stroke
        (100 * (LEVELS + np.where(T < 20, 0.2, -0.2) + 0.02 * np.sin(7 * T)), [100, 200, 300], 25),
        # it rests at the end of a stroke, and is far lower on the way back
        (100 * (LEVELS + np.where(T < 30, 0.0, -0.6)), [70, 170, 270], 15),
    ],
)
def test_what_stays_in_each_recording_was_held(pressures, at, off):
    recordings = strokes(pressures)
    held = find_held(recordings, BOTH, None, {})
    assert (held.of, held.swept) == BOTH
    np.testing.assert_allclose(held.at, at, rtol=0, atol=off)
    assert goes_in_cycles(recordings, held)
    there = strokes(pressures, slice(T.size // 2))
    assert not goes_in_cycles(there, find_held(there, BOTH, None, {}))


@pytest.mark.parametrize(
    ("course", "held_out"),
    [
        (np.append(np.arange(51), np.arange(49)[::-1]), {"last": 0.3}),
        (np.append(np.arange(85), np.full(15, 60)), {"last": 0.3}),  # half of the last 30 goes on
        (np.append(np.arange(86), np.full(14, 60)), {"fraction": 0.2, "seed": 1}),
        (np.repeat([0, 1, 2, 3], 25), {"strain": [2]}),  # most of the last 30 have a new value
    ],
)
def test_the_last_samples_are_held_out_unless_most_lie_beyond_the_others(course, held_out):
    done = SimpleNamespace(
        recordings=[recording(pressure=np.zeros(100), strain=course)],
        inputs=("strain",), conditions={}, apart=(),
    )  # fmt: skip
    assert with_split(Draft({"data": {}}), done, None).data["split"] == {"validate": held_out}
    last = with_split(Draft({"data": {}}), done, "last")
    assert last.data["split"] == {"validate": {"last": 0.3}}
    place = "between" if "last" in held_out else "beyond"
    why = f"you; {place}: the last samples of every recording"
    assert last.notes["data", "split"].why.startswith(why)
