"""Segmentation: even, breakpoints, gradient and optimal boundaries."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from common import curve_of
from hypothesis import given
from hypothesis import strategies as st
from surfaces import changed, curves, recipe

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.pieces import segmentation
from mapmore_cli.modelling.pieces.build import segment
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.segmentation import (
    gradient_boundaries,
    joined_segments,
    optimal_partition,
    segment_curve,
    slope_change,
)


def cut(curve, cuts):
    def no_cost(_curve, _rows):
        raise AssertionError("only `optimal` asks for costs")

    return segment_curve(curve, cuts, "force", no_cost)


@given(st.integers(1, 8), st.integers(0, 100))
def test_every_training_sample_lies_in_a_segment_and_no_other(count, seed):
    curve = curves(seed=seed)[0]
    held = np.random.default_rng(seed).random(curve.size) < 0.3
    curve = replace(curve, held_out=held)
    segmented = cut(curve, {"strain": Cuts("even", count)})
    rows = np.concatenate([s.rows for s in segmented.segments])
    assert set(rows.tolist()) == set(np.flatnonzero(~held).tolist())
    for one, low, high in zip(
        segmented.segments, segmented.boundaries[0][:-1], segmented.boundaries[0][1:], strict=True
    ):
        x = curve.columns["strain"][one.rows]
        assert low <= x.min()
        assert x.max() <= high


def test_each_curve_is_cut_over_its_own_range_and_a_sample_on_a_boundary_belongs_to_both_segments():
    for curve in curves(held_out=(), n=121):
        segmented = cut(curve, {"strain": Cuts("even", 4)})
        np.testing.assert_allclose(
            segmented.boundaries[0], np.linspace(0, curve.columns["strain"].max(), 5)
        )
        assert segmented.limits["strain"] == (0.0, curve.columns["strain"].max())
        first, second, *_ = segmented.segments
        assert set(first.rows) & set(second.rows) == {30}


def test_a_segment_without_samples_is_refused_with_its_name():
    curve = curves(held_out=())[0]
    strain = np.where(curve.columns["strain"] < 0.05, 0.0, curve.columns["strain"])
    with pytest.raises(DataError, match="pressure=80/strain:2: contains no training sample"):
        cut(changed(curve, strain=strain), {"strain": Cuts("even", 4)})


def test_optimal_cuts_of_several_outputs_do_not_hang_on_their_units():
    """The first has a kink at 0.1, the other at 0.2: the cut of both lies between."""
    x, found = np.linspace(0, 0.3, 31), []
    cuts = {"strain": Cuts("optimal", 2)}
    asked = recipe(level=None, cuts=cuts, dictionary=("1", "strain"), max_terms=2)
    for unit, also in ((1.0, ()), (1e-2, ("other",)), (1e2, ("other",))):
        columns = {"strain": x, "force": np.abs(x - 0.1), "other": unit * np.abs(x - 0.2)}
        (cut,) = segment([curve_of(columns)], asked, also=also)
        found.append(cut.boundaries[0][1])
    assert found[0] == pytest.approx(0.1, abs=0.01)
    assert 0.12 < found[1] < 0.18
    assert found[1] == found[2]


def test_optimal_cuts_pass_over_segments_with_as_many_samples_as_terms():
    """The dictionary or `max_terms` limits the terms."""
    x = np.arange(21.0)
    for most, terms, force, at in (
        (2, ("1", "strain"), np.abs(x - 1), 2),
        (9, ("1", "strain"), np.abs(x - 1), 2),
        (1, ("1", "strain", "strain^2", "strain^3"), np.minimum(x, 1), 1),
    ):
        cuts = {"strain": Cuts("optimal", 2, min_samples=1)}
        asked = recipe(level=None, cuts=cuts, dictionary=terms, max_terms=most)
        (cut,) = segment([curve_of({"strain": x, "force": force})], asked)
        assert cut.boundaries[0].tolist() == [0, at, 20]


def test_a_grid_of_two_variables():
    rng = np.random.default_rng(0)
    curve = changed(curves(n=400, held_out=())[0], load=rng.uniform(0, 10, 400))
    segmented = cut(curve, {"strain": Cuts("even", 3), "load": Cuts("even", 2)})
    assert [s.cell for s in segmented.segments] == [(1, 1), (1, 2), (2, 1), (2, 2), (3, 1), (3, 2)]
    assert segmented.segments[3].id == "pressure=80/strain:2;load:2"
    assert sum(len(s.rows) for s in segmented.segments) >= 400


def exhaustive(table, cells, count):
    """Least cost of all partitions, each tried."""
    return min(
        sum(table[i, j] for i, j in pairwise((0, *inner, cells)))
        for inner in combinations(range(1, cells), count - 1)
    )


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1), st.floats(0, 0.6))
def test_equals_exhaustive_search(cells, count, seed, forbidden):
    rng = np.random.default_rng(seed)
    table = rng.exponential(size=(cells + 1, cells + 1))
    table[rng.random(table.shape) < forbidden] = np.inf
    least = exhaustive(table, cells, count) if count <= cells else np.inf
    places = optimal_partition(lambda i, j: table[i, j], cells, count)
    if np.isinf(least):
        assert places is None
        return
    assert len(places) == count - 1
    assert sum(table[i, j] for i, j in pairwise((0, *places, cells))) == pytest.approx(
        least, rel=1e-9, abs=1e-8
    )


@pytest.mark.parametrize("cost", [0.0, 1e-6, 1.0, 1e6])
def test_of_equals_the_first(cost):
    assert optimal_partition(lambda _i, _j: cost, 6, 3) == (1, 2)
    assert optimal_partition(lambda i, j: cost * (1 + 1e-13 * (i - j)), 6, 3) == (1, 2)


@pytest.mark.parametrize(
    ("counts", "kept"),
    [
        ([5, 1, 5, 9], [0, 2, 3, 4]),  # the left one of equals
        ([9, 1, 3, 9], [0, 1, 3, 4]),
        ([1, 9, 3], [0, 2, 3]),
        ([3, 9, 1], [0, 1, 3]),
        ([2, 1, 2], [0, 3]),
        ([4, 3, 5], [0, 1, 2, 3]),
        ([1, 1], [0, 2]),  # too few samples for one segment
    ],
)
def test_the_segment_of_the_fewest_joins_the_neighbour_of_fewer(counts, kept):
    x = np.repeat(np.arange(len(counts)) + 0.5, counts)
    found = joined_segments(np.arange(len(counts) + 1.0), x, 3, np.ones(len(x), dtype=bool))
    assert found.tolist() == kept


def test_a_sample_on_a_boundary_counts_for_both_segments():
    ends, training = np.arange(3.0), np.ones(3, dtype=bool)
    assert joined_segments(ends, ends, 2, training).tolist() == [0, 1, 2]
    assert joined_segments(ends, ends, 3, training).tolist() == [0, 2]


def test_too_few_samples_say_what_to_do():
    (sample,) = curves(levels=(150.0,), n=20)
    with pytest.raises(
        DataError, match="cannot be cut into 4 segments of at least 10 samples"
    ) as error:
        segment([sample], recipe(cuts={"strain": Cuts("optimal", 4)}))
    assert "segment.strain.min_samples" in error.value.remedy


WIDE = 0.4  # a tenth of the range 2 to 6
CLOSE = WIDE * 1e-9  # by so much, rounding may bring two places nearer


@pytest.mark.parametrize(
    ("corners", "count", "chosen"),
    [
        ({3.0: 1, 4.0: -3, 5.0: 2}, 2, [4]),
        ({3.0: 1, 4.0: -3, 5.0: 2}, 3, [4, 5]),
        ({3.0: 1, 4.0: -3, 5.0: 2}, 9, [3, 4, 5]),
        ({3.0: 2, 4.0: 2, 5.0: 2}, 2, [3]),  # of equals the first
        *(({3.0: 2, 3.0 + WIDE - close: 1}, 9, [3, 3.4]) for close in (0, CLOSE / 2)),
        ({3.0: 2, 3.0 + WIDE - 5 * CLOSE: 1}, 9, [3]),
        ({3.0: 1, 3.0 + WIDE - 5 * CLOSE: 2}, 9, [3.4]),
        ({2 + WIDE - CLOSE / 2: 1, 6 - WIDE + CLOSE / 2: 2}, 9, [2.4, 5.6]),
        ({2 + WIDE * (1 - 1e-9): 1, 6 - WIDE * (1 - 1e-9): 2}, 9, [2.4, 5.6]),
        ({2 + WIDE - 5 * CLOSE: 1, 6 - WIDE + 5 * CLOSE: 2}, 9, []),
    ],
)
def test_places_of_corners_by_hand(corners, count, chosen, monkeypatch):
    at = sorted({*corners, *np.arange(2.05, 6, 0.1).tolist()})
    change = np.array([corners.get(place, 0.0) for place in at])
    monkeypatch.setattr(
        segmentation, "slope_change", lambda _x, _y, _window: (np.array(at), change)
    )
    x = np.linspace(2, 6, 401)
    assert gradient_boundaries(x, x, count) == pytest.approx(chosen)


@pytest.mark.parametrize(("samples", "corners"), [(4, 0), (5, 1)])
@pytest.mark.parametrize("side", [1, -1])
def test_a_corner_needs_five_samples_on_either_side(samples, corners, side, monkeypatch):
    found = np.linspace(-1, 1, 5), np.array([0, 0, 3.0, 0, 0])
    monkeypatch.setattr(segmentation, "slope_change", lambda _x, _y, _window: found)
    x = side * np.concatenate([np.linspace(-1, -0.5, samples), np.linspace(0.5, 1, 50)])
    assert len(gradient_boundaries(x, x, 2)) == corners


@given(st.integers(0, 1000))
def test_changes_of_slope_are_those_of_moving_averages(seed):
    """Sums over the places of a window, written out, for samples that are spread unevenly."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-3, 9, 60), rng.normal(size=60)
    places, medians = segmentation.running_median(x, y, 3.0)
    last = len(places) - 1

    def average(values, i):
        return np.mean(values[max(0, i - 5) : i + 6])

    def slope(i, j):
        rise = average(medians, j) - average(medians, i)
        return rise / (average(places, j) - average(places, i)) if j > i else np.nan

    expected = [slope(i, min(last, i + 10)) - slope(max(0, i - 10), i) for i in range(last + 1)]
    at, change = slope_change(x, y, 3.0)
    assert at.tolist() == places.tolist()
    np.testing.assert_allclose(change, np.nan_to_num(expected), atol=1e-9)
