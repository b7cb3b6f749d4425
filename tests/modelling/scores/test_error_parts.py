"""Errors of repeated cycles parted into drift, shape and rest: planted parts are found again, and their squares add up."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.validation.error_parts import error_parts

CYCLES, LONG = 8, 200
X = np.tile(1 - np.cos(np.linspace(0, 2 * np.pi, LONG, endpoint=False)), CYCLES)
CYCLE = np.repeat(np.arange(CYCLES), LONG)


def of(error, held=CYCLE >= CYCLES // 2, parts=(slice(None),)):
    curves = [Curve(f"r{n}", None, {"x": X[rows], "y": np.zeros(len(X[rows]))}, held[rows], (f"r{n}",)) for n, rows in enumerate(parts)]
    return error_parts(curves, [error[rows] for rows in parts], "y", "x", {f"r{n}": "log" for n in range(len(parts))})


@pytest.mark.parametrize(
    ("name", "error"),
    [
        ("drift", 0.3 * CYCLE),
        ("shape", np.sin(np.linspace(0, 2 * np.pi * CYCLES, len(X), endpoint=False))),
        ("change", np.where(CYCLE >= CYCLES // 2, 1.0, 1e-3) * np.cos(np.linspace(0, 6 * np.pi * CYCLES, len(X), endpoint=False))),
        ("rest", np.random.default_rng(1).normal(0, 1, len(X))),
    ],
)
def test_a_planted_part_is_found(name, error):
    for one in of(error)[name == "change" :]:
        assert one.limit == name
        others = [value for part, value in one.rms.items() if part != name]
        assert max(others) < 0.35 * one.rms[name]


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(1, 3))
def test_squares_add_up_over_gaps_and_empty_predictions(seed, pieces):
    rng = np.random.default_rng(seed)
    error = rng.normal(0, 1, len(X)) + rng.normal(0, 3) * CYCLE
    error[rng.integers(0, len(X), 20)] = np.nan
    edges = [0, *sorted(rng.integers(1, len(X), pieces - 1).tolist()), len(X)]
    found = of(error, parts=[slice(a, b) for a, b in pairwise(edges)])
    assert [one.split for one in found] == ["train", "validate"]
    for one, rows in zip(found, (CYCLE < 4, CYCLE >= 4), strict=True):
        known = error[rows & np.isfinite(error)]
        assert sum(value**2 for value in one.rms.values()) == pytest.approx(np.mean(known**2), rel=0.05)
        assert one.samples <= len(known)


def test_one_cycle_tells_nothing_of_another():
    assert [one.split for one in of(np.ones(len(X)), held=CYCLE >= CYCLES - 1)] == ["train"]
