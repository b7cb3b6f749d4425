"""The fused model: continuity, extrapolation, invariance; weights (M2 eq 9-12)."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import at, built, changed, curves, joined

from mapmore_cli.modelling.kinds import (
    equations,
    parameters,
    predict,
    rules,
    verbs_of,
)
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.recipe import Cuts

seeds = st.integers(0, 2**32 - 1)


def segments_of(*models):
    return zip(*(model.body.segments for model in models), strict=True)


@pytest.mark.parametrize("far", [1e6, 1e12])
def test_an_offset_changes_neither_the_terms_nor_the_curve(far):
    """Lengths and forces far from zero, in steps that a double still holds there (2^-13 at 1e12),
    are cut, scaled and fitted as near it.
    """
    columns = [
        (np.rint(1e6 * c.columns["strain"]), np.rint(1024 * c.columns["force"]) / 1024)
        for c in curves()
    ]
    near, away = (
        [
            changed(c, strain=x + offset, force=y + offset)
            for c, (x, y) in zip(curves(), columns, strict=True)
        ]
        for offset in (0.0, far)
    )
    one, two = built(near, max_terms=3), built(away, max_terms=3)
    assert all(f.terms == g.terms for f, g in segments_of(one, two))
    strain = np.rint(np.linspace(0, 9e4, 200))
    np.testing.assert_allclose(
        predict(two, at(150, far + strain)) - far,
        predict(one, at(150, strain)),
        rtol=0,
        atol=4e-16 * far + 1e-8,
    )


def shuffled(curve, rng):
    order = rng.permutation(curve.size)
    return replace(
        curve,
        columns={name: x[order] for name, x in curve.columns.items()},
        held_out=curve.held_out[order],
    )


WAYS = [
    {"max_terms": 2},
    {"cuts": {"strain": Cuts("optimal", 2)}},
    {"cuts": {"strain": Cuts("gradient", 3)}},
]


@settings(max_examples=3)
@given(seeds, st.sampled_from(WAYS))
def test_neither_the_order_of_rows_nor_held_out_forces_matter(seed, way):
    """Strains are rounded, so that some are equal."""
    rng = np.random.default_rng(seed)
    held = rng.random(120) < 0.3
    plain = [
        replace(changed(c, strain=np.round(c.columns["strain"], 4)), held_out=held)
        for c in curves(seed=seed)
    ]
    spoilt = [
        changed(c, force=np.where(held, 1e6 * rng.random(120), c.columns["force"])) for c in plain
    ]
    one, two = built(plain, **way), built([shuffled(c, rng) for c in spoilt], **way)
    for f, g in zip(one.body.curves, two.body.curves, strict=True):
        np.testing.assert_array_equal(f.boundaries, g.boundaries)
    for f, g in segments_of(one, two):
        assert f.terms == g.terms
        np.testing.assert_array_equal(f.theta, g.theta)


def test_several_terms_saturate_by_default_and_one_term_continues():
    assert built(max_terms=1).body.fusion.extrapolation["strain"] == ("continue", "continue")
    several = built(max_terms=3)
    assert several.body.fusion.extrapolation["strain"] == ("saturate", "saturate")


@pytest.mark.parametrize("end", [0, -1])
def test_a_sample_at_the_limit_of_a_curve_is_not_outside(end):
    model = built(max_terms=3)
    curve = model.body.curves[1]
    edge = at(curve.level, curve.limits["strain"][end])
    outside = at(curve.level, curve.limits["strain"][end] + (1e-9 if end else -1e-9))
    cut = joined(model, extrapolation=dict.fromkeys(("pressure", "strain"), ("zero", "zero")))
    assert predict(cut, edge) == predict(model, edge) != 0
    assert predict(cut, outside) == 0


def words_of(model):
    return [one.partition(",")[0] if "multiplied" in one else one for one in rules(model)]


def test_rules_say_what_is_joined_and_what_lies_outside():
    """Nothing is joined of one piece, nor across one level; a side may have words or a value."""
    held = "beyond its limits it is held at the limit"
    level = "pressure: beyond its limits only the outermost curve counts, at its level."
    weights = "The weight of a piece is w in the zone in which it rises"
    between = (
        "Between two levels of pressure, at the fraction t of the way: (1 - t) times the lower "
        "curve plus t times the upper."
    )
    several = built(max_terms=3)
    assert words_of(several) == [weights, between, level, f"strain: {held}."]
    one, other, *_ = several.body.curves
    ends = replace(other, boundaries=(other.boundaries[0][[0, -1]],))
    assert words_of(replace(several, body=replace(several.body, curves=(ends, one))))[0] == weights
    assert words_of(replace(several, body=replace(several.body, curves=(one,)))) == [
        weights, level, f"strain: {held}."
    ]  # fmt: skip
    sides = {"pressure": ("zero", "continue_linear"), "strain": ("continue", 0.5)}
    single = built(max_terms=1, cuts={"strain": Cuts("even", 1)})
    assert words_of(joined(single, extrapolation=sides)) == [
        between,
        "pressure: below its limits the pieces are 0, above the curves continue with their slope "
        "at the outermost level.",
        "strain: below its limits the equations continue, above it is taken to be 0.5.",
    ]
    on = built(backbone=fit_formula("polynomial_2", curves(), "force"))
    assert words_of(on)[0] == "force is polynomial_2 plus the pieces."
    bare = replace(on.body, curves=tuple(replace(one, segments=()) for one in on.body.curves))
    assert rules(replace(on, body=bare)) == ()
    coefficients = sum(len(segment.theta) for segment in on.body.segments)
    assert parameters(on) == coefficients + 5
    assert parameters(replace(on, body=bare)) == 5
    assert parameters(single) == sum(len(part.theta) for part in single.body.segments)


@pytest.mark.parametrize(("units", "size"), [({}, 1.0), ({"strain": 0.01}, 0.01)])
def test_a_weight_says_its_zones_and_where_inputs_are_held(units, size):
    """By M2 eq 10 and 11, also in per cent; held a quarter of the samples' range beyond them, if a
    zone reaches farther.
    """
    model = built(curves(levels=(80.0, 150.0)))
    curve = model.body.curves[0]
    (b,) = curve.boundaries
    for place, (segment, equation) in enumerate(
        zip(curve.segments, equations(model, units), strict=False)
    ):
        low, high = segment.limits["strain"]
        words, held = [], []
        for word, edge in (("rises", place), ("falls", place + 1)):
            if 0 < edge < 4:
                start = b[edge] - 0.25 * (b[edge] - b[edge - 1])
                end = b[edge] + 0.25 * (b[edge + 1] - b[edge])
                words.append(f"{word} {start / size:.6g} to {end / size:.6g}")
                below, above = low - 0.25 * (high - low), high + 0.25 * (high - low)
                if word == "rises" and below > start:
                    held.append(f"held below {below / size:.6g}")
                if word == "falls" and above < end:
                    held.append(f"held above {above / size:.6g}")
        assert equation.weight == f"strain {', '.join([*words, *held])}"
    assert not any("held" in one.weight for one in equations(joined(model, hold="none")))


def test_models_that_were_changed_by_hand_have_faults():
    model = built()
    body, verbs = model.body, verbs_of(model)
    assert list(verbs.faults(model)) == []
    first, second, *others = body.curves
    for level in (first.level, np.nan):
        same = replace(body, curves=(first, replace(second, level=level), *others))
        (fault,) = verbs.faults(replace(model, body=same))
        assert fault == "the levels of its curves do not increase"
    segment = replace(first.segments[0], terms=("strain*load",))
    curve = replace(first, segments=(segment, *first.segments[1:]))
    (fault,) = verbs.faults(replace(model, body=replace(body, curves=(curve, second, *others))))
    assert fault == f"the terms of {segment.id} use other quantities than its scaling"
