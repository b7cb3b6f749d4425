"""Formulas fitted to the error of an input: a closed-form oracle, recovery, derivatives, and what cannot be done."""

from __future__ import annotations

import numpy as np
import pytest
from common import curve_of
from literature_cases import wrist_points
from scipy.optimize import least_squares

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.modelling.literature import get
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.literature.errors_in import Along
from mapmore_cli.modelling.literature.formula import Formula


def noisy(scatter: float, seed: int = 1) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """W's points, the strain measured with an error."""
    columns, force = wrist_points()
    return {**columns, "strain": columns["strain"] + scatter * np.random.default_rng(seed).standard_normal(len(force))}, force


def formula(name: str) -> Formula:
    found = get(name)
    assert isinstance(found, Formula)
    return found


def test_the_minimum_is_that_of_the_formula_solved_by_hand() -> None:
    """`P (c1 (1 - e)^2 - c2) = F` has the strain `1 - sqrt((F/P + c2)/c1)`."""
    rng = np.random.default_rng(0)
    pressure, strain = rng.uniform(200, 600, 80), rng.uniform(0, 0.2, 80)
    force = pressure * (2.0 * (1 - strain) ** 2 - 0.8)
    columns = {"pressure": pressure, "strain": strain + 0.01 * rng.standard_normal(80)}
    fit = formula("chou_hannaford").fit_along(columns, force, "strain")
    by_hand = least_squares(lambda c: 1 - np.sqrt((force / pressure + c[1]) / c[0]) - columns["strain"], [1.9, 0.7], xtol=1e-14, ftol=1e-14)
    assert [fit.parameters["c1"], fit.parameters["c2"]] == pytest.approx(by_hand.x, rel=1e-6)
    covariance = 2 * by_hand.cost / 78 * np.linalg.inv(by_hand.jac.T @ by_hand.jac)
    assert [fit.errors["c1"], fit.errors["c2"]] == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-4)
    assert f"RMSE is {np.sqrt(2 * by_hand.cost / 80):.4g}" in fit.notes[0]


def test_exact_points_are_fitted_exactly_either_way() -> None:
    columns, force = noisy(0.0)
    along = formula("sarosi").fit_along(columns, force, "strain")
    assert along.parameters == pytest.approx(formula("sarosi").fit(columns, force).parameters, rel=1e-5)


def test_where_the_strain_is_measured_wrong_its_error_tells_the_muscle() -> None:
    """Over three tables with noise in the strain, the fit to that error is nearer to the true force than the fit to the force."""
    truth, force = wrist_points()
    worse = []
    for seed in range(3):
        columns, _ = noisy(0.003, seed)
        fits = [formula("sarosi").fit(columns, force), formula("sarosi").fit_along(columns, force, "strain")]
        errors = [formula("sarosi").solved(fit, truth, force, "strain") - truth["strain"] for fit in fits]
        worse.append(np.sqrt(np.nanmean(errors[0] ** 2)) / np.sqrt(np.nanmean(errors[1] ** 2)))
    assert np.exp(np.mean(np.log(worse))) > 1.2


@pytest.mark.parametrize("name", ["sarosi", "kerscher"])
def test_derivatives_of_the_strain_are_central_differences(name: str) -> None:
    columns, force = noisy(0.002)
    one = formula(name)
    problem = one._problem(columns, force)
    along = Along(problem, "strain")
    fit = one.fit(columns, force)
    values = [fit.parameters[parameter] for parameter in problem.names]
    place = np.array(values) * np.concatenate([np.ones(len(problem.linear)), problem.spans])
    told = np.isfinite(along.roots(place, beyond=False))
    matrix = along.jacobian(place)
    for i, x in enumerate(place):
        step = 1e-6 * max(abs(x), 1e-3) * np.eye(len(place))[i]
        expected = (along.roots(place + step) - along.roots(place - step)) / (2 * step[i])
        assert matrix[told, i] == pytest.approx(expected[told], rel=1e-3, abs=1e-5 * np.abs(expected[told]).max())


def test_samples_that_say_nothing_of_the_strain_are_told() -> None:
    columns, force = noisy(0.001)
    more = {"pressure": np.append(columns["pressure"], [0.0, 0.0]), "strain": np.append(columns["strain"], [0.1, 0.2])}
    fit = formula("chou_hannaford").fit_along(more, np.append(force, [1.0, 2.0]), "strain")
    without = formula("chou_hannaford").fit_along(columns, force, "strain")
    assert "without 2 sample(s)" in fit.notes[0]
    assert fit.parameters == pytest.approx(without.parameters, rel=1e-6)


def test_what_cannot_be_solved_is_refused() -> None:
    columns, force = noisy(0.0)
    with pytest.raises(SpecError, match="no input `length`"):
        formula("sarosi").fit_along(columns, force, "length")
    curve = curve_of({**columns, "force": force})
    with pytest.raises(SpecError, match="a way of its own"):
        fit_formula("sarosi_hinged", [curve], "force", errors_in="strain")
