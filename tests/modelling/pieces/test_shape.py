"""A surface that keeps its shape: solutions beside another solver, the fused model on finer grids,
and what is refused.
"""

import re
import shutil
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import cvxpy
import numpy as np
import pytest
from agreement import compare
from common import curve_of
from numpy.polynomial.chebyshev import chebder, chebval, chebvander
from surfaces import built, changed, curves, recipe

from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.models import Formula
from mapmore_cli.domain.recording import CurveRange, uncertainty_of
from mapmore_cli.modelling.inverse import UNIQUE, invert
from mapmore_cli.modelling.kinds import outside_range, predict
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.shaped import _with_coefficients
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.modelling.shape import support
from mapmore_cli.modelling.shape import violations as of_shapes
from mapmore_cli.modelling.shape.least_squares import least_squares_under
from mapmore_cli.modelling.shape.region import region_of
from mapmore_cli.modelling.shape.stencils import POINTS, ShapeWord
from mapmore_cli.modelling.shape.support import LEVEL, RUNS, refuse_unsupported
from mapmore_cli.modelling.shape.violations import known_shape, verified, violations, with_shape

SHAPE = {"pressure": "increasing", "strain": "decreasing"}
WAVY = {"shape": SHAPE, "max_terms": 3}


def by_other_solver(A, y, D, d):
    theta = cvxpy.Variable(A.shape[1])
    problem = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(A @ theta - y)), [D @ theta >= d])
    exact = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-13)
    problem.solve(solver=cvxpy.CLARABEL, **exact)
    return theta.value


@pytest.mark.parametrize("seed", range(20))
def test_another_solver_finds_the_same_coefficients(seed):
    rng = np.random.default_rng(seed)
    k, n = rng.integers(2, 9), 40
    A, y = rng.normal(size=(n, k)), rng.normal(size=n)
    D, d = rng.normal(size=(30, k)), -rng.uniform(0, 0.3, 30)
    Q, R = np.linalg.qr(A)
    found = least_squares_under(R, Q.T @ y, D, d)
    assert found.met
    assert found.force.any()
    assert found.theta == pytest.approx(by_other_solver(A, y, D, d), abs=1e-7)


def test_inequalities_that_contradict_each_other_are_named():
    D, d = np.array([[1.0, 0], [-1, 0], [0, 1]]), np.array([1.0, 1, -1])
    found = least_squares_under(np.eye(2), np.zeros(2), D, d)
    assert not found.met
    assert found.force.astype(bool).tolist() == [True, True, False]


def finer(samples):
    """A grid over the range, and where the output between the levels stands clear of its least."""
    pressure, strain = np.meshgrid(
        np.linspace(80, 350, 300), np.linspace(0, 0.23, 300), indexing="ij"
    )
    height = [np.interp(strain[0], one.columns["strain"], one.columns["force"]) for one in samples]
    levels = [one.level for one in samples]
    between = np.array(
        [np.interp(pressure[:, 0], levels, column) for column in np.transpose(height)]
    )
    everything = np.concatenate([one.columns["force"] for one in samples])
    return pressure, strain, everything.min() + 0.07 * np.ptp(everything) < between.T


def worst(values, clear):
    """The largest steps against the shape, as parts of the range."""
    values = np.where(clear, values, np.nan)
    falls = np.nanmax(-np.diff(values, axis=0)), np.nanmax(np.diff(values, axis=1))
    return max(falls) / np.nanmax(values)


def over(model, pressure, strain, clear):
    columns = {"pressure": pressure.ravel(), "strain": strain.ravel()}
    inside = ~outside_range(model, columns).reshape(clear.shape)
    return columns, clear & inside


WAYS = {
    "pieces": {"cuts": {"strain": Cuts("even", 2)}},
    "steps": {"z_s": 0.0},
    "keeping levels": {"levels": "pchip", "cuts": {"strain": Cuts("even", 2)}},
    "a surface": {
        "cuts": {},
        "level": None,
        "dictionary": ("1", *(f"pressure^{i}*strain^{j}" for i in range(1, 4) for j in range(4))),
        "max_terms": 13,
    },
}


@pytest.mark.parametrize(
    "way", [pytest.param(one, marks=pytest.mark.long) if one == "steps" else one for one in WAYS]
)
def test_the_fused_model_keeps_its_shape_on_a_finer_grid(way):
    samples, settings = curves(held_out=(), noise=5.0), WAVY | WAYS[way]
    plain, model = (built(samples, **{**settings, "shape": one}) for one in (None, SHAPE))
    columns, clear = over(model, *finer(samples))
    values = predict(model, columns).reshape(clear.shape)
    assert worst(predict(plain, columns).reshape(clear.shape), clear) > 1e-4
    assert worst(values, clear) < 1e-9
    assert [one.amount for one in known_shape(None, model, samples)] == [0.0, 0.0]
    assert any(one.binds for one in model.shape.kept)
    if way == "pieces":
        rows = {name: x[clear.ravel()][::400] for name, x in columns.items()}
        status = invert(model, predict(model, rows), {"strain": rows["strain"]}, "pressure").status
        assert {*status} == {UNIQUE}
        if shutil.which("gcc") is not None:
            compare(model, Path(mkdtemp()), 300)


def test_a_shape_that_does_not_bind_changes_nothing():
    plain, model = (built(max_terms=1, shape=one) for one in (None, SHAPE))
    assert [one.theta.tolist() for one in model.body.segments] == [
        one.theta.tolist() for one in plain.body.segments
    ]
    assert not any(one.binds for one in model.shape.kept)


@pytest.mark.parametrize("unsure", [False, True])
def test_a_single_curve_is_the_constrained_least_squares_of_another_solver(unsure):
    """Order five through noise, which must be convex; samples may count by their uncertainty."""
    rng = np.random.default_rng(2)
    x = np.linspace(0, 1, 40)
    y = 5 * np.exp(-8 * x) + rng.normal(0, 0.15, 40)
    sigma = 0.05 + x if unsure else np.ones(40)
    columns = {"strain": x, "force": y, uncertainty_of("force"): sigma}
    one = curve_of(columns)
    words = {"strain": ["convex"]}
    settings = {"level": None, "cuts": {}, "scaling": "none", "max_terms": 5, "tolerance": 0.0}
    model = built((one,), shape=words, slack=0.0, **settings)
    A, dense = np.vander(x, 5), np.linspace(0, 1, 3001)
    powers = np.arange(4, -1, -1)
    second = powers * (powers - 1) * dense[:, None] ** np.maximum(powers - 2, 0)
    theta = by_other_solver(A / sigma[:, None], y / sigma, second, np.zeros(3001))
    assert model.shape.kept[0].binds
    # the last step of the grid ends before the range does
    assert predict(model, {"strain": x}) == pytest.approx(A @ theta, abs=4e-3 if unsure else 1e-3)


@pytest.mark.parametrize(
    ("order", "word"),
    [(9, "increasing"), (12, "increasing"), (12, "convex")]
    + [
        pytest.param(order, word, marks=pytest.mark.long)
        for order in range(3, 13)
        for word in ("increasing", "convex")
    ],
)
def test_high_orders_are_as_good_as_a_dense_quadratic_program(order, word):
    """In Chebyshev's basis, with the derivative at 4001 places."""
    x = np.sort(np.random.default_rng(order).uniform(0, 1, 80))
    steep = np.tanh(25 * (x - 0.4)) if word == "increasing" else np.abs(x - 0.4)
    y = 100 * steep + x
    one = curve_of({"strain": x, "force": y})
    terms = ("1", "strain", *(f"strain^{power}" for power in range(2, order + 1)))
    how = {"level": None, "cuts": {}, "max_terms": order + 1, "tolerance": 0.0}
    model = built((one,), dictionary=terms, shape={"strain": word}, slack=0.0, **how)
    u = (2 * x - x[0] - x[-1]) / np.ptp(x)
    basis, times = np.eye(order + 1), POINTS[word] - 1
    slopes = np.column_stack(
        [chebval(np.linspace(-1, 1, 4001), chebder(each, times)) for each in basis]
    )
    Q, R = np.linalg.qr(chebvander(u, order))
    slopes /= np.linalg.norm(slopes, axis=1)[:, None]
    best = least_squares_under(R, Q.T @ y, slopes, np.zeros(4001))
    assert best.force.any()
    least = np.sum((chebvander(u, order) @ best.theta - y) ** 2)
    assert np.sum((predict(model, {"strain": x}) - y) ** 2) < 1.001 * least


def test_a_wave_violates_its_shape_by_all_its_rises(monkeypatch):
    """Chebyshev's polynomial of order 4 rises twice by 2, which is its range."""
    x = np.linspace(0, 1, 300)
    columns = {"strain": x, "force": chebval(2 * x - 1, [0, 0, 0, 0, 1])}
    wave = curve_of(columns)
    terms = ("1", *(f"strain^{power}" for power in range(1, 5)))
    model = built(
        (wave,), dictionary=terms, level=None, cuts={}, max_terms=5, tolerance=0.0, scaling="none"
    )
    region = region_of(model, [wave], Fit(shape={}, slack=0.0))
    asked = [ShapeWord("strain", "decreasing")]
    (found,) = violations(model, asked, region)
    assert (found.amount, found.share) == pytest.approx((4, 2), rel=1e-3)
    for rise in (0.5e-9, 3e-9):  # of the range; less than 1e-9 is rounding
        step = rise * np.ptp(columns["force"])
        monkeypatch.setattr(
            of_shapes, "settled", lambda _, at, step=step: step * (at["strain"] > 0.5)
        )
        (found,) = violations(model, asked, region)
        assert found.share == pytest.approx(rise * (rise > 1e-9))


def noisy(true, n, seed, noise=0.05):
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(0, 1, n))
    y = true(x) + noise * rng.normal(size=n)
    return [curve_of({"strain": x, "force": y})]


FALLING = recipe(shape={"strain": "decreasing"}, slack=0.0).fit


@pytest.mark.parametrize("true", [lambda x: (1 - x) ** 2, lambda x: np.exp(-12 * x)])
@pytest.mark.parametrize("n", [40, 300])
def test_noise_does_not_contradict_a_sign(true, n):
    for seed in range(20):
        samples = noisy(true, n, seed)
        refuse_unsupported(samples, "force", ["strain"], None, FALLING)


@pytest.mark.parametrize(
    "true",
    [lambda x: x, lambda x: 1.2 * np.exp(-(((x - 0.5) / 0.1) ** 2)) - x, lambda x: abs(x - 0.6)],
)
def test_what_contradicts_a_sign_beyond_its_noise_is_refused(true):
    for seed in range(5):
        samples = noisy(true, 200, seed)
        with pytest.raises(FitError, match=r"contradict it, by .* times what their noise explains"):
            refuse_unsupported(samples, "force", ["strain"], None, FALLING)


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_samples_without_noise_contradict_a_sign_in_any_unit(unit):
    x = np.linspace(0, 1, 40)
    with pytest.raises(FitError, match="contradict it, by"):
        refuse_unsupported(
            [curve_of({"strain": x, "force": unit * x})], "force", ["strain"], None, FALLING
        )


def scattered(true, inputs, n, noise, seed):
    rng = np.random.default_rng([seed, n, inputs])
    z = rng.uniform(0, 1, (inputs, n))
    y = true(z)
    y = y + noise * np.ptp(y) * rng.normal(size=n)
    columns = {f"x{i}": x for i, x in enumerate(z)} | {"force": y}
    return [curve_of(columns)]


def rising(inputs, word="increasing"):
    names = [f"x{i}" for i in range(inputs)]
    return names, recipe(shape=dict.fromkeys(names, word), slack=0.0).fit


@pytest.mark.parametrize(
    ("true", "inputs", "noise"),
    [
        (lambda z: z[0] + 2 * z[1] + 3 * z[2], 3, 0.05),
        (lambda z: np.exp(4 * z).sum(axis=0), 3, 0.01),
        (lambda z: np.exp(4 * z).sum(axis=0), 2, 0.01),
    ],
    ids=["plane", "bent", "bent along two"],
)
@pytest.mark.parametrize("n", [80, 400])
def test_true_signs_of_scattered_samples_are_not_contradicted(true, inputs, noise, n):
    """Neither beyond the samples, where the nearest one has other values of the other inputs, nor
    between samples that lie far apart and bend.
    """
    names, fit = rising(inputs)
    for seed in (1, 6):
        samples = scattered(true, inputs, n, noise, seed)
        refuse_unsupported(samples, "force", names, None, fit)


def test_wrong_signs_of_scattered_samples_are_contradicted():
    names, fit = rising(3, "decreasing")
    samples = scattered(lambda z: z[0] + 2 * z[1] + 3 * z[2], 3, 200, 0.05, 0)
    with pytest.raises(FitError, match="contradict it, by"):
        refuse_unsupported(samples, "force", names, None, fit)
    names, fit = rising(2)
    samples = scattered(lambda z: z[0] + abs(z[1] - 0.6), 2, 300, 0.05, 0)
    with pytest.raises(FitError, match=r"`x1: increasing`.* contradict it, by"):
        refuse_unsupported(samples, "force", names, None, fit)


def test_signs_and_bounds_hold_for_coefficients_in_the_unit_of_the_target():
    """Of free terms, the other coefficients go on fitting."""
    terms = {"dictionary": ("1", "strain", "strain^2"), "max_terms": 3, "cuts": {}}
    bounds = {"strain": (-np.inf, -400.0), "strain^2": (0.0, 5.0)}
    plain, model = built(**terms), built(bounds=bounds, **terms)
    for name, (low, high) in bounds.items():
        found = [
            theta * one.scaling.y_slope
            for one in model.body.segments
            for term, theta in zip(one.terms, one.theta, strict=True)
            if term == name
        ]
        assert len(found) == 3
        assert min(found) >= low - 1e-9
        assert max(found) <= high + 1e-9
    assert model.shape.training > model.shape.training_without
    assert built(bounds={"1": (-1e9, 1e9)}, **terms).body.segments[0].theta == pytest.approx(
        plain.body.segments[0].theta, rel=1e-12
    )


@pytest.mark.parametrize(("change", "known"), [(5e-10, True), (5e-9, False)])
def test_a_coefficient_that_changes_loses_its_standard_error(change, known):
    body = built(max_terms=1).body
    theta = np.concatenate([segment.theta for segment in body.segments])
    theta[0] *= 1 + change
    errors = [one.theta_error for one in _with_coefficients(body, theta).segments]
    assert np.isfinite(errors[0]).all() == known
    assert np.isfinite(errors[1:]).all()


def refused(samples, shape, **settings):
    fit = recipe(shape=shape).fit
    model = built(samples, max_terms=1, **settings)
    names = [one.name for one in model.inputs]
    with pytest.raises(FitError) as told:
        refuse_unsupported(samples, model.output.name, names, model.level, fit)
    return str(told.value)


def test_a_sign_that_the_training_data_contradict_or_hardly_tell_is_refused():
    samples = curves(held_out=())
    assert re.search(
        "`strain: increasing` was examined at [0-9]+ differences of the training data, "
        "of which [0-9]+",
        refused(samples, {"strain": "increasing"}),
    )
    few = [one.at(np.arange(0, one.size, 60)) for one in samples[:2]]
    told = refused(few, {"pressure": "increasing"}, cuts={})
    assert re.search("`pressure: increasing` was examined at [0-9] differences", told)
    assert "`length` is not an input" in refused(samples, {"length": "increasing"})


@pytest.mark.parametrize(
    ("rises", "size", "examined"),
    [(1, 0.01, False), (2, 0.01, True), (2, 3e-9, True), (2, 0.5e-9, False)],
)
def test_one_in_twenty_differences_may_have_the_wrong_sign(rises, size, examined, monkeypatch):
    """Others must not, unless they are rounding errors, below 1e-9 of the range."""
    seen = []
    monkeypatch.setattr(support, "_contradiction", lambda *how: seen.append(how))
    x = np.linspace(0, 1, 22)
    y = -x + (1 / 21 + size) * np.isin(np.arange(22), [5, 12][:rises])
    refuse_unsupported([curve_of({"strain": x, "force": y})], "force", ["strain"], None, FALLING)
    assert bool(seen) == examined


def test_noise_alone_is_rarely_mistaken_for_a_contradiction(monkeypatch):
    """Without a confirmation, once in a hundred times; at a level of ten per cent, the last of
    these recordings would be refused.
    """
    monkeypatch.setattr(support, "_confirmed", lambda *_: True)
    for seed in (0, 1, 2, 3, 31):
        refuse_unsupported(noisy(lambda x: 0 * x, 100, seed), "force", ["strain"], None, FALLING)


@pytest.mark.parametrize(("n", "enough"), [(11, False), (12, True)])
def test_a_sign_needs_ten_differences(n, enough):
    """The sample of the least output belongs to the slack part."""
    x = np.linspace(0, 1, n)
    line = [curve_of({"strain": x, "force": -x})]
    if enough:
        refuse_unsupported(line, "force", ["strain"], None, FALLING)
        return
    with pytest.raises(FitError, match="examined at 9 differences"):
        refuse_unsupported(line, "force", ["strain"], None, FALLING)
    refuse_unsupported(line, "force", ["strain"], None, FALLING, fewest=9)
    refuse_unsupported(line, "force", ["strain"], None, FALLING, over_time=True)


@pytest.mark.parametrize("kind", ["mckibben", "peano", "coiled", None])
def test_a_muscle_has_a_shape_without_a_word_in_the_spec(kind):
    """Of training samples alone, and for the kinds of which it is known."""
    turned = [changed(one, force=-one.columns["force"]) for one in curves(held_out=())]
    found = known_shape(kind, built(turned, max_terms=1), turned)
    assert {(one.asked.quantity, one.asked.word) for one in found} == (
        set(SHAPE.items()) if kind in ("mckibben", "peano") else set()
    )
    assert all(one.share > 0.5 for one in found)


def test_errors_with_a_shape_are_those_of_training_and_of_held_out_samples():
    samples = curves()
    model = built(max_terms=1)
    found = with_shape(model, model, samples, None, recipe(shape=SHAPE).fit).shape
    held, trained = (
        np.concatenate(
            [predict(model, s.columns) - s.columns["force"] for s in samples if s.level in levels]
        )
        for levels in ((250.0,), (80.0, 150.0, 350.0))
    )
    assert (found.training, found.held_out) == pytest.approx(
        (np.sqrt(np.mean(trained**2)), np.sqrt(np.mean(held**2)))
    )
    assert np.isnan(
        with_shape(model, model, curves(held_out=()), None, recipe(shape=SHAPE).fit).shape.held_out
    )


def test_a_shape_that_no_coefficients_keep_is_told_with_the_place():
    """Linear transitions bend where segments meet."""
    with pytest.raises(FitError, match=r"no coefficients .* strain: convex at pressure = "):
        built(curves(held_out=()), max_terms=3, shape={"strain": "convex"})


def test_a_formula_keeps_a_shape_by_itself_or_is_refused():
    samples, fit = curves(held_out=()), recipe(shape=SHAPE).fit
    model = built(samples, max_terms=1)
    ranges = tuple(CurveRange(one.curve, one.level, one.limits) for one in model.body.curves)
    whole = replace(
        model, body=Formula(fit_formula("sarosi", samples, "force"), "pressure", ranges)
    )
    assert {one.word for one in verified(whole, samples, fit).shape.kept} == {*SHAPE.values()}
    wrong = recipe(shape={"strain": "increasing"}).fit
    with pytest.raises(
        FitError, match=r"the fitted formula violates the shape by .* strain: increasing at"
    ):
        verified(whole, samples, wrong)


def test_the_level_of_the_test_against_noise_is_met_exactly():
    """A share of `(1 + count) / (RUNS + 1)` can be equal to the level (Davison and Hinkley 1997,
    section 4.2).
    """
    assert pytest.approx(round((RUNS + 1) * LEVEL), abs=1e-12) == (RUNS + 1) * LEVEL


@pytest.mark.parametrize(("times", "notes"), [(1.08, 0), (1.12, 1)])
def test_what_a_shape_costs_is_noted_from_a_tenth_on(times, notes):
    """A model that is off everywhere, so that its training error is so many times as large."""
    samples, plain = curves(held_out=()), built(curves(held_out=()), max_terms=3)
    errors = np.concatenate([predict(plain, s.columns) - s.columns["force"] for s in samples])
    mean, square = errors.mean(), np.mean(errors**2)
    off = -mean + np.sqrt(mean**2 + (times**2 - 1) * square)

    def moved(one):
        level = one.scaling.y_intercept + off
        return replace(one, scaling=replace(one.scaling, y_intercept=level))

    moved_curves = tuple(
        replace(curve, segments=tuple(map(moved, curve.segments))) for curve in plain.body.curves
    )
    model = replace(plain, body=replace(plain.body, curves=moved_curves))
    found = with_shape(plain, model, samples, None, recipe(shape=SHAPE).fit)
    assert found.shape.training == pytest.approx(times * found.shape.training_without)
    assert found.shape.training_without == pytest.approx(np.sqrt(square))
    assert len(found.notes) == len(plain.notes) + notes
