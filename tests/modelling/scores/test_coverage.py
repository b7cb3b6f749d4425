"""Held-out samples that combine inputs as no training sample does."""

from functools import partial

import numpy as np
import pytest
from common import dataset_of

from mapmore_cli.domain.results import Validation
from mapmore_cli.modelling import forecast
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Recipe
from mapmore_cli.modelling.signals.sampling import even_share
from mapmore_cli.modelling.validation import coverage
from mapmore_cli.modelling.validation.coverage import new_combinations, outside_hull
from mapmore_cli.reporting.alerts import alerts_of

GRID = np.array(np.meshgrid(np.linspace(0, 300, 21), np.linspace(-1, 1, 21))).reshape(2, -1)
TURN = np.linspace(0, 4 * np.pi, 400)


def model_and_data(known, asked):
    """A plane in two inputs, trained at some points, (2, n), and asked at others, (2, m)."""
    a, b = np.concatenate([known, asked], axis=1)
    held_out = np.arange(len(a)) >= known.shape[1]
    dataset = dataset_of({"a": a, "b": b, "y": a + b}, held_out=held_out)
    recipe = Recipe(target="y", dictionary=("1", "a", "b"), cuts={})
    return build("plane", dataset.curves, recipe, dataset.quantities), dataset


def loop(lag, size=1.0):
    return size * np.array([np.sin(TURN), 5 * np.sin(TURN - lag)])


def triangle_and_corner():
    """A plane that is trained below a diagonal of the grid, and asked above it."""
    corner = GRID[0] / 300 + (GRID[1] + 1) / 2 > 1
    return model_and_data(GRID[:, ~corner], GRID[:, corner])


def test_the_corner_beyond_a_trained_triangle_is_a_new_combination():
    model, dataset = triangle_and_corner()
    ((share, *pair),) = new_combinations(model, dataset)
    assert pair == ["a", "b"]
    assert 0.5 < share < 0.9  # samples within a tenth of the diagonal count as known
    (alert,) = (
        one
        for one in alerts_of(dataset, model, Validation({}, {}, (), {}))
        if one.kind == "combined"
    )
    words = "of the held-out samples combine a and b as no training sample does"
    assert alert.sentence.startswith(f"{100 * share:.3g} % {words}, although each of them")


@pytest.mark.parametrize("corner", [(1, 1), (1, -1), (-1, 1), (-1, -1)])
@pytest.mark.parametrize(("beyond", "is_new"), [(0.09, False), (0.11, True)])
def test_a_tenth_of_the_range_beyond_the_hull_is_still_known(corner, beyond, is_new):
    """Squares of which one corner is cut off along the other diagonal: beyond it, towards every
    corner.
    """
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, 21)] * 2)
    square = np.array([x.ravel(), y.ravel()]) * np.array(corner)[:, None]
    known = square[:, np.dot(corner, square) <= 1e-9]
    asked = np.array(corner)[:, None] * np.full(2, beyond / np.sqrt(2))[:, None]
    assert bool([*new_combinations(*model_and_data(known, asked))]) == is_new


def test_exactly_a_tenth_beyond_the_hull_is_known():
    square = np.array([[0.0, 0, 1, 1], [0, 1, 0, 1]])
    asked = np.array([[0.0, 0, 0, 0], [1.1, -0.1, 1.101, -0.101]])
    assert outside_hull(square, asked).tolist() == [False, False, True, True]


@pytest.mark.parametrize(
    ("known", "asked"),
    [
        (GRID, GRID * 0.97),
        (GRID[:, GRID[1] != 0], GRID[:, GRID[1] == 0]),
        (loop(0.3), loop(0.35)),
        (loop(0.3), loop(0.25, 0.5)),
        (GRID[[0, 0]], GRID[[0, 0]] * 0.9),  # two inputs that are always equal
        (GRID, GRID + np.array([[200.0], [0.0]])),  # beyond the range of one of them
    ],
    ids=["grid", "inner level", "loop", "inner loop", "equal", "beyond a range"],
)
def test_points_between_trained_ones_are_no_new_combination(known, asked):
    assert not [*new_combinations(*model_and_data(known, asked))]


def test_long_records_are_thinned_and_need_no_held_out_samples(monkeypatch):
    model, dataset = triangle_and_corner()
    ((whole, *_),) = new_combinations(model, dataset)
    monkeypatch.setattr(coverage, "even_share", partial(even_share, most=100))
    ((thinned, *_),) = new_combinations(model, dataset)
    assert thinned == pytest.approx(whole, abs=0.1)
    assert not [*new_combinations(*model_and_data(GRID, GRID[:, :0]))]


def test_a_model_that_runs_along_a_recording_is_asked_about_whole_recordings(monkeypatch):
    """Behind a tendon, for example, the length follows from the time too, which is no input."""
    a, time = np.linspace(0, 1, 10), np.arange(10.0)
    dataset = dataset_of({"time": time, "a": a, "y": a}, held_out=a > 0.5)
    model = build(
        "line",
        dataset.curves,
        Recipe(target="y", dictionary=("1", "a"), cuts={}),
        dataset.quantities,
    )
    monkeypatch.setattr(forecast, "outside_range", lambda _model, columns: columns["time"] > 7)
    assert coverage.share_outside(model, dataset) == 2 / 5
    assert not [*new_combinations(model, dataset)]
