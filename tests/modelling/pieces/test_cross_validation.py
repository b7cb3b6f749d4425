"""What left-out training data decide: the share of a residual on a backbone, and the backbone; of
levels, and of one surface.
"""

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from common import curve_of
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import QUANTITIES, at, built, changed, curves, force, joined, recipe

from mapmore_cli.domain.errors import FitError
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces import backbone_choice, cross_validation
from mapmore_cli.modelling.pieces.backbone_choice import (
    FEW,
    choose_backbone,
    possible_backbones,
    simplest_backbone,
    thin,
)
from mapmore_cli.modelling.pieces.cross_validation import (
    LeftOutErrors,
    _of_fewer_samples,
    blocks_in,
    in_curve,
    inner_folds,
    leave_out,
    repeats_left_out,
)
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.residual_share import (
    BACKBONE,
    RESIDUAL,
    SHRUNKEN,
    with_trusted_residual,
)

LEVELS = (80.0, 150.0, 250.0, 350.0)
SETTINGS = {
    "max_terms": 2,
    "cuts": {"strain": Cuts("even", 2)},
    "dictionary": ("1", "strain", "strain^2"),
}


def trusted(samples, **changes):
    made = recipe(max_terms=3, **changes)
    return with_trusted_residual(
        on_polynomial(samples, max_terms=3, **changes), samples, made, QUANTITIES
    )


def on_polynomial(samples, **changes):
    return built(samples, fit_formula("polynomial_2", samples, "force"), **changes)


def bumped(samples, height):
    """A bump of each curve's own height, which no formula explains."""
    moved = []
    for number, curve in enumerate(samples):
        bump = height(number) * np.sin(
            np.pi * curve.columns["strain"] / curve.columns["strain"].max()
        )
        moved.append(changed(curve, force=curve.columns["force"] + bump))
    return moved


def backbone_of(model, columns):
    return literature.get(model.backbone.name).predict(model.backbone.parameters, columns)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_the_share_does_not_depend_on_the_unit(unit):
    measured, backbone = np.array([3.0, 2.0, 4.0]), np.array([2.0, 2.5, 3.0])
    residual = np.array([2.0, 0.0, 1.0])
    left_out = LeftOutErrors(*(unit * x for x in (measured, backbone, residual)), 2)
    assert left_out.share == pytest.approx(0.6)
    assert left_out.rmse(0.6) < min(left_out.rmse(0.55), left_out.rmse(0.65))
    for size, share in ((-1.0, 0), (0.0, 0), (0.1, 1)):
        assert replace(left_out, residual=unit * size * residual).share == share


def test_a_residual_that_runs_through_the_levels_is_carried_whole():
    model = trusted(curves(levels=(*LEVELS, 450.0), held_out=()))
    assert model.body.fusion.shrink > 0.8
    by_choice = {error.choice: error.rmse for error in model.body.cross_validation}
    assert list(by_choice) == [BACKBONE, RESIDUAL, SHRUNKEN]
    assert by_choice[SHRUNKEN] <= min(by_choice.values()) * (1 + 1e-9)
    assert {error.folds for error in model.body.cross_validation} == {3}
    assert f"{model.body.fusion.shrink:.0%} of the correction of polynomial_2 by" in model.notes[-1]


def test_a_residual_that_jumps_from_level_to_level_counts_at_the_levels_alone():
    samples = bumped(
        curves(levels=(*LEVELS, 450.0), held_out=()), lambda number: 150 * (-1) ** number
    )
    model = trusted(samples)
    assert model.body.fusion.shrink < 0.2
    for curve in samples:
        places = at(curve.level, curve.columns["strain"])
        own, alone = (
            (values - curve.columns["force"]).std()
            for values in (predict(model, places), backbone_of(model, places))
        )
        assert own < 0.3 * alone
    middle = at(200, np.linspace(0, 0.12, 40))
    whole = joined(model, shrink=1.0)
    alone = backbone_of(model, middle)
    np.testing.assert_allclose(
        predict(model, middle) - alone,
        model.body.fusion.shrink * (predict(whole, middle) - alone),
        atol=1e-9,
    )


@pytest.mark.parametrize("pooled", [{}, {"level": None}])
def test_pieces_that_help_neither_between_levels_nor_within_them_are_left_out(pooled):
    """Noise on what the backbone explains: the residual is kept at the levels only if left-out
    blocks of the curves gain by it; that of pooled data only if left-out levels do.
    """
    rng = np.random.default_rng(0)
    samples = [
        changed(
            c,
            force=2 * c.columns["pressure"] * (1 - c.columns["strain"]) + rng.normal(0, 5, c.size),
        )
        for c in curves(levels=(*LEVELS, 450.0), held_out=())
    ]
    model = trusted(samples, tolerance=0.0, **pooled)
    assert not any(curve.segments for curve in model.body.curves)
    assert model.body.cross_validation[0].rmse < model.body.cross_validation[1].rmse
    assert "the correction of polynomial_2 by the segments is left out" in model.notes[-1]
    for curve in samples:
        places = at(curve.level, curve.columns["strain"])
        np.testing.assert_allclose(predict(model, places), backbone_of(model, places))


@pytest.mark.parametrize(("held_out", "is_kept"), [(2, True), (None, False)])
def test_where_repeats_are_held_out_left_out_repeats_say_what_counts_at_the_levels(
    held_out, is_kept
):
    """A wave of each level's own sign returns in every repeat. It cannot be continued into a
    left-out block of the curve, nor to another level.
    """
    repeats = np.repeat(np.arange(3), 120)
    samples = []
    for number, level in enumerate((*LEVELS, 450.0)):
        strain = np.tile(np.linspace(0, 0.2, 120), 3)
        wave = 40 * (-1) ** number * np.sin(60 * np.pi * strain)
        noise = np.random.default_rng(number).normal(0, 1, strain.size)
        samples.append(
            replace(
                curve_of(
                    {
                        "pressure": np.full(strain.size, level),
                        "strain": strain,
                        "force": 2 * level * (1 - strain) + wave + noise,
                    },
                    name=f"pressure={level:g}",
                ),
                level=level,
                held_out=repeats == held_out,
                recordings=("first", "second", "third"),
                origin=repeats,
            )
        )
    model = trusted(samples)
    assert model.body.fusion.shrink == 0
    assert any(curve.segments for curve in model.body.curves) == is_kept


def test_one_repeat_is_never_left_out():
    sample = curve_of({"strain": np.arange(40.0), "force": np.ones(40)})
    of_two = replace(
        sample,
        held_out=np.arange(40) < 20,
        recordings=("a", "b"),
        origin=np.repeat([0, 1], 20),
    )
    assert repeats_left_out([sample]) == repeats_left_out([of_two]) == []
    of_three = replace(of_two, recordings=("a", "b", "c"), origin=np.repeat([0, 1, 2], [20, 5, 15]))
    folds = repeats_left_out([sample, of_three])
    assert [[out.sum() for out in fold] for fold in folds] == [[0, 5], [0, 15]]


def test_between_two_levels_the_backbone_stands_alone():
    model = trusted(bumped(curves(levels=(150.0, 350.0), held_out=()), lambda _number: 80))
    assert model.body.fusion.shrink == 0.0
    assert any("two levels" in note for note in model.notes)
    middle = at(250, np.linspace(0, 0.12, 20))
    np.testing.assert_allclose(predict(model, middle), backbone_of(model, middle))


def of_formula(name):
    """Curves that a formula with made-up parameters has made."""
    rng = np.random.default_rng(0)
    made = curves(levels=LEVELS, held_out=(), n=25)
    fit = fit_formula(name, made, "force")
    said = [
        literature.get(name).predict(fit.parameters, c.columns) + rng.normal(0, 0.5, c.size)
        for c in made
    ]
    return [changed(c, force=force) for c, force in zip(made, said, strict=True)]


@pytest.mark.parametrize("name", ["polynomial_2", "sarosi"])
def test_what_made_the_data_is_chosen(name):
    choice = choose_backbone(of_formula(name), recipe(**SETTINGS), QUANTITIES)
    assert choice.name == name
    assert f"backbone {name} is chosen" in choice.note
    assert "With each of 2 inner training levels left out" in choice.note


@pytest.mark.parametrize("count", [2, 3])
def test_three_levels_choose_nothing(count):
    choice = choose_backbone(curves(levels=LEVELS[:count], held_out=()), recipe(), QUANTITIES)
    assert choice.name == FEW
    assert "too few to choose" in choice.note


def test_candidates_are_the_static_formulas_of_the_inputs():
    names = possible_backbones(curves(), "force")
    assert {None, "sarosi", "polynomial_5", FEW} <= set(names)
    assert not {"reynolds", "none", "muscle_like", "polynomial_3"} & set(names)
    without = [
        replace(c, columns={"load": c.columns["pressure"], "force": c.columns["force"]})
        for c in curves()
    ]
    assert possible_backbones(without, "force") == (None,)


@given(
    st.dictionaries(
        st.sampled_from([None, "sarosi", "polynomial_2", "polynomial_5"]),
        st.floats(1, 2),
        min_size=1,
    )
)
def test_the_simplest_within_the_margin_is_taken(errors):
    chosen, near = simplest_backbone(errors), 1.02 * min(errors.values())
    sizes = {name: len(literature.get(name).parameters) if name else 0 for name in errors}
    assert errors[chosen] <= near
    assert all(errors[name] > near for name in errors if sizes[name] < sizes[chosen])


def test_the_margin_is_two_per_cent():
    assert simplest_backbone({None: 1.02, "sarosi": 1.0}) is None
    assert simplest_backbone({None: 1.0201, "sarosi": 1.0}) == "sarosi"


def test_the_choice_is_made_on_an_even_share_in_the_order_of_the_curve():
    x = np.random.default_rng(0).permutation(900) / 1.0
    curve = curve_of({"x": x, "y": -x}, x >= 601)
    thinned = thin(curve, "x")  # 601 that train, every third of them
    assert sorted(thinned.columns["x"]) == [3.0 * k for k in range(201)]
    assert thinned.columns["x"].tolist() == [v for v in x if v < 601 and v % 3 == 0]
    assert thin(curve, None).columns["x"].tolist() == x[x < 601][::3].tolist()
    assert thinned.training.all()
    assert thin(curve_of({"x": x[:300]}), "x").size == 300


@pytest.mark.parametrize(("least", "kept"), [(3, 5), (8, 8)])
def test_folds_join_segments_that_only_lack_what_is_left_out(least, kept):
    asked = recipe(cuts={"strain": Cuts("even", 4, min_samples=least)}, max_terms=4)
    assert _of_fewer_samples(asked).cuts["strain"].min_samples == kept


SURFACE = ("1", "pressure", "strain", "pressure^2", "pressure*strain", "strain^2")
OF_SURFACE = {"level": None, "cuts": {}, "dictionary": SURFACE, "max_terms": 3}


def scattered(n=60, noise=1.0, seed=0):
    """Points of the imagined muscle, no two at one pressure, none beyond its free strain."""
    rng = np.random.default_rng(seed)
    pressure = rng.uniform(80, 400, n)
    strain = rng.uniform(0, 1, n) * (0.05 + 0.0005 * pressure)
    columns = {
        "pressure": pressure,
        "strain": strain,
        "force": force(pressure, strain) + rng.normal(0, noise, n),
    }
    return (curve_of(columns),)


def test_folds_are_the_inner_blocks_along_every_input():
    samples = scattered()
    made = recipe(**OF_SURFACE)
    inner = inner_folds(samples, made)
    assert [fold[0].sum() for fold in inner] == [12] * 6  # of 60 samples in five blocks
    for name, folds in (("pressure", inner[:3]), ("strain", inner[3:])):
        x = samples[0].columns[name]
        ends = sorted((x[out].min(), x[out].max()) for (out,) in folds)
        assert x.min() < ends[0][0]
        assert ends[-1][1] < x.max()
        assert all(before[1] < after[0] for before, after in pairwise(ends))
    assert all(out.any() for fold in inner for out in fold)


def test_blocks_of_curves_lie_along_the_first_segmented_or_other_quantity():
    made = curves(held_out=(250.0,))
    assert [sum(out.sum() for out in fold) for fold in blocks_in(made, recipe())] == [72] * 5
    (few,) = (one.at(np.arange(3)) for one in made[:1])
    assert len(blocks_in([few], recipe())) == 3
    sample = curve_of({"z": np.ones(2), "level": np.ones(2), "b": np.ones(2), "a": np.ones(2)})
    assert in_curve([sample], (), "a", "level") == "b"
    assert in_curve([sample], ("direction", "z"), "a", "level") == "z"


def test_curves_with_levels_are_left_out_whole_where_they_are_pooled():
    samples = curves(held_out=(150.0,), n=20)
    made = recipe(**OF_SURFACE, pooled="pressure")
    by_level = [fold for fold in inner_folds(samples, made) if sum(out.any() for out in fold) == 1]
    assert [[out.sum() for out in fold] for fold in by_level] == [[0, 0, 20, 0]]


@settings(max_examples=4)
@given(st.integers(0, 1000))
def test_all_of_the_residual_counts_with_the_share_that_left_out_blocks_support(seed):
    samples, made = scattered(noise=8.0, seed=seed), recipe(**OF_SURFACE)
    whole = on_polynomial(samples, **OF_SURFACE)
    kept = with_trusted_residual(whole, samples, made, QUANTITIES)
    left_out = leave_out(samples, made, QUANTITIES, "polynomial_2", inner_folds(samples, made))
    share = left_out.share
    tried = {BACKBONE: 0, RESIDUAL: 1} | ({SHRUNKEN: share} if share else {})
    assert {error.choice: error.rmse for error in kept.body.cross_validation} == {
        choice: left_out.rmse(own) for choice, own in tried.items()
    }
    columns = samples[0].columns
    alone = backbone_of(whole, columns)
    expected = alone + share * (predict(whole, columns) - alone)
    np.testing.assert_allclose(predict(kept, columns), expected, rtol=1e-10, atol=1e-8)
    assert bool(kept.body.segments) == (share > 0)


@pytest.mark.parametrize(("error", "chosen"), [(0.9, None), (1.1, "sarosi")])
@pytest.mark.parametrize(
    ("samples", "settings", "parts"),
    [
        (curves(held_out=()), {}, "2 inner training levels"),
        (scattered(), OF_SURFACE, "6 inner training blocks"),
    ],
)
def test_a_model_without_a_backbone_is_compared_with_all_of_its_pieces(
    samples, settings, parts, error, chosen, monkeypatch
):
    """Its left-out samples are missed by `error`, and those of formulas by one."""
    measured, nothing = np.arange(9.0), np.zeros(9)

    def errors(_curves, _recipe, _quantities, name, folds):
        both = (nothing, measured + error) if name is None else (measured + 1, nothing)
        return LeftOutErrors(measured, *both, len(folds))

    monkeypatch.setattr(backbone_choice, "leave_out", errors)
    monkeypatch.setattr(backbone_choice, "possible_backbones", lambda *_: (None, "sarosi"))
    choice = choose_backbone(samples, recipe(**settings), QUANTITIES)
    assert choice.name == chosen
    assert f"With each of {parts} left out in turn" in choice.note


@pytest.mark.parametrize("error", [np.nan, None])
def test_without_a_fit_that_succeeds_no_backbone_is_used(error, monkeypatch):
    def failed(*_how):
        if error is None:
            raise FitError("the fit failed", "write another formula")
        return LeftOutErrors(np.full(2, error), np.zeros(2), np.zeros(2), 2)

    monkeypatch.setattr(backbone_choice, "leave_out", failed)
    assert choose_backbone(curves(held_out=()), recipe(), QUANTITIES).name is None


def test_a_backbone_that_cannot_be_fitted_without_a_fold_is_an_error(monkeypatch):
    fit = SimpleNamespace(failed=True, name="sarosi")
    monkeypatch.setattr(cross_validation, "fit_formula", lambda *_how: fit)
    samples = curves(held_out=())
    with pytest.raises(FitError, match="the fit of sarosi failed"):
        leave_out(samples, recipe(), QUANTITIES, "sarosi", inner_folds(samples, recipe()))


def test_a_residual_is_unchanged_if_nothing_can_be_left_out():
    settings = OF_SURFACE | {"dictionary": ("1", "strain"), "max_terms": 1}
    x = np.repeat([0.0, 0.1], 20)
    samples = [curve_of({"pressure": 100 + x, "strain": x, "force": 300 - x})]
    model = built(samples, fit_formula("polynomial_2", curves(), "force"), **settings)
    assert with_trusted_residual(model, samples, recipe(**settings), QUANTITIES) is model
