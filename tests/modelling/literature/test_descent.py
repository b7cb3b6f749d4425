"""Least squares: descents, errors of parameters, and means of neighbouring samples."""

import numpy as np
import pytest

from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.literature import family
from mapmore_cli.modelling.literature.descent import descend
from mapmore_cli.modelling.literature.linear import parameter_errors, solve_linear
from mapmore_cli.modelling.literature.own import FamilySettings
from mapmore_cli.modelling.literature.problem import LeastSquares, Nonlinear, condensed


@pytest.mark.parametrize("method", ["trf", "lm"])
def test_a_start_without_a_value_has_no_end_and_a_step_to_such_a_place_is_not_taken(method):
    def system(x):
        return np.sqrt(x) - 0.001, 0.5 / np.sqrt(x)[:, None]

    (end,) = descend(system, [np.array([-1.0]), np.array([4.0])], method=method)
    assert end.converged
    assert end.x == pytest.approx([1e-6], rel=1e-4)


def test_a_coordinate_has_a_sign_that_its_intervals_allow():
    for intervals, allowed in (
        (((0.0, 5.0),), (False, True)),
        (((-5.0, 0.0),), (True, False)),
        (((-5.0, -1.0), (1.0, 5.0)), (True, True)),
        (((0.1, 0.5),), (False, True)),
        (((-0.5, -0.1),), (True, False)),
    ):
        free = (Nonlinear("b", per=None, intervals=intervals),)
        problem = LeastSquares(parse("b*x"), (), free, {}, {"x": np.ones(3)}, np.ones(3))
        assert tuple(problem.allows(np.array([c])) for c in (-2.0, 2.0)) == allowed


@pytest.mark.parametrize("unit", [1.0, 1e-200, 1e160])
def test_errors_of_parameters_are_those_of_the_inverse(unit):
    rng = np.random.default_rng(0)
    J = rng.normal(size=(20, 3))
    units = np.array([1.0, unit, 1.0])
    errors, rank, condition = parameter_errors(J * units, 4.0)
    np.testing.assert_allclose(errors * units, 2 * np.sqrt(np.diag(np.linalg.inv(J.T @ J))))
    singular = np.linalg.svd(J / np.linalg.norm(J, axis=0))[1]
    assert (rank, condition) == (3, pytest.approx(singular[0] / singular[-1]))
    y = rng.normal(size=20)
    fit, theta = solve_linear(J * units, y), np.linalg.lstsq(J, y, rcond=None)[0]
    np.testing.assert_allclose(fit.beta * units, theta)
    np.testing.assert_allclose(fit.residual, J @ theta - y, atol=1e-12)


def test_parameters_that_the_data_do_not_tell_apart_have_no_errors():
    x = np.linspace(-1, 1, 9)
    J = np.column_stack([x, -2 * x, x**2, 0 * x])
    errors, rank, condition = parameter_errors(J, 1.0)
    assert np.isnan(errors).tolist() == [True, True, False, True]
    assert errors[2] == pytest.approx(1 / np.linalg.norm(x**2))
    assert (rank, condition) == (2, pytest.approx(2**0.5))  # two alike, and one across
    assert parameter_errors(0 * J, 1.0)[1:] == (0, 1.0)


def test_means_of_neighbours_keep_sums():
    rng = np.random.default_rng(0)
    columns, y = {"a": rng.random(5000), "b": 7 * rng.random(5000)}, rng.random(5000)
    found, means, counts = condensed(columns, y)
    assert len(y) / 4 < len(means) <= 4096
    assert counts @ means == pytest.approx(y.sum())
    assert counts @ found["b"] == pytest.approx(columns["b"].sum())
    few = {name: x[:4096] for name, x in columns.items()}
    assert condensed(few, y[:4096])[0] is few


@pytest.mark.parametrize(("scale", "centre"), [("saturating", 19.03), ("power", 2.0)])
def test_the_law_of_a_family_is_least_squares_with_a_prior(scale, centre):
    """`sum (ln S - ln s(b) - mean)^2/.05^2 + (ln(b/centre)/.3)^2` over a fine grid of b."""
    made = family.family_of(FamilySettings(of="length", scale=scale).definition(1.0))
    lengths, largest = np.array([0.1, 0.2, 0.4]), np.array([100.0, 150.0, 240.0])
    tried = centre * np.exp(np.linspace(-2, 2, 40_001))
    law = {"power": lambda b: lengths**b, "saturating": lambda b: np.arctan(b * (lengths - 0.0075))}
    left = np.log(largest) - np.log(law[scale](tried[:, None]))
    cost = np.sum((left - left.mean(axis=1, keepdims=True)) ** 2, axis=1) / 0.05**2
    best = int(np.argmin(cost + (np.log(tried / centre) / 0.3) ** 2))
    a, b = made._law(lengths, largest)
    assert (a, b) == pytest.approx((np.exp(left[best].mean()), tried[best]), rel=1e-3)


def test_slack_and_largest_forces_are_quantiles():
    y = np.linspace(0.0, 1000.0, 1001)
    assert family._slack_and_largest(y) == pytest.approx((20.0, 975.0))
    assert family._slack_and_largest(y - 40) == pytest.approx((-20.0, 975.0))
    assert family._slack_and_largest(y + 100) == pytest.approx((0.0, 1095.0))
    assert family._slack_and_largest(y - 300) == pytest.approx((0.0, 695.0))


def test_one_parameter_of_shares_keeps_all_samples():
    """Others of many samples are fitted to means of neighbours first."""
    x = np.random.default_rng(1).uniform(0, 1, 50_000)
    free, share = (Nonlinear(name, per=None, intervals=((1.0, 2.0),), of=of)
                   for name, of in (("b", None), ("c", "x")))  # fmt: skip
    for nonlinear, whole in (((free,), False), ((free, share), True), ((share,), True)):
        problem = LeastSquares(parse("a*x"), ("a",), nonlinear, {}, {"x": x}, 2 * x)
        fewer = problem.condensed()
        assert (fewer is problem) == whole
        assert whole or (len(fewer.y) <= 4096 and fewer.counts.sum() == len(x))


def test_sums_over_means_are_those_over_the_samples_up_to_the_scatter_in_a_cell():
    """The range is divided into 512 cells, in which x scatters by a 512th over the root of 12."""
    x = np.random.default_rng(1).uniform(0, 1, 50_000)
    whole = LeastSquares(parse("a*x"), ("a",), (), {"a": parse("x")}, {"x": x}, 2 * x)
    sums = []
    for problem in (whole, whole.condensed()):
        phi, target = problem.linear_at(np.empty(0))
        sums.append(
            [problem.sse(np.ones(1), np.empty(0)), (phi.T @ target)[0], (phi.T @ phi)[0, 0]]
        )
    lost = (1 - np.divide(*sums[::-1])) * np.mean(x**2)
    assert lost == pytest.approx([1 / 12 / 512**2] * 3, rel=0.02)
