"""Signs of the static gain of models with memory: coefficients beside another solver, the output at
rest beside a long run, and fits that are only judged.
"""

import numpy as np
import pytest
from memory_samples import STEP, slow
from scipy.optimize import minimize

import mapmore_cli as mm
from mapmore_cli.domain.errors import FitError
from mapmore_cli.modelling.expressions.operators.play import play
from mapmore_cli.modelling.kinds import settled, simulate

TERMS = ["1", "slow(u, 0.3)", "slow(u, 0.3)^2", "slow(u, 0.3)^3", "play(u, 0.1)"]
RNG, TIME = np.random.default_rng(3), STEP * np.arange(1200)
U = np.repeat(RNG.uniform(0, 1, 40), 30) + 0.02 * np.sin(10 * TIME)
LAG, LASH, SIGMA = slow(U, 0.3, STEP), play(U, 0.1 * np.ptp(U)), 0.5 + U
# it rises with the held input, beyond its middle by the play alone
Y = np.tanh(6 * LAG) + 0.02 * LASH + RNG.normal(0, 0.05, 1200)


def fitted(terms, **settings):
    return mm.fit(
        {"time": TIME, "u": U, "y": Y, "sigma": SIGMA},
        target="y",
        dictionary=[{"terms": terms}],
        data={"uncertainty": {"y": "sigma"}},
        fit={"max_terms": len(terms), "tolerance": 0.0, "shape": {"u": "increasing"}, **settings},
    )


def test_coefficients_are_those_of_another_solver():
    found = fitted(TERMS)
    A = np.column_stack([LAG**0, LAG, LAG**2, LAG**3, LASH]) / SIGMA[:, None]
    held = np.linspace(0.4, 0.8, 2001)
    slopes = np.column_stack([0 * held, held**0, 2 * held, 3 * held**2, held**0])
    plain = np.linalg.lstsq(A, Y / SIGMA)[0]
    other = minimize(
        lambda theta: np.sum((A @ (theta - plain)) ** 2),
        np.eye(5)[1],
        method="SLSQP",
        constraints={"type": "ineq", "fun": slopes.__matmul__, "jac": lambda _: slopes},
        options={"ftol": 1e-14},
    )
    kept, shape = found.model.body.model, found.model.shape
    assert [kept.theta[kept.terms.index(term)] for term in TERMS] == pytest.approx(
        other.x, rel=1e-3
    )
    assert (slopes @ plain).min() < -0.05
    assert np.diff(settled(found.model, {"u": np.linspace(0, 1, 5000)})).min() > -1e-11
    assert held[np.argmin(slopes @ other.x)] == pytest.approx(shape.kept[0].binds["u"][0], abs=0.01)
    assert shape.training > shape.training_without
    assert np.isnan(kept.theta_error).all()  # those of other coefficients
    assert np.isfinite(fitted(TERMS[:2]).model.body.model.theta_error).all()
    assert [row["coefficient"] for row in found.summary().records] == [*kept.theta]


def test_the_output_at_rest_is_where_a_long_run_ends():
    terms = ["u[k-3]", "rate(u)", "stop(u, 0.1)", "creep(u, 0.5, 0.1)", "slow(y[k-1], 0.1)*u"]
    terms += ["y[k-1]", "resonance(u, 2, 0.5)", "coulomb(u, 0.2)", "saturate(u)^2"]
    model = fitted([*terms, *TERMS], slack=0.99).model
    held = {"time": STEP * np.arange(4000), "u": np.full(4000, 0.4), "y": np.ones(4000)}
    end = simulate(model, held).values[-1]
    assert settled(model, {"u": np.array([0.4])}) == pytest.approx(end, rel=1e-9)


@pytest.mark.parametrize(("more", "ridge"), [("y[k-1]", 0.0), ("play(u, 0.1)", 1e-6)])
def test_other_fits_are_judged(more, ridge):
    assert fitted([*TERMS[:2], more], ridge=ridge).model.shape.kept
    with pytest.raises(
        FitError, match=r"gain violates the shape by 0\.0\d+ 1, most at u: incr.* at u"
    ):
        fitted([*TERMS[:4], more], ridge=ridge)


def test_the_sign_holds_where_a_measured_rate_is_zero():
    """There it binds alone: beside, the product with the size of the rate makes it true."""
    rng = np.random.default_rng(1)
    u, rate = rng.uniform(0, 1, 1500), rng.uniform(-1, 2, 1500)
    y = (abs(rate) - 0.05) * u + 0.02 * rng.normal(size=1500)
    found = mm.fit(
        {"time": STEP * np.arange(1500), "u": u, "v": rate, "y": y},
        target="y",
        dictionary=[{"terms": ["1", "u", "u*abs(v)", "v", "u[k-1]"]}],
        fit={"max_terms": 5, "tolerance": 0.0, "shape": {"u": "increasing"}, "slack": 0.0},
        check=False,
    )
    held = {"u": np.linspace(0.1, 0.9, 200), "v": np.zeros(200)}
    assert np.diff(settled(found.model, held)).min() > -1e-9
    assert found.model.shape.kept[0].binds


def test_a_wrong_sign_is_refused_and_one_of_noise_is_told():
    """The method keeps a wrong sign by a static gain of zero."""
    wrong = r"`u: decreasing` makes the static gain zero.*rest changes by 0\.\d+ 1 in the other"
    with pytest.raises(FitError, match=wrong + r".*training error is \d\.\d+ times smaller"):
        fitted(TERMS[:2], shape={"u": "decreasing"})
    noise = 1 + np.random.default_rng(2).normal(size=1200)
    with pytest.warns(UserWarning, match="no better than the mean"):
        model = mm.fit(
            {"time": TIME, "u": U, "y": noise},
            target="y",
            dictionary=[{"terms": TERMS[:2]}],
            fit={"max_terms": 2, "tolerance": 0.0, "shape": {"u": "increasing"}},
            check=False,
        ).model
    assert any("makes the static gain zero" in note for note in model.notes)
