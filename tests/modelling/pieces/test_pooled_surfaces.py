"""Scattered points fitted as one surface: cells of two variables that are joined, folds along both, the share of the residual."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import QUANTITIES, curves, force, recipe

from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces import backbone_choice
from mapmore_cli.modelling.pieces.backbone_choice import MARGIN, SAMPLES, candidates, choose_backbone, thin
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.cross_validation import inner_folds, leave_out, outer_folds, with_trusted_residual
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.segmentation import joined_cells, segment_curve

SURFACE = ("1", "pressure", "strain", "pressure^2", "pressure*strain", "strain^2")
SETTINGS = {"level": None, "cuts": {}, "dictionary": SURFACE, "max_terms": 3}


def scattered(n=60, noise=1.0, seed=0):
    """Points of the imagined muscle, no two at one pressure, none beyond its free strain."""
    rng = np.random.default_rng(seed)
    pressure = rng.uniform(80, 400, n)
    strain = rng.uniform(0, 1, n) * (0.05 + 0.0005 * pressure)
    columns = {"pressure": pressure, "strain": strain, "force": force(pressure, strain) + rng.normal(0, noise, n)}
    return (Curve("table", None, columns, np.zeros(n, dtype=bool), ("table",)),)


shapes = st.tuples(st.integers(1, 4), st.integers(1, 4))


@settings(deadline=None)
@given(shapes, st.lists(st.integers(0, 15), min_size=1, max_size=40), st.integers(0, 12))
def test_joined_cells_hold_enough_samples_and_lose_none(shape, places, least):
    every = list(product(range(1, shape[0] + 1), range(1, shape[1] + 1)))
    cell_of = [every[place % len(every)] for place in places]
    cells = {cell: np.array([own == cell for own in cell_of]) for cell in every}
    found = joined_cells(cells, least, (True, True))
    assert list(found) == every
    for cell, mask in found.items():
        assert mask[cells[cell]].all()
        assert mask.sum() >= min(least, len(places))
        together = [other for other in every if np.array_equal(found[other], mask)]
        assert mask.sum() == sum(cells[other].sum() for other in together) or not mask.any()
    if all(mask.sum() >= least for mask in cells.values()):
        assert all(np.array_equal(found[cell], cells[cell]) for cell in every)


def test_directions_are_never_joined():
    cells = {(1, 1): np.array([True, False]), (1, 2): np.array([False, True])}
    found = joined_cells(cells, 2, (True, False))
    assert {cell: mask.tolist() for cell, mask in found.items()} == {(1, 1): [True, False], (1, 2): [False, True]}


def test_an_empty_corner_takes_the_function_of_its_neighbour():
    """At low pressure there is no large strain: that cell is empty, and an even cut of both alone is refused."""
    (curve,) = scattered(seed=3)
    cut = {"pressure": Cuts("even", 3, min_samples=8), "strain": Cuts("even", 3, min_samples=8)}
    segmented = segment_curve(curve, cut, "force", lambda _curve, _rows: 0.0)
    counts = {s.cell: len(s.rows) for s in segmented.segments}
    sides = [len(b) - 1 for b in segmented.boundaries]
    assert len(counts) == sides[0] * sides[1] > 1
    assert min(counts.values()) >= 8
    model = build("m", (curve,), recipe(**SETTINGS | {"cuts": cut}), QUANTITIES)
    corner = {"pressure": np.array([85.0]), "strain": np.array([0.24])}
    assert np.isfinite(predict(model, corner)).all()


def test_folds_are_the_inner_blocks_along_every_input():
    samples = scattered()
    made = recipe(**SETTINGS)
    inner, outer = inner_folds(samples, made), outer_folds(samples, made)
    assert (len(inner), len(outer)) == (6, 4)
    for name, folds in (("pressure", inner[:3]), ("strain", inner[3:])):
        x = samples[0].columns[name]
        ends = sorted((x[out].min(), x[out].max()) for (out,) in folds)
        assert x.min() < ends[0][0]
        assert ends[-1][1] < x.max()
        assert all(before[1] < after[0] for before, after in pairwise(ends))
    assert all(out.any() for fold in (*inner, *outer) for out in fold)


def test_curves_with_levels_are_left_out_whole_where_they_are_pooled():
    samples = curves(levels=(80.0, 150.0, 250.0, 350.0), held_out=(150.0,), n=20)
    made = recipe(**SETTINGS)
    made = replace(made, pooled="pressure")
    by_level = [fold for fold in inner_folds(samples, made) if sum(out.any() for out in fold) == 1]
    assert [[out.sum() for out in fold] for fold in by_level] == [[0, 0, 20, 0]]


@settings(deadline=None, max_examples=4)
@given(st.integers(0, 1000))
def test_all_of_the_residual_counts_with_the_share_that_left_out_blocks_support(seed):
    samples, made = scattered(noise=8.0, seed=seed), recipe(**SETTINGS)
    formula = fit_formula("polynomial_2", samples, "force")
    whole = build("m", samples, made, QUANTITIES, formula)
    trusted = with_trusted_residual(whole, samples, made, QUANTITIES)
    share = leave_out(samples, made, QUANTITIES, "polynomial_2", inner_folds(samples, made)).share
    columns = {name: samples[0].columns[name] for name in ("pressure", "strain")}
    alone = predict(replace(whole, body=replace(whole.body, curves=tuple(replace(c, segments=()) for c in whole.body.curves))), columns)
    expected = alone + share * (predict(whole, columns) - alone)
    np.testing.assert_allclose(predict(trusted, columns), expected, rtol=1e-10, atol=1e-8)
    assert bool(trusted.body.segments) == (share > 0)


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_given_share_counts_on_a_surface_as_well(share):
    samples = scattered()
    formula = fit_formula("polynomial_2", samples, "force")
    whole, part = (build("m", samples, recipe(**SETTINGS, shrink=given), QUANTITIES, formula) for given in (1.0, share))
    columns = {name: samples[0].columns[name] for name in ("pressure", "strain")}
    alone = predict(replace(whole, body=replace(whole.body, curves=tuple(replace(c, segments=()) for c in whole.body.curves))), columns)
    np.testing.assert_allclose(predict(part, columns), alone + share * (predict(whole, columns) - alone), rtol=1e-10, atol=1e-8)


def test_a_backbone_is_chosen_for_a_surface_as_if_every_candidate_were_tried_on_every_fold(monkeypatch):
    """A candidate that first folds rule out is tried on no more; the choice is that of all folds."""
    samples, made = scattered(n=48, seed=2), recipe(**SETTINGS)
    some = (None, "chou_hannaford", "polynomial_2", "polynomial_5", "sarosi")
    assert set(some) < set(candidates(samples, "force"))
    monkeypatch.setattr(backbone_choice, "candidates", lambda _curves, _target: some)
    choice = choose_backbone(samples, made, QUANTITIES)
    errors = {}
    thinned = [thin(curve, None) for curve in samples]
    assert thinned[0].size < SAMPLES
    for name in some:
        left_out = leave_out(thinned, made, QUANTITIES, name, inner_folds(thinned, made))
        errors[name] = left_out.rmse(1.0 if name is None else left_out.share)
    assert errors[choice.name] <= (1 + MARGIN) * min(errors.values())
    assert "with each of 6 inner training blocks left out in turn" in choice.note
