"""The definition, evaluated branch by branch, beside the equations written out row by row."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from agreement import points
from dense_model import dense
from hypothesis import given, settings
from hypothesis import strategies as st
from surfaces import joined

from mapmore_cli.domain.fits import Scaling
from mapmore_cli.domain.models import CurveFunction, Fusion, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.kinds import predict

TERMS = ("1", "a", "a^2", "a^5", "b*a", "exp(-a)", "sqrt(a^2 + b^2)", "b", "c*b", "a/(1 + b^2)")
WORDS = ("continue", "continue_linear", "saturate", "zero")


def imagined(rng, names, level, count, cuts):
    """A model of random pieces over inputs of about one unit; `cuts` has the number of segments
    along each segmented variable.
    """
    free = [name for name in names if name != level]
    levels = np.sort(rng.permutation(np.linspace(0.5, 4, 8))[:count]) if level else [None]
    curves = []
    for number, at in enumerate(levels):
        limits = {name: tuple(sorted(rng.uniform([0, 0.8], [0.2, 1.5]))) for name in free}
        boundaries = {
            n: np.sort([*limits[n], *rng.uniform(*limits[n], k - 1)]) for n, k in cuts.items()
        }
        cells = product(*(range(1, k + 1) for k in cuts.values()))
        segments = [segment(rng, f"{number}/{cell}", cell, names, boundaries) for cell in cells]
        if level:
            limits[level] = (at - 0.01, at + 0.01)
        curves.append(
            CurveFunction(
                f"curve {number}",
                at,
                limits,
                tuple(boundaries.values()),
                tuple(segments),
            )
        )
    quantities = tuple(Quantity(name, "1") for name in names)
    sides = dict.fromkeys(names, ("continue", "continue"))
    return Model(
        "imagined",
        Quantity("force", "N"),
        quantities,
        Pieces(level, tuple(cuts), tuple(curves), Fusion(extrapolation=sides)),
    )


def segment(rng, name, cell, names, boundaries):
    slope, intercept = rng.uniform(0.5, 2, len(names)), rng.normal(size=len(names))
    scaling = Scaling("none", "-", tuple(names), slope, intercept, rng.uniform(1, 9), rng.normal())
    places = zip(boundaries.items(), cell, strict=True)
    limits = {
        n: tuple(sorted(at[place - 1 : place + 1] + rng.normal(0, 0.05, 2)))
        for (n, at), place in places
    }
    usable = [term for term in TERMS if not set("abc") & set(term) - set(names)]
    chosen = tuple(rng.choice(usable, rng.integers(0, 4), replace=False))
    theta, nothing = rng.normal(size=len(chosen)), np.zeros(len(chosen))
    return SegmentFunction(
        theta, nothing, nothing, nothing, 9, 1.0, "tolerance", name, cell, chosen, scaling, limits
    )


def agree(model, columns):
    expected = dense(model, columns)
    np.testing.assert_allclose(
        predict(model, columns), expected, rtol=0, atol=1e-12 * np.abs(expected).max(initial=1.0)
    )


ways = st.fixed_dictionaries(
    {
        "transition": st.sampled_from(["linear", "quadratic", "cubic"]),
        "z_s": st.one_of(st.sampled_from([0.0, 0.25, 0.5]), st.floats(0, 0.5)),
        "levels": st.sampled_from(["linear", "pchip"]),
        "shrink": st.sampled_from([1.0, 0.0, 0.3]),
        "hold": st.sampled_from(["samples", "none"]),
    }
)
seeds = st.integers(0, 2**32 - 1)


def sides(rng, names):
    """A word or a value for either side of every input."""
    return {
        name: tuple(
            str(rng.choice(WORDS)) if rng.random() < 0.8 else float(rng.uniform(0.2, 1.2))
            for _ in range(2)
        )
        for name in names
    }


counts = st.integers(1, 3)
ONE_CUT = st.tuples(
    st.just("ab"),
    st.just("b"),
    st.integers(1, 5),
    st.dictionaries(st.just("a"), st.integers(1, 4)),
)
TWO_CUTS = st.tuples(
    st.just("abc"),
    st.sampled_from([None, "c"]),
    st.just(3),
    st.fixed_dictionaries({"a": counts, "b": counts}),
)


@settings(max_examples=40)
@given(seeds, ways, ONE_CUT | TWO_CUTS)
def test_agrees_with_the_sum_over_all_segments(seed, way, made):
    rng = np.random.default_rng(seed)
    names = made[0]
    model = joined(imagined(rng, tuple(names), *made[1:]), extrapolation=sides(rng, names), **way)
    agree(model, points(model, 40, seed))


@pytest.mark.parametrize("level", ["b", None])
def test_rows_depend_on_themselves_alone(level):
    """Bit for bit, whatever the other rows are; what is not finite stays where it is."""
    rng = np.random.default_rng(2)
    model = imagined(rng, ("a", "b"), level, 4, {"a": 3})
    columns = points(model, 500)
    whole = predict(model, columns)
    spoilt = rng.random(500) < 0.1
    spoilt_columns = {
        **columns,
        "b": np.where(spoilt, rng.choice([np.nan, np.inf, -np.inf], 500), columns["b"]),
    }
    np.testing.assert_array_equal(predict(model, spoilt_columns), np.where(spoilt, np.nan, whole))
    np.testing.assert_array_equal(
        [
            predict(model, {name: x[i : i + 1] for name, x in columns.items()})[0]
            for i in range(500)
        ],
        whole,
    )


def test_no_row_is_no_prediction():
    model = imagined(np.random.default_rng(3), ("a", "b"), "b", 3, {"a": 2})
    assert predict(model, {"a": np.empty(0), "b": np.empty(0)}).shape == (0,)


def test_what_does_not_count_is_not_evaluated():
    """The logarithm of one segment has no value on the rows of the other, and one curve none at the
    other's level.
    """
    rng = np.random.default_rng(4)
    model = imagined(rng, ("a", "b"), "b", 2, {"a": 2})
    curve = model.body.curves[0]
    same = Scaling("none", "-", ("a", "b"), np.ones(2), np.zeros(2), 1.0, 0.0)
    left, right = (
        replace(s, scaling=same, theta=np.ones(1), terms=(term,), limits={})
        for s, term in zip(curve.segments, ("1", "log(a - 2)"), strict=True)
    )
    far = replace(curve, boundaries=(np.array([0.0, 4.0, 8.0]),), segments=(left, right), level=1.0)
    nowhere = replace(
        far, segments=tuple(replace(s, terms=("log(-1 - a^2)",)) for s in (left, right)), level=2.0
    )
    model = replace(model, body=replace(model.body, curves=(far, nowhere)))
    model = joined(model, z_s=0.25)
    a = np.array([0.0, 1.9, 3.0, 5.0, 7.0])
    for b in (1.0, 0.5):
        found = predict(model, {"a": a, "b": np.full(5, b)})
        np.testing.assert_allclose(found, [1, 1, 1, np.log(3), np.log(5)])
    assert np.isnan(predict(model, {"a": a, "b": np.full(5, 1.5)})).all()
