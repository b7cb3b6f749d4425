"""How far a residual on a backbone is carried, decided on left-out training data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import QUANTITIES, curves, recipe

from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.cross_validation import BACKBONE, RESIDUAL, SHRUNKEN, LeftOut, with_trusted_residual

LEVELS = (80.0, 150.0, 250.0, 350.0, 450.0)


def trusted(samples, **changes):
    made = recipe(max_terms=3, **changes)
    formula = fit_formula("polynomial_2", samples, "force")
    return with_trusted_residual(build("m", samples, made, QUANTITIES, formula), samples, made, QUANTITIES)


def bumped(samples, height):
    """A bump of each curve's own height, which no formula explains."""
    moved = []
    for number, curve in enumerate(samples):
        bump = height(number) * np.sin(np.pi * curve.columns["strain"] / curve.columns["strain"].max())
        moved.append(replace(curve, columns={**curve.columns, "force": curve.columns["force"] + bump}))
    return moved


def backbone_of(model, columns):
    return literature.get(model.backbone.name).predict(model.backbone.parameters, columns)


parts = st.integers(2, 30).flatmap(lambda n: st.tuples(*[st.lists(st.floats(-100, 100), min_size=n, max_size=n).map(np.array)] * 3))


@settings(deadline=None)
@given(parts)
def test_no_share_is_better_on_the_left_out_data(arrays):
    left_out = LeftOut(*arrays, folds=2)
    g = left_out.share
    assert 0 <= g <= 1
    assert all(left_out.rmse(g) <= left_out.rmse(share) * (1 + 1e-9) + 1e-9 for share in np.linspace(0, 1, 21))


def test_a_residual_that_runs_through_the_levels_is_carried_whole():
    model = trusted(curves(levels=LEVELS, held_out=()))
    assert model.body.fusion.shrink > 0.8
    by_choice = {error.choice: error.rmse for error in model.body.cross_validation}
    assert list(by_choice) == [BACKBONE, RESIDUAL, SHRUNKEN]
    assert by_choice[SHRUNKEN] <= min(by_choice.values()) * (1 + 1e-9)
    assert {error.folds for error in model.body.cross_validation} == {3}
    assert f"{model.body.fusion.shrink:.0%} of the residual on polynomial_2 is carried" in model.notes[-1]


def test_a_residual_that_jumps_from_level_to_level_counts_at_the_levels_alone():
    samples = bumped(curves(levels=LEVELS, held_out=()), lambda number: 150 * (-1) ** number)
    model = trusted(samples)
    assert model.body.fusion.shrink < 0.2
    for curve in samples:
        at = {**curve.columns, "pressure": np.full(curve.size, curve.level)}
        gain = np.sqrt(np.mean((predict(model, at) - curve.columns["force"]) ** 2))
        assert gain < 0.3 * np.sqrt(np.mean((backbone_of(model, at) - curve.columns["force"]) ** 2))
    middle = {"pressure": np.full(40, 200.0), "strain": np.linspace(0, 0.12, 40)}
    whole = replace(model, body=replace(model.body, fusion=replace(model.body.fusion, shrink=1.0)))
    alone = backbone_of(model, middle)
    np.testing.assert_allclose(predict(model, middle) - alone, model.body.fusion.shrink * (predict(whole, middle) - alone), atol=1e-9)


@pytest.mark.parametrize("shrink", [0.0, 0.35, 1.0])
def test_a_given_share_is_taken_as_it_is(shrink):
    samples = curves(held_out=())
    formula = fit_formula("polynomial_2", samples, "force")
    assert build("m", samples, recipe(shrink=shrink), QUANTITIES, formula).body.fusion.shrink == shrink


def test_without_a_backbone_nothing_is_shrunk():
    assert build("m", curves(), recipe(shrink=0.3), QUANTITIES).body.fusion.shrink == 1.0


def test_between_two_levels_the_backbone_stands_alone():
    model = trusted(bumped(curves(levels=(150.0, 350.0), held_out=()), lambda _number: 80))
    assert model.body.fusion.shrink == 0.0
    assert any("two levels" in note for note in model.notes)
    middle = {"pressure": np.full(20, 250.0), "strain": np.linspace(0, 0.12, 20)}
    np.testing.assert_allclose(predict(model, middle), backbone_of(model, middle))


def test_pooled_data_drop_a_residual_that_does_harm():
    rng = np.random.default_rng(0)
    samples = [
        replace(c, columns={**c.columns, "force": 2 * c.columns["pressure"] * (1 - c.columns["strain"]) + rng.normal(0, 5, c.size)})
        for c in curves(held_out=())
    ]
    model = trusted(samples, level=None, tolerance=0.0)
    assert not any(curve.segments for curve in model.body.curves)
    assert model.body.cross_validation[0].rmse < model.body.cross_validation[1].rmse
    assert "keeps polynomial_2 alone" in model.notes[-1]
    strain = {"pressure": np.full(9, 200.0), "strain": np.linspace(0, 0.1, 9)}
    np.testing.assert_allclose(predict(model, strain), backbone_of(model, strain))


@settings(deadline=None, max_examples=3)
@given(st.integers(0, 1000))
def test_held_out_forces_decide_nothing(seed):
    samples = curves(seed=seed)
    rng = np.random.default_rng(seed)
    spoilt = [
        replace(c, columns={**c.columns, "force": np.where(c.held_out, rng.permutation(c.columns["force"]) * 9, c.columns["force"])})
        for c in samples
    ]
    one, two = trusted(samples), trusted(spoilt)
    assert one.body.fusion == two.body.fusion
    assert one.body.cross_validation == two.body.cross_validation
    assert one.notes == two.notes
