"""Optimal boundaries: as good as trying all of them."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import curves, recipe

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.pieces.boundaries import optimal_partition
from mapmore_cli.modelling.pieces.build import fit, segment
from mapmore_cli.modelling.pieces.recipe import Cuts


def exhaustive(table, cells, count):
    """Least cost of all partitions, each tried."""
    return min(sum(table[i, j] for i, j in pairwise((0, *inner, cells))) for inner in combinations(range(1, cells), count - 1))


@settings(deadline=None)
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
    assert sum(table[i, j] for i, j in pairwise((0, *places, cells))) == pytest.approx(least, rel=1e-9, abs=1e-8)


def test_of_equals_the_first():
    assert optimal_partition(lambda _i, _j: 1.0, 6, 3) == (1, 2)
    assert optimal_partition(lambda i, j: 1.0 + 1e-13 * (i - j), 6, 3) == (1, 2)


def sse(samples, made):
    """Summed squared errors of the segments' fits, in the unit of the target."""
    chosen = fit(samples, segment(samples, made), made)
    return sum(one.selection.sse * one.scaling.y_slope**2 for one in chosen)


@pytest.mark.parametrize(("max_terms", "count"), [(1, 3), (2, 2)])
def test_real_fits_equal_exhaustive_search(max_terms, count):
    """Every set of boundaries on the grid tried as given breakpoints, through the fits that the model would have."""
    (sample,) = curves(levels=(150.0,), n=60)
    grid = np.linspace(0, sample.columns["strain"].max(), 9)
    best = sse([sample], recipe(cuts={"strain": Cuts("optimal", count, grid=8, min_samples=4)}, max_terms=max_terms))
    every = [
        sse([sample], recipe(cuts={"strain": Cuts("breakpoints", at=tuple(grid[list(inner)]))}, max_terms=max_terms))
        for inner in combinations(range(1, 8), count - 1)
    ]
    assert best == pytest.approx(min(every), rel=1e-9)
    assert min(every) < 0.9 * np.median(every)


@pytest.mark.parametrize("count", [2, 4])
def test_never_worse_than_even_segments_on_the_same_grid(count):
    samples = curves()
    even = sse(samples, recipe(cuts={"strain": Cuts("even", count)}))
    assert sse(samples, recipe(cuts={"strain": Cuts("optimal", count, grid=20)})) <= even * (1 + 1e-9)


def test_a_planted_corner_is_found_on_thousands_of_samples():
    rng = np.random.default_rng(1)
    x = rng.uniform(0, 10, 5000)
    y = np.where(x < 6, x, 6 - 3 * (x - 6)) + rng.normal(0, 0.1, 5000)
    curve = Curve("a", None, {"strain": x, "force": y}, np.zeros(5000, bool), ())
    (cut,) = segment([curve], recipe(level=None, cuts={"strain": Cuts("optimal", 2, grid=10)}, dictionary=("1", "strain"), max_terms=2))
    assert cut.boundaries[0][1] == pytest.approx(6, abs=0.01)


def test_held_out_forces_and_the_order_of_rows_do_not_matter():
    (sample,) = curves(levels=(150.0,))
    rng = np.random.default_rng(0)
    held = rng.random(sample.size) < 0.3
    order = rng.permutation(sample.size)
    spoilt = np.where(held, 1e6, sample.columns["force"])
    plain = replace(sample, held_out=held)
    other = replace(sample, columns={**sample.columns, "force": spoilt}, held_out=held)
    shuffled = replace(other, columns={name: x[order] for name, x in other.columns.items()}, held_out=held[order])
    made = recipe(cuts={"strain": Cuts("optimal", 3, grid=8)}, max_terms=2)
    expected = segment([plain], made)[0].boundaries[0]
    np.testing.assert_array_equal(segment([other], made)[0].boundaries[0], expected)
    np.testing.assert_array_equal(segment([shuffled], made)[0].boundaries[0], expected)


def test_too_few_samples_say_what_to_do():
    (sample,) = curves(levels=(150.0,), n=20)
    with pytest.raises(DataError, match="cannot be cut into 4 segments of at least 10 samples") as error:
        segment([sample], recipe(cuts={"strain": Cuts("optimal", 4)}))
    assert "segment.strain.min_samples" in error.value.remedy
