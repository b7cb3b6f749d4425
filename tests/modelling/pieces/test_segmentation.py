"""Cutting curves: each over its own range, every sample in a segment, none of the held-out ones."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import curves

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.segmentation import joined, segment_curve, segment_id, training_curves


def cut(curve, cuts):
    def no_cost(_curve, _rows):
        raise AssertionError("only `optimal` asks for costs")

    return segment_curve(curve, cuts, "force", no_cost)


def line(low, high, n=30):
    strain = np.linspace(low, high, n)
    return Curve("a", None, {"strain": strain, "force": 100 * strain}, np.zeros(n, bool), ())


@settings(deadline=None)
@given(st.integers(1, 8), st.integers(0, 100))
def test_every_training_sample_lies_in_a_segment_and_no_other(count, seed):
    curve = curves(seed=seed)[0]
    held = np.random.default_rng(seed).random(curve.size) < 0.3
    curve = replace(curve, held_out=held)
    segmented = cut(curve, {"strain": Cuts("even", count)})
    rows = np.concatenate([s.rows for s in segmented.segments])
    assert set(rows.tolist()) == set(np.flatnonzero(~held).tolist())
    for segment, low, high in zip(segmented.segments, segmented.boundaries[0][:-1], segmented.boundaries[0][1:], strict=True):
        x = curve.columns["strain"][segment.rows]
        assert low <= x.min()
        assert x.max() <= high


def test_each_curve_is_cut_over_its_own_range():
    for curve in curves():
        segmented = cut(replace(curve, held_out=np.zeros(curve.size, bool)), {"strain": Cuts("even", 4)})
        np.testing.assert_allclose(segmented.boundaries[0], np.linspace(0, curve.columns["strain"].max(), 5))
        assert segmented.limits["strain"] == (0.0, curve.columns["strain"].max())


def test_a_sample_on_a_boundary_belongs_to_both_segments():
    curve = replace(curves(n=121)[0], held_out=np.zeros(121, bool))
    first, second, *_ = cut(curve, {"strain": Cuts("even", 4)}).segments
    assert set(first.rows) & set(second.rows) == {30}


def test_breakpoints_beyond_a_short_curve_are_left_out():
    np.testing.assert_allclose(cut(line(0, 0.09), {"strain": Cuts("breakpoints", at=(0.05, 0.1, 0.15))}).boundaries[0], [0, 0.05, 0.09])


def test_ids():
    assert segment_id("pressure=150", ["strain"], [2]) == "pressure=150/strain:2"
    assert segment_id("a", ["strain", "pressure"], [2, 1]) == "a/strain:2;pressure:1"
    assert segment_id("a", [], []) == "a/all"


def test_a_segment_without_samples_is_refused_with_its_name():
    curve = replace(curves()[0], held_out=np.zeros(120, bool))
    strain = np.where(curve.columns["strain"] < 0.05, 0.0, curve.columns["strain"])
    with pytest.raises(DataError, match="pressure=80/strain:2: no training sample"):
        cut(replace(curve, columns={**curve.columns, "strain": strain}), {"strain": Cuts("even", 4)})


def test_a_grid_of_two_variables():
    rng = np.random.default_rng(0)
    curve = replace(curves(n=400)[0], held_out=np.zeros(400, bool))
    curve = replace(curve, columns={**curve.columns, "load": rng.uniform(0, 10, 400)})
    segmented = cut(curve, {"strain": Cuts("even", 3), "load": Cuts("even", 2)})
    assert [s.cell for s in segmented.segments] == [(1, 1), (1, 2), (2, 1), (2, 2), (3, 1), (3, 2)]
    assert sum(len(s.rows) for s in segmented.segments) >= 400


def test_without_levels_all_recordings_are_one_training_curve():
    pooled = training_curves(curves(), by_level=False)
    assert [curve.id for curve in pooled] == ["all"]
    assert pooled[0].size == 480
    assert len(training_curves(curves(), by_level=True)) == 3


@given(st.lists(st.floats(0, 1), min_size=2, max_size=40, unique=True), st.integers(1, 8), st.integers(1, 12))
def test_joined_segments_hold_enough_samples(values, count, least):
    x = np.array(values)
    boundaries = np.linspace(x.min(), x.max(), count + 1)
    found = joined(boundaries, x, least)
    assert set(found) <= set(boundaries)
    assert (found[0], found[-1]) == (boundaries[0], boundaries[-1])
    counts = [np.sum((x >= low) & (x <= high)) for low, high in itertools.pairwise(found)]
    assert len(counts) == 1 or min(counts) >= least
    if min(np.sum((x >= low) & (x <= high)) for low, high in itertools.pairwise(boundaries)) >= least:
        assert len(found) == len(boundaries)
