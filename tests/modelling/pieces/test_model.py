"""The fused model: continuity, extrapolation, invariance."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import QUANTITIES, curves, force, recipe

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Cuts

seeds = st.integers(0, 2**32 - 1)


def built(samples=None, **changes):
    return build("imagined", samples or curves(), recipe(**changes), QUANTITIES)


def at(pressure, strain):
    pressure, strain = np.broadcast_arrays(np.asarray(pressure, float), np.asarray(strain, float))
    return {"pressure": pressure.ravel().copy(), "strain": strain.ravel().copy()}


def test_the_model_follows_its_training_curves_and_interpolates():
    model = built(max_terms=3)
    for level, tolerance in ((80, 3), (150, 3), (350, 6), (250, 40)):
        strain = np.linspace(0, 0.05 + 0.0005 * min(level, 150), 50)
        error = predict(model, at(level, strain)) - force(level, strain)
        assert np.sqrt(np.mean(error**2)) < tolerance


@pytest.mark.parametrize("far", [1e6, 1e12])
def test_an_offset_changes_neither_the_terms_nor_the_curve(far):
    """Lengths and forces far from zero, in steps that a double still holds there (2^-13 at 1e12), are cut, scaled and fitted as near it."""
    near = tuple(replace(c, columns={**c.columns, "strain": np.rint(1e6 * c.columns["strain"])}) for c in curves())
    near = tuple(replace(c, columns={**c.columns, "force": np.rint(1024 * c.columns["force"]) / 1024}) for c in near)
    away = tuple(replace(c, columns={**c.columns, "strain": far + c.columns["strain"], "force": far + c.columns["force"]}) for c in near)
    one, two = built(near, max_terms=3), built(away, max_terms=3)
    for a, b in zip(one.body.curves, two.body.curves, strict=True):
        assert [f.terms for f in a.segments] == [f.terms for f in b.segments]
    strain = np.rint(np.linspace(0, 9e4, 200))
    np.testing.assert_allclose(predict(two, at(150, far + strain)) - far, predict(one, at(150, strain)), rtol=0, atol=4e-16 * far + 1e-8)


@settings(max_examples=15)
@given(seeds, st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.integers(1, 3))
def test_positive_units_change_neither_selection_nor_scaled_theta(seed, a, b, k):
    plain = built(curves(seed=seed), max_terms=k)
    samples = tuple(
        replace(c, columns={"pressure": c.columns["pressure"], "strain": a * c.columns["strain"], "force": b * c.columns["force"]})
        for c in curves(seed=seed)
    )
    other = built(samples, max_terms=k)
    for one, two in zip(plain.body.curves, other.body.curves, strict=True):
        for f, g in zip(one.segments, two.segments, strict=True):
            assert f.terms == g.terms
            assert f.scaling.placement == g.scaling.placement
            np.testing.assert_allclose(g.theta, f.theta, rtol=1e-6, atol=1e-9)
    x = np.linspace(0, 0.1, 50)
    np.testing.assert_allclose(predict(other, at(200, a * x)), b * predict(plain, at(200, x)), rtol=1e-6, atol=1e-6 * b)


def shuffled(curve, rng):
    """The curve with its rows in another order; its strains are rounded, so that some are equal."""
    order = rng.permutation(curve.size)
    return replace(curve, columns={name: x[order] for name, x in curve.columns.items()}, held_out=curve.held_out[order])


WAYS = [{"max_terms": 2}, {"cuts": {"strain": Cuts("optimal", 2, grid=5)}}, {"cuts": {"strain": Cuts("gradient", 3)}, "align": "threshold"}]


@settings(max_examples=12)
@given(seeds, st.sampled_from(WAYS))
def test_neither_the_order_of_rows_nor_held_out_forces_matter(seed, way):
    rng = np.random.default_rng(seed)
    held = rng.random(120) < 0.3
    plain = [replace(c, columns={**c.columns, "strain": np.round(c.columns["strain"], 4)}, held_out=held) for c in curves(seed=seed)]
    spoilt = [replace(c, columns={**c.columns, "force": np.where(held, 1e6 * rng.random(120), c.columns["force"])}) for c in plain]
    one, two = built(plain, **way), built([shuffled(c, rng) for c in spoilt], **way)
    for f, g in zip(one.body.curves, two.body.curves, strict=True):
        assert f.threshold == g.threshold
        np.testing.assert_array_equal(f.boundaries, g.boundaries)
        for p, q in zip(f.segments, g.segments, strict=True):
            assert p.terms == q.terms
            np.testing.assert_array_equal(p.theta, q.theta)


def test_several_terms_saturate_by_default_and_one_term_continues():
    assert built(max_terms=1).body.fusion.extrapolation["strain"] == ("continue", "continue")
    several = built(max_terms=3)
    assert several.body.fusion.extrapolation["strain"] == ("saturate", "saturate")
    assert any("saturates" in note for note in several.notes)
    asked = built(max_terms=3, extrapolation="continue")
    assert any("pressure=80" in note and "explode" in note for note in asked.notes)


def clustered(n=200):
    """Samples that leave most of the narrow segment beside a wide one empty."""
    strain = np.concatenate([np.linspace(0, 0.010, n // 2), np.linspace(0.04, 0.2, n // 2)])
    noise = np.random.default_rng(0).normal(0, 10, n)
    columns = {"pressure": np.full(n, 150.0), "strain": strain, "force": 500 * np.exp(-strain / 0.1) + noise}
    return (Curve("pressure=150", 150.0, columns, np.zeros(n, bool), ()),)


def test_a_narrow_segment_beside_a_wide_one_does_not_explode_in_the_zone():
    """M2 eq 11 carries the left function by a quarter of the right segment's width: many times its own."""
    model = built(clustered(), cuts={"strain": Cuts("breakpoints", at=(0.011,))}, max_terms=4, tolerance=0.0)
    strain = np.linspace(0, 0.2, 500)
    assert np.abs(predict(model, at(150, strain)) - 500 * np.exp(-strain / 0.1)).max() < 60
    carried = replace(model, body=replace(model.body, fusion=replace(model.body.fusion, hold="none")))
    assert np.abs(predict(carried, at(150, strain)) - 500 * np.exp(-strain / 0.1)).max() > 500


def test_outside_range_follows_each_curves_own_range():
    model = built()
    flags = outside_range(model, at([80, 80, 115, 115, 350, 79, 351], [0.09, 0.0901, 0.1074, 0.1076, 0.225, 0.01, 0.01]))
    assert flags.tolist() == [False, True, False, True, False, True, True]


def test_two_segmented_variables_without_levels():
    samples = curves(held_out=())
    model = build(
        "grid",
        samples,
        recipe(level=None, cuts={"strain": Cuts("even", 2)}, dictionary=("1", "strain", "pressure", "pressure*strain"), max_terms=4),
        QUANTITIES,
    )
    assert [c.curve for c in model.body.curves] == ["all"]
    x = {name: np.concatenate([c.columns[name] for c in samples]) for name in ("pressure", "strain", "force")}
    assert np.sqrt(np.mean((predict(model, x) - x["force"]) ** 2)) < 0.1 * np.abs(x["force"]).max()


def test_too_few_samples_for_a_segment():
    with pytest.raises(DataError, match=r"pressure=80/strain:1: 2 training sample\(s\), too few for 3 term"):
        built(curves(n=5), max_terms=3)


def test_a_term_that_is_not_finite_names_the_segment():
    with pytest.raises(DataError, match="pressure=80/strain:1"):
        built(dictionary=("log(strain - 2)",))
