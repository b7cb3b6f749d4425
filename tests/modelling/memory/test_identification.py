"""Numbers of operators that training finds: against records that were made with known ones, and
against an integrator of their equation.
"""

import numpy as np
import pytest
from memory_samples import STEP, recipe_of, record, slow, wandering
from scipy.integrate import solve_ivp

from mapmore_cli.modelling.expressions.operator import FLOATS, Setting, along
from mapmore_cli.modelling.expressions.operators import OPERATORS
from mapmore_cli.modelling.memory import fitting
from mapmore_cli.modelling.memory.fitting import fit_with_memory
from mapmore_cli.modelling.memory.free_run import Along


@pytest.mark.parametrize("rates", [(2.0, 8.0), (0.0, 3.0), (5.0, 0.0), (-1.4, 9.0), (30.0, 30.0)])
def test_wen_solves_its_differential_equation(rates):
    """The oracle integrates dz/du sample by sample with tight tolerances, whatever the branches."""
    x = wandering(120, seed=3)
    limits = (float(x.min()), float(x.max()))
    z, expected = 0.0, [0.0]
    for d in np.diff(x) / (limits[1] - limits[0]):
        grows = np.sign(d)
        rate = lambda _u, w, s=grows: (  # noqa: E731
            s * (1 - (rates[0] if s * w[0] >= 0 else -rates[1]) * abs(w[0]))
        )
        z = float(
            solve_ivp(
                rate, (0, abs(d)), [z], rtol=1e-10, atol=1e-13, max_step=max(abs(d) / 20, 1e-12)
            ).y[0, -1]
        )
        expected.append(z)
    found = along(OPERATORS["wen_stiffening"], x, Setting(rates, STEP, limits))
    np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())
    if rates[0] > 0:
        assert np.abs(found).max() <= 1 / rates[0] + 1e-12


def oscillator(operator, numbers, u):
    """`y[k]` of two delays, the input and a hysteretic state of `y[k-1]`, whose range is found by
    running it twice.
    """
    limits = (0.0, 1.0)
    for _ in range(60):
        rule = OPERATORS[operator].recursion(Setting(numbers, STEP, limits))
        y, z = [0.0, 0.0], 0.0
        for k in range(2, len(u)):
            z = rule.next(FLOATS, z, y[-1], y[-2])
            friction = 0.05 * z * (limits[1] - limits[0])
            y.append(1.8 * y[-1] - 0.9 * y[-2] + 0.02 * u[k] - friction)
        reached = (min(y[:-1]), max(y[:-1]))
        if np.allclose(reached, limits, rtol=1e-12):
            break
        limits = reached
    return np.array(y)


def identified(operator, u, y):
    """The model that training finds from a dictionary without numbers."""
    recipe = recipe_of(
        "y", ["y[k-1]", "y[k-2]", "u", f"{operator}(y[k-1])"], max_terms=4, criterion="free_run"
    )
    return fit_with_memory([record(u=u, y=y)], recipe)


@pytest.mark.parametrize(("operator", "numbers"), [("wen", (3.0, 12.0)), ("dahl", (25.0,))])
def test_a_hysteretic_oscillator_is_found_again(operator, numbers):
    u = wandering(320, 2) + np.random.default_rng(2).normal(0, 1, 320)
    y = oscillator(operator, numbers, u)
    fit = identified(operator, u, y)
    np.testing.assert_allclose(fit.identified.numbers, numbers, rtol=0.01)
    assert not fit.identified.held.any()
    assert np.abs(Along(fit.model)({"u": u, "y": y}).values[2:] - y[2:]).max() < 1e-3 * np.ptp(y)


SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(1, 10))]


@pytest.mark.parametrize("nested", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_slow_state_and_a_play_are_found_again(seed, nested):
    """From a dictionary without a number: `a slow(x, tau) + b play(x, width)`, and `slow(play(x,
    width), tau)`.
    """
    rng = np.random.default_rng(seed)
    x = wandering(1500, seed)
    tau, width = (
        float(np.exp(rng.uniform(np.log(0.05), np.log(3.0)))),
        float(rng.uniform(0.02, 0.35)),
    )
    follows = along(OPERATORS["play"], x, Setting((width,), STEP, (x.min(), x.max())))
    a, b = rng.uniform(0.5, 2.0, 2)
    truth = slow(follows if nested else x, tau, STEP)
    y = a * truth if nested else a * truth + b * follows
    dictionary = ["x", "slow(play(x))"] if nested else ["x", "slow(x)", "play(x)"]
    fit = fit_with_memory(
        [record(x=x, y=y)], recipe_of("y", dictionary, max_terms=1 if nested else 2)
    )
    assert fit.identified.numbers == pytest.approx(
        [width, tau] if fit.identified.names[0].startswith("widths") else [tau, width], rel=0.01
    )


def test_open_numbers_follow_terms_whatever_order_they_are_chosen_in():
    x = wandering(1500, 5)
    lagging = slow(x, 0.2, STEP)
    y = lagging**2 + 0.5 * lagging * x
    dictionary = ["x", "x*slow(x)", "slow(x)", "slow(x)^2", "x^2"]
    fit = fit_with_memory(
        [record(x=x, y=y)],
        recipe_of("y", dictionary, max_terms=5, scaling="range", margin=0.5, ridge=1e-9),
    )
    assert fit.identified.numbers == pytest.approx([0.2], rel=1e-3)
    assert set(fit.model.states.names) == {"x", f"slow(x, {float(fit.identified.numbers[0])!r})"}


def test_a_part_of_a_record_is_fitted_from_the_fit_of_all_of_it(monkeypatch):
    """The numbers that were found are where the search begins: no set of starts is tried, and free
    runs do not begin with short horizons.
    """
    x = wandering(1500, 5)
    y = slow(x, 0.2, STEP) + 0.3 * x + 0.01 * np.random.default_rng(1).normal(size=1500)
    recipe = recipe_of("y", ["x", "slow(x)"], max_terms=2)
    near = fit_with_memory([record(x=x, y=y)], recipe)
    some = [record(x=x, y=y, training=np.arange(1500) < 900)]
    searched = fit_with_memory(some, recipe)
    for search in ("_start", "refine"):
        monkeypatch.setattr(fitting, search, None)
    found = fit_with_memory(some, recipe, near=near)
    assert found.identified.numbers == pytest.approx(searched.identified.numbers, rel=1e-5)
    assert sorted(found.model.theta) == pytest.approx(sorted(searched.model.theta), rel=1e-5)


def test_a_number_at_its_bound_is_told():
    u = wandering(320, 4) + np.random.default_rng(4).normal(0, 1, 320)
    fit = identified("wen", u, oscillator("wen_stiffening", (-1.5, 6.0), u))
    assert fit.identified.held.tolist() == [True, False]
    assert np.isnan(fit.identified.errors[0])
    assert "p of wen(y[k-1]) = 0 lies at a bound" in fit.identified.notes[0]
