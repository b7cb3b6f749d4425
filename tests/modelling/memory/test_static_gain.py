"""Signs of the static gain of models with memory: coefficients beside another solver, the output at
rest beside a long run, and what is refused.
"""

import numpy as np
import pytest
from memory_samples import slow
from scipy.optimize import minimize

import mapmore_cli as mm
from mapmore_cli.domain.errors import FitError, SpecError
from mapmore_cli.modelling.expressions.operators.play import play
from mapmore_cli.modelling.kinds import settled, simulate

STEP = 0.02
TERMS = ["1", *(f"slow(u, 0.3)^{power}" for power in (1, 2, 3)), "play(u, 0.1)"]
N = 1200
U = np.repeat(np.random.default_rng(3).uniform(0, 1, 60), 20) + 0.02 * np.sin(np.arange(N) / 5)
SLOW, PLAY = slow(U, 0.3, STEP), play(U, 0.1 * np.ptp(U))
NOISE, SIGMA = np.random.default_rng(4).normal(size=N), 0.5 + U


def fitted(terms, noise=0.05, known="increasing", **settings):
    """Fit an output that rises with the held input, beyond its middle by the play alone."""
    y = np.tanh(6 * SLOW) + 0.02 * PLAY + noise * NOISE
    return mm.fit(
        {"time": STEP * np.arange(N), "u": U, "y": y, "sigma": SIGMA},
        target="y",
        dictionary=[{"terms": terms}],
        data={"uncertainty": {"y": "sigma"}},
        fit={"max_terms": len(terms), "tolerance": 0.0, "shape": {"u": known}, **settings},
    )


def test_coefficients_are_those_of_another_solver():
    found = fitted(TERMS)
    A = np.column_stack([np.ones(N), SLOW, SLOW**2, SLOW**3, PLAY])
    y, x = np.tanh(6 * SLOW) + 0.02 * PLAY + 0.05 * NOISE, np.linspace(0.5, 0.62, 601)
    weighted = np.column_stack([A, y]) / SIGMA[:, None]
    R = np.linalg.qr(weighted, mode="r")
    slopes = np.column_stack([0 * x, 1 + 0 * x, 2 * x, 3 * x**2, 1 + 0 * x])
    other = minimize(
        lambda theta: np.sum((R[:, :5] @ theta - R[:, 5]) ** 2),
        np.eye(5)[1],
        jac=lambda theta: 2 * R[:, :5].T @ (R[:, :5] @ theta - R[:, 5]),
        method="SLSQP",
        constraints={"type": "ineq", "fun": slopes.__matmul__, "jac": lambda _: slopes},
        options={"ftol": 1e-14},
    )
    kept = found.model.body.model
    own = [kept.theta[kept.terms.index(term.removesuffix("^1"))] for term in TERMS]
    assert own == pytest.approx(other.x, rel=5e-4)
    assert (slopes @ np.linalg.lstsq(R[:, :5], R[:, 5])[0]).min() < -0.05
    assert np.diff(settled(found.model, {"u": np.linspace(0, 1, 5000)})).min() > -1e-11
    (word,), shape = found.model.shape.kept, found.model.shape
    assert (word.violated > 0.005, *word.binds["u"]) == pytest.approx((True, 0.6, 0.6), abs=0.1)
    assert shape.training > shape.training_without > 0.045
    assert [row["coefficient"] for row in found.summary().records] == [*kept.theta]


def test_the_output_at_rest_is_where_a_long_run_ends():
    terms = ["u", "u[k-3]", "rate(u)", "stop(u, 0.1)", "creep(u, 0.5, 0.1)", "y[k-1]"]
    terms += ["resonance(u, 2, 0.5)", "coulomb(u, 0.2)", "saturate(u)^2", "slow(y[k-1], 0.1)*u"]
    model = fitted([*terms, *TERMS], slack=0.99).model
    held, ones = np.array([0.1, 0.4, 0.8]), np.ones(4000)
    given = {"time": STEP * np.arange(4000), "y": ones}
    ends = [simulate(model, {**given, "u": u * ones}).values[-1] for u in held]
    assert settled(model, {"u": held}) == pytest.approx(ends, rel=1e-9)


@pytest.mark.parametrize(("more", "ridge"), [("y[k-1]", 0.0), ("play(u, 0.1)", 1e-6)])
def test_other_fits_are_judged(more, ridge):
    kept = fitted([*TERMS[:2], more], ridge=ridge).model.shape
    assert kept.training == kept.training_without
    with pytest.raises(
        FitError, match=r"gain violates it by 0\.0\d+ 1, most for u: incr.* at u = "
    ):
        fitted([*TERMS[:4], more], ridge=ridge)


def test_what_is_no_sign_is_refused():
    with pytest.raises(SpecError, match="only the sign of its static gain"):
        fitted(TERMS, known=["increasing", "concave"])
