"""Two models of one muscle: what changed, with the curve as the unit of every statement; the rule
of one standard error.
"""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats
from surfaces import QUANTITIES, curves, recipe

from mapmore_cli.domain.fits import LOWER_BOUND
from mapmore_cli.domain.models import Formula, LeftOut, Model
from mapmore_cli.domain.recording import Curve, CurveRange, Quantity
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.build import build
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.validation.common_curves import common_curves, grid
from mapmore_cli.modelling.validation.comparison import (
    Comparison,
    TermChange,
    _coefficients,
    compare,
    reference_points,
    term_changes,
)
from mapmore_cli.modelling.validation.intervals import SHARES, half_widths
from mapmore_cli.modelling.validation.significance import (
    sign_permutation,
    simplest_of,
    weighted_mean,
)

RECIPE = recipe(
    dictionary=("1", "strain", "strain^2"), cuts={"strain": Cuts("even", 2)}, max_terms=2
)
LEVELS = (100.0, 200.0, 300.0, 400.0)


def muscle(name, scale=1.0, levels=LEVELS, scatter=0.0, seed=0, end=0.2):
    """`F = scale (1 + c) P (1 - 4 e)` with one gain error c for each curve."""
    random = np.random.default_rng(seed)
    made = []
    for level in levels:
        strain = np.linspace(0, end, 60)
        force = scale * (1 + scatter * random.normal()) * level * (1 - 4 * strain)
        columns = {"pressure": np.full(60, level), "strain": strain, "force": force}
        made.append(Curve(f"pressure={level:g}", level, columns, np.zeros(60, dtype=bool), ("a",)))
    return build(name, made, RECIPE, QUANTITIES)


def sure(model, error):
    """The model with intervals, from such an error of its inner levels when left out."""
    e = np.full(2, error)
    places = tuple(one.level for one in model.pieces.curves)
    kept = (np.array([60, 60]), 0 * e, e, e[:, None] * SHARES, places, (1,) * 4, 400.0, 0.01)
    return replace(model, left_out=LeftOut("levels", 4, ("200", "300"), *kept))


class TestMean:
    @given(arrays(float, st.integers(2, 9), elements=st.floats(-10, 10).map(lambda v: round(v, 3))))
    def test_equal_weights_give_students_interval_and_test(self, x):
        found = weighted_mean(x, np.full(len(x), 3.0), 0.95)
        if np.ptp(x) < 1e-6:
            assert found.p + x.any() == pytest.approx(1)
            return
        low, high = stats.t.interval(0.95, len(x) - 1, x.mean(), stats.sem(x))
        assert found.interval == pytest.approx((low, high), rel=1e-9, abs=1e-9)
        assert found.p == pytest.approx(stats.ttest_1samp(x, 0).pvalue, rel=1e-6, abs=1e-12)

    def test_one_number_says_nothing(self):
        found = weighted_mean(np.array([1.2]), np.ones(1), 0.95)
        assert (found.interval, found.p) == ((-math.inf, math.inf), 1.0)

    @given(arrays(float, st.integers(6, 10), elements=st.floats(-5, 5).map(lambda v: round(v, 3))))
    @settings(max_examples=25)
    def test_permutation_of_signs_as_scipy_has_it(self, x):
        expected = stats.permutation_test(
            (x,), np.sum, permutation_type="samples", n_resamples=np.inf, alternative="two-sided"
        ).pvalue
        assert sign_permutation(x) == pytest.approx(expected, abs=2 / 2 ** len(x))

    def test_few_curves_have_no_permutation(self):
        assert sign_permutation(np.ones(5)) is None
        for count in (6, 14):
            assert sign_permutation(np.ones(count)) == 2 / 2**count
        assert sign_permutation(np.ones(20)) < 0.01


class TestCompare:
    def test_numbers_are_sums_over_a_grid_of_every_curve(self):
        """Of seven curves at 41 strains each, up to the end that both reach."""
        levels, strain = np.arange(100.0, 800.0, 100.0), np.linspace(0, 0.15, 41)
        before = muscle("a", levels=levels, scatter=0.02, seed=1)
        after = muscle("b", 1.05, levels=levels, scatter=0.02, seed=2, end=0.15)
        found = compare(before, after, margin=0.02)
        a, b = (
            np.array([predict(model, {"pressure": np.full(41, level), "strain": strain})
                      for level in levels])
            for model in (before, after)
        )  # fmt: skip
        squares, change = np.sum(a**2, axis=1), b - a
        ratios = np.sum(a * b, axis=1) / squares
        share = squares / squares.sum()
        worst, rms = np.abs(change).argmax(axis=1), np.sqrt(np.mean(change**2, axis=1))
        numbers = {"level": levels, "ratio": ratios, "weight": share, "rms": rms}
        numbers |= {"difference": change.mean(axis=1), "largest": change[np.arange(7), worst]}
        for name, values in numbers.items():
            assert [getattr(curve, name) for curve in found.curves] == pytest.approx(values)
        for level, at, curve in zip(levels, strain[worst], found.curves, strict=True):
            assert (curve.curve, curve.points) == (f"pressure={level:g}", 41)
            assert curve.place == pytest.approx({"strain": at, "pressure": level})
            assert not curve.interpolated
        assert [curve.rms for curve in found.by_effect] == pytest.approx(sorted(rms, reverse=True))
        own, narrow = (weighted_mean(ratios, share, level) for level in (0.95, 0.90))
        assert (found.before, found.after, found.unit, found.margin) == ("a", "b", "N", 0.02)
        assert found.ratio == pytest.approx(own.value) == share @ ratios
        assert found.interval == pytest.approx(own.interval)
        assert found.narrow == pytest.approx(narrow.interval)
        assert found.resolution == pytest.approx(np.ptp(own.interval) / 2)
        assert found.p == pytest.approx(weighted_mean(ratios - 1, share, 0.95).p)
        moves = share * (ratios - 1)
        sums = [abs(np.dot(signs, moves)) for signs in itertools.product((1, -1), repeat=7)]
        assert found.p_permutation == np.mean(np.array(sums) >= abs(moves.sum()) * (1 - 1e-9))
        alike = compare(before, muscle("c", levels=levels, scatter=0.02, seed=3))
        assert 0.05 < alike.p_permutation < 1  # some curves are stronger, and others weaker
        assert [found.moved(limit) for limit in (0.03, 0.06)] == [True, False]
        assert not replace(found, same_recordings=True).moved(0.03)
        assert replace(found, ratio=0.5).moved(0.4)
        assert not replace(found, ratio=0.5).moved(0.5)

    def test_what_interpolation_leaves_unsure_is_part_of_the_resolution(self):
        """`1.96 sqrt(sum (share u)^2)` of both models, in parts of the curve's root mean square."""
        first = sure(muscle("a"), 20.0)
        later = sure(muscle("b", levels=(150.0, 250.0, 350.0, 390.0)), 30.0)
        found = compare(first, later)
        places = [(curve.level, curve.interpolated) for curve in found.curves]
        assert places == [(200.0, True), (300.0, True)]
        squares = 0.0
        for curve in found.curves:
            output = curve.level * (1 - 4 * np.linspace(0, 0.2, 41))
            for model in (first, later):
                half = half_widths(model.left_out, np.array([curve.level]), 0.95)[0]
                squares += (curve.weight * half) ** 2 / np.mean(output**2)
        assert found.resolution == pytest.approx(np.sqrt(squares))
        known = compare(first, replace(later, left_out=None)).resolution
        assert 0 < known < found.resolution
        astray = replace(later, left_out=replace(later.left_out, astray=1e9))
        assert compare(first, astray).resolution == math.inf

    def test_curves_without_levels_have_their_names_and_a_coarse_grid_of_two_inputs(self):
        """A formula of twice the linear parameters has twice the force."""
        fit = fit_formula("sarosi", curves(), "force")
        twice = {name: (1 if name == "a3" else 2) * x for name, x in fit.parameters.items()}
        inputs = (QUANTITIES["pressure"], QUANTITIES["strain"])

        def formula(name, parameters, *ranges):
            ranges = tuple(CurveRange(curve, None, ends) for curve, ends in ranges)
            body = Formula(replace(fit, parameters=parameters), None, ranges)
            return Model(name, QUANTITIES["force"], inputs, body)

        a = {"pressure": (100.0, 300.0), "strain": (0.0, 0.1)}
        b = {"pressure": (150.0, 250.0), "strain": (0.05, 0.05)}
        earlier = formula("a", fit.parameters, ("x", a), ("y", a), ("z", b))
        later = formula("b", twice, ("z", b), ("w", a), ("x", b | {"strain": (0.05, 0.2)}))
        found = compare(earlier, later)
        assert [(one.curve, one.points, one.level) for one in found.curves] == [
            ("x", 121, None), ("z", 41, None)
        ]  # fmt: skip
        assert [one.ratio for one in found.curves] == pytest.approx([2.0, 2.0])
        points = grid(earlier, later, common_curves(earlier, later)[0])
        pairs = itertools.product(np.linspace(150, 250, 11), np.linspace(0.05, 0.1, 11))
        np.testing.assert_allclose(np.column_stack([*points.values()]), list(pairs))
        far = {"pressure": (100.0, 140.0), "strain": (0.0, 0.1)}
        with pytest.raises(ValueError, match="z: the ranges of pressure in a and b do not overlap"):
            compare(earlier, formula("b", twice, ("x", a), ("z", far)))

    def test_nearly_equal_levels_are_the_same_curve(self):
        a, b = muscle("a"), muscle("b", levels=tuple(level + 1.5 for level in LEVELS))
        places = common_curves(a, b)
        assert [place.level for place in places] == [level + 0.75 for level in LEVELS]
        assert not any(place.interpolated for place in places)
        for apart, interpolated in ((5.0, False), (5.1, True)):  # of levels 100 apart
            b = muscle("b", levels=tuple(level + apart for level in LEVELS))
            assert {place.interpolated for place in common_curves(a, b)} == {interpolated}
        assert compare(a, a).margin == 0.01
        two = common_curves(muscle("a", levels=LEVELS[:3]), muscle("b", levels=(*LEVELS[1:3], 350)))
        assert [(place.level, place.interpolated) for place in two] == [(200, False), (300, False)]

    @pytest.mark.parametrize(
        ("other", "words"),
        [
            (replace(muscle("b"), output=Quantity("force", "kN")), "different quantities"),
            (muscle("b", levels=(900.0, 950.0)), r"too few curves in common \(0\)"),
            (muscle("b", levels=(100.0,)), r"too few curves in common \(1\)"),
        ],
    )
    def test_what_cannot_be_compared(self, other, words):
        with pytest.raises(ValueError, match=words):
            compare(muscle("a"), other)

    def test_terms_that_came_and_went(self):
        a = muscle("a")
        curve, *others = a.body.curves
        first, second = curve.segments
        changed = replace(
            curve, segments=(replace(first, terms=("strain^2", *first.terms[1:])), second)
        )
        later = replace(a, body=replace(a.body, curves=(changed, *others)))
        moved = {
            (term.segment, term.term, term.before is None, term.after is None)
            for term in term_changes(a, later)
            if term.moved
        }
        assert moved == {
            (first.id, first.terms[0], False, True),
            (first.id, "strain^2", True, False),
        }

    def test_reference_points_are_the_middles_of_up_to_six_curves(self):
        """Of the ranges of the first and the last model; the outputs are those of all."""
        levels = np.arange(100.0, 1000.0, 100.0)
        ends, factors = (0.2, 0.1, 0.16), (1.0, 1.1, 1.2)
        models = [
            muscle(str(factor), factor, levels=levels, end=end)
            for factor, end in zip(factors, ends, strict=True)
        ]
        points = reference_points(models)
        assert [point.inputs["pressure"] for point in points] == [100, 300, 400, 600, 700, 900]
        for point in points:
            assert point.inputs["strain"] == pytest.approx(0.08)
            force = point.inputs["pressure"] * (1 - 4 * 0.08)
            assert point.outputs == pytest.approx([factor * force for factor in factors])
        assert len(reference_points([muscle("a"), muscle("b")])) == 4

    def test_changes_of_terms_are_in_the_unit_of_the_output(self):
        a, b = muscle("a"), muscle("b", 1.1)
        curve, *others = b.body.curves
        first, second = curve.segments
        scaling = replace(first.scaling, y_slope=-2.0)
        own = {"theta": np.array([0.5, 4.0]), "theta_error": np.array([0.1, 0.2])}
        noted = replace(first, scaling=scaling, **own, errors_note="another note")
        later = replace(
            b, body=replace(b.body, curves=(replace(curve, segments=(noted, second)), *others))
        )
        found = [one for one in term_changes(a, later) if one.segment == first.id]
        before = a.body.curves[0].segments[0]
        assert [one.term for one in found] == list(before.terms)
        errors = before.theta_error * abs(before.scaling.y_slope)
        for place, one in enumerate(found):
            assert one.before == before.theta[place] * before.scaling.y_slope
            assert one.after == -2.0 * own["theta"][place]
            assert one.error == pytest.approx(
                np.hypot(errors[place], 2 * own["theta_error"][place])
            )
        assert {one.errors_note for one in found} == {"another note"}
        own_numbers = [*_coefficients(noted).values()]
        assert own_numbers == [(-1.0, 0.2), (-8.0, 0.4)]  # an error is never negative
        least = replace(noted, errors_note=LOWER_BOUND)
        lower = replace(b, body=replace(b.body, curves=(replace(curve, segments=(least, second)),)))
        for pair in ((lower, later), (later, lower)):
            assert {one.errors_note for one in term_changes(*pair)[:2]} == {LOWER_BOUND}
        assert term_changes(replace(a, body=None), b) == ()


TABLES = st.tuples(st.integers(1, 6), st.integers(2, 5)).flatmap(
    lambda shape: st.tuples(
        st.lists(st.integers(1, 9), min_size=shape[0], max_size=shape[0]),
        arrays(np.float64, shape, elements=st.floats(0.0, 8.0, width=16)),
    )
)


@given(TABLES)
def test_none_that_is_simpler_is_as_good(table):
    sizes, errors = table
    found = simplest_of(sizes, errors)
    logs = np.log(np.clip(errors, 1e-6, 1e6))
    means = logs.mean(axis=1)
    assert means[found.best] == pytest.approx(means.min(), abs=1e-12)
    for number, size in enumerate(sizes):
        above = logs[number] - logs[found.best]
        standard_error = np.sqrt(
            np.sum((above - above.mean()) ** 2) / (len(above) - 1) / len(above)
        )
        within = np.clip(standard_error, 0.02, 0.18)
        if number == found.chosen:
            assert above.mean() <= within + 1e-8
        elif size < sizes[found.chosen]:
            beaten = (np.array(sizes) <= size) & (means < means[number])
            assert above.mean() > within - 1e-8 or beaten.any()
        assert (
            number == found.chosen
            or size > sizes[found.chosen]
            or (means[number] >= means[found.chosen] - 1e-12)
        )


def test_the_spread_is_the_standard_error_of_the_mean_difference_of_logarithms():
    errors = np.array([[1.0, 2.0, 4.0], [1.5, 2.2, 4.1]])
    above = np.log(errors[1] / errors[0])
    found = simplest_of([9, 1], errors)
    assert found.excess == pytest.approx([0, above.mean()])
    assert found.spread == pytest.approx([0, np.std(above, ddof=1) / np.sqrt(3)])


@given(TABLES, st.randoms(), st.booleans())
def test_the_order_of_folds_is_of_no_consequence(table, shuffle, median):
    sizes, errors = table
    order = np.random.default_rng(shuffle.randint(0, 99)).permutation(errors.shape[1])
    a, b = (
        simplest_of(sizes, errors, median=median),
        simplest_of(sizes, errors[:, order], median=median),
    )
    assert (a.best, a.chosen) == (b.best, b.chosen)


FAR = [[1.0, 1.0, 1.0, 1.0, 50.0], [1.2, 1.2, 1.2, 1.2, 1.2]]
# 2.2 times less on two folds, and 2.1 times more on the others
TWO_EACH = [[1.0, 1.1, 4.0, 5.0], [2.2, 2.4, 2.0, 2.2]]
RULES = {  # errors of structures on every fold, the numbers of their parameters, best and chosen
    "within one standard error": (
        [[1.0, 1.2, 1.1], [1.0, 1.1, 1.15], [3.0, 3.1, 2.9]],
        (4, 9, 1),
        (1, 0),
    ),
    "twice the error is never as good, however much the folds scatter": (
        [[5.2, 0.5, 9.0], [5.2, 0.1, 4.0]],
        (3, 9),
        (1, 1),
    ),
    "1.5 % worse on every fold": ([[1.015] * 3, [1.0] * 3, [1.06] * 3], (4, 9, 1), (1, 0)),
    "3 % worse on every fold": ([[1.03] * 3, [1.0] * 3], (4, 9), (1, 1)),
    "a noisy one is not taken where another of its size has a smaller mean": (
        [[1.0, 1.0, 1.0, 1.0], [1.09, 1.1, 1.09, 1.1], [0.8, 1.6, 0.75, 1.55]],
        (9, 6, 6),
        (0, 0),
    ),
    "a single fold has no standard error": ([[1.15], [1.0], [1.3]], (4, 9, 1), (1, 0)),
    "what is hard for all decides nothing": ([[10.0, 1.2, 5.1], [9.9, 1.0, 5.0]], (1, 2), (1, 1)),
    "one stretch far from the others decides a mean": (FAR, (9, 9), (1, 1)),
    "and no median": (FAR, (9, 9), (0, 0), {"median": True}),
    "5 % of the logarithm of the number": (FAR, (90, 2), (1, 1), {"median": True}),
    "and no more": ([[1.0, 1.0], [1.2, 1.2]], (9, 3), (0, 0), {"median": True}),
    "a millionth of the range is an error": ([[2e-6] * 2, [8e-6] * 2], (9, 4), (0, 0)),
    "less is none": ([[1e-9] * 2, [9e-7] * 2], (9, 4), (1, 1)),
    "a million times the range is lost": ([[3e6] * 2, [np.inf] * 2], (9, 4), (1, 1)),
    "and less is not": ([[2e5] * 2, [9e5] * 2], (9, 4), (0, 0)),
    "what may not be taken is ranked all the same": (
        [[1.0, 1.0], [2.0, 2.2]],
        (9, 3),
        (1, 1),
        {"eligible": np.array([False, True])},
    ),
    "weights say which folds count": (
        TWO_EACH,
        (8, 8),
        (0, 0),
        {"weights": np.array([0.4, 0.4, 0.1, 0.1])},
    ),
    "and which do not": (TWO_EACH, (8, 8), (1, 1), {"weights": np.array([0.1, 0.1, 0.4, 0.4])}),
}


def test_the_middle_of_folds_is_a_weighted_median_and_a_size_has_its_price():
    """The excess over a model of one error everywhere, on folds of shares .5, .1, .2 and .2."""
    logs = np.array([3.0, 1.0, 4.0, 2.0])
    errors = np.array([np.exp(logs), np.full(4, np.e)])
    ranked = simplest_of((1, 1), errors, np.array([5.0, 1.0, 2.0, 2.0]), median=True)
    # half of the weights lies below: 0.05 (1), 0.2 (2), 0.55 (3) and 0.9 (4)
    assert ranked.excess == pytest.approx([2 + 0.3 / 0.35 - 1, 0])
    assert ranked.chosen == 1
    for factor, chosen in ((0.04, 0), (0.06, 1)):
        better = np.full((2, 4), 0.1) * np.array([[1], [np.exp(-factor)]])
        assert simplest_of((1, np.e), better, median=True).chosen == chosen


@pytest.mark.parametrize("name", RULES)
def test_the_simplest_that_is_as_good_is_taken(name):
    errors, sizes, found, *named = RULES[name]
    ranked = simplest_of(sizes, np.array(errors), **dict(*named))
    assert (ranked.best, ranked.chosen) == found
    assert "eligible" not in dict(*named) or ranked.excess[0] < 0


@pytest.mark.parametrize(
    ("changes", "answer"),
    [
        ({}, "changed"),
        ({"interval": (0.9, 1.0)}, "cannot tell"),  # one is not excluded
        ({"ratio": 1.05, "interval": (1.0, 1.1)}, "cannot tell"),
        ({"ratio": 1.05, "interval": (1.04, 1.06)}, "changed"),
        ({"ratio": 0.985}, "cannot tell"),  # within the margin
        ({"ratio": 0.75, "interval": (0.7, 0.8), "narrow": (0.7, 0.8), "margin": 0.25},
         "cannot tell"),
        ({"resolution": 0.06}, "cannot tell"),  # less than can be told from none
        ({"same_recordings": True}, "settings"),
        ({"ratio": 1.0, "narrow": (0.985, 1.015), "interval": (0.98, 1.02)}, "same"),
        ({"ratio": 1.0, "narrow": (0.98, 1.01), "interval": (0.97, 1.02)}, "cannot tell"),
        ({"ratio": 1.0, "narrow": (0.99, 1.02), "interval": (0.97, 1.03)}, "cannot tell"),
        # models between levels of the other are surer of nothing than their uncertainty
        ({"ratio": 1.0, "narrow": (0.99, 1.01), "interval": (0.985, 1.015), "resolution": 0.02},
         "same"),
        ({"ratio": 1.0, "narrow": (0.99, 1.01), "interval": (0.985, 1.015), "resolution": 0.021},
         "cannot tell"),
    ],
)  # fmt: skip
def test_the_answer_follows_from_the_intervals_and_the_margin(changes, answer):
    """Of a margin of 2 %, and at each of its edges."""
    told = Comparison(
        "before",
        "after",
        "force",
        "N",
        (),
        **{
            "ratio": 0.95,
            "interval": (0.94, 0.96),
            "narrow": (0.945, 0.955),
            "p": 0.0,
            "p_permutation": None,
            "margin": 0.02,
            "resolution": 0.01,
        }
        | changes,
    )
    assert told.answer == answer
    assert told.changed == (answer == "changed")


@pytest.mark.parametrize(
    ("before", "after", "error", "moved"),
    [
        (1.0, 1.5, 0.25, False),  # by exactly twice the error
        (1.0, 0.4, 0.25, True),
        (1.0, 1.0, math.nan, True),
        (None, 1.0, 0.25, True),
        (1.0, None, 0.25, True),
    ],
)
def test_a_coefficient_moved_by_more_than_twice_its_error(before, after, error, moved):
    assert TermChange("a", "strain", before, after, error, LOWER_BOUND).moved == moved
