"""The static formulas: what they say, what is recovered, what units and row order may change (nothing)."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from literature_cases import WRIST, grid, noisy_wrist, wrist_force
from scipy.optimize import brentq

from mapmore_cli.modelling.expressions import to_latex, to_text
from mapmore_cli.modelling.literature import Formula, UnknownFormula, get, names

WRIST_GRID = grid(np.arange(1.0, 8.0), np.linspace(0.0, 0.2, 13))


def test_there_is_a_formula_for_every_name() -> None:
    geometric = {"chou_hannaford", "tondu_lopez", "tondu_lopez_corrected", "kerscher"}
    assert {"sarosi", "sarosi_hinged", "polynomial_2", "polynomial_5", *geometric} <= set(names())
    assert [get(name).name for name in names()] == list(names())
    for formula in map(get, names()):
        if type(formula) is Formula:
            formula.checked()


def test_an_unknown_formula_is_a_key_error_with_the_nearest_name() -> None:
    with pytest.raises(UnknownFormula, match="did you mean `sarosi`") as caught:
        get("saroshi")
    assert isinstance(caught.value, KeyError)
    with pytest.raises(UnknownFormula, match=r"there are: .*polynomial_2"):
        get("__init__")


def test_published_wrist_muscle() -> None:
    sarosi = get("sarosi")

    def force(pressure: float, strain: float) -> float:
        return float(sarosi.predict(WRIST, {"pressure": np.array([pressure]), "strain": np.array([strain])})[0])

    assert force(7.0, 0.0) == pytest.approx(525.5, abs=0.1)
    assert brentq(lambda strain: force(7.0, strain), 0.1, 0.25) == pytest.approx(0.194, abs=5e-4)
    np.testing.assert_allclose(sarosi.predict(WRIST, WRIST_GRID), wrist_force(WRIST_GRID), rtol=1e-13, atol=1e-10)


@settings(deadline=None, max_examples=40)
@given(st.floats(-40, 40), st.tuples(*[st.floats(0.2, 1) for _ in range(5)]), st.floats(0.05, 30))
def test_any_curvature_is_recovered(curvature: float, weights: tuple[float, ...], widest: float) -> None:
    """Of either sign, and whatever the unit of the strain."""
    assume(abs(curvature) > 0.3)
    columns = grid(np.array([80.0, 150.0, 250.0, 350.0]), np.linspace(0.0, widest, 40))
    p, x = columns["pressure"] / 350, columns["strain"] / widest
    shape = np.exp(curvature * x) / max(1.0, np.exp(curvature))
    y = (weights[0] * p - weights[1]) * shape - weights[2] * p * x + weights[3] * p + weights[4]
    fit = get("sarosi").fit(columns, y)
    assert fit.status == "converged"
    assert fit.parameters["a3"] * widest == pytest.approx(curvature, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_no_grid_of_curvatures_finds_a_better_fit(seed: int) -> None:
    columns, y = noisy_wrist(seed, noise=60.0, rows=40)
    fit = get("sarosi").fit(columns, y)
    p, x = columns["pressure"], columns["strain"]
    for c in np.concatenate([-np.geomspace(1e-3, 50, 400), np.geomspace(1e-3, 50, 400)]) / x.max():
        phi = np.stack([p * np.exp(c * x), np.exp(c * x), p * x, p, np.ones_like(p)], axis=1)
        phi /= np.linalg.norm(phi, axis=0)
        residual = phi @ np.linalg.lstsq(phi, y, rcond=None)[0] - y
        assert fit.sse <= residual @ residual * (1 + 1e-9)


@pytest.mark.parametrize(("pressures", "rank"), [(1, 6), (2, 11), (3, 15), (4, 18), (5, 20), (6, 21), (7, 21)])
def test_rank_of_polynomial_5_by_number_of_pressures(pressures: int, rank: int) -> None:
    columns = grid(np.linspace(80, 350, pressures), np.linspace(0, 0.25, 40))
    fit = get("polynomial_5").fit(columns, wrist_force({**columns, "pressure": columns["pressure"] / 100}))
    assert fit.rank == rank
    assert (fit.status == "rank_deficient") == (rank < 21)
    assert np.isnan(list(fit.errors.values())).all() == (rank < 21)
    if rank < 21:
        assert f"rank {rank} of 21" in fit.notes[0]
        assert f"{pressures} of pressure" in fit.notes[0]


def test_minimum_norm_solution_is_numpys_on_unit_columns() -> None:
    columns = grid(np.array([80.0, 150.0, 350.0]), np.linspace(0, 0.25, 30))
    y = wrist_force({**columns, "pressure": columns["pressure"] / 100})
    formula = get("polynomial_5")
    fit = formula.fit(columns, y)
    phi = np.stack([columns["strain"] ** int(name[1]) * columns["pressure"] ** int(name[2]) for name in formula.parameters], axis=1)
    lengths = np.linalg.norm(phi, axis=0)
    expected = np.linalg.lstsq(phi / lengths, y, rcond=1e-12)[0]
    np.testing.assert_allclose(np.array(list(fit.parameters.values())) * lengths, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def test_polynomial_2_is_eq_15() -> None:
    columns, _ = noisy_wrist(0)
    p, x = columns["pressure"], columns["strain"]
    published = {"a20": 1.0, "a11": -2.0, "a10": 3.0, "a01": -4.0, "a00": 5.0}
    y = x**2 - 2 * x * p + 3 * x - 4 * p + 5
    formula = get("polynomial_2")
    np.testing.assert_allclose(formula.predict(published, columns), y, rtol=1e-12)
    fit = formula.fit(columns, y)
    assert fit.method == "linear least squares"
    assert dict(fit.parameters) == pytest.approx(published, rel=1e-9)


def test_the_equation_reads_as_published() -> None:
    fit = get("sarosi").fit(WRIST_GRID, wrist_force(WRIST_GRID))
    assert to_text(get("sarosi").equation(fit), digits=6) == (
        "(-5.699*pressure + 158.773)*exp(-42.647*strain) - 299.482*strain*pressure + 86.216*pressure - 196.865"
    )
    assert to_latex(get("sarosi").expression).startswith(r"\left(a_{1} \, \mathrm{pressure} + a_{2}\right) \, \exp\left(")
