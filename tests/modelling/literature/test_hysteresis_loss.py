"""Sárosi's hysteresis loss: from load cycles to a damping force, against numerical derivatives,
integrals and roots.
"""

import re

import numpy as np
import pytest
from literature_cases import grid, motion, sarosi
from scipy.integrate import quad
from scipy.optimize import brentq

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import evaluate, to_text
from mapmore_cli.modelling.literature import Formula, get
from mapmore_cli.modelling.literature.formulas.sarosi_hysteresis_loss import ForceCurve, zeta

LOSS, PRINTED = get("sarosi_hysteresis_loss"), get("sarosi_hysteresis_loss_printed")
UPPER = {"a1": 0.39, "a2": 217.0, "a3": -37.0, "a4": -8.3, "a5": 2.5, "a6": -240.0}
LOWER = {"a1": 0.45, "a2": 208.0, "a3": -37.4, "a4": -8.2, "a5": 2.4, "a6": -239.0}
LENGTH, STRAIN_MIN = 0.088, 0.002
PLANTED = {
    **{name.replace("a", "au"): value for name, value in UPPER.items()},
    **{name.replace("a", "al"): value for name, value in LOWER.items()},
    "length": LENGTH,
    "strain_min": STRAIN_MIN,
}


def force(branch, pressure, strain):
    return sarosi(branch.values(), pressure, strain)


def cycles():
    """Load cycles without noise at three pressures, of parameters that are planted."""
    columns = grid(np.array([80.0, 150.0, 350.0]), np.linspace(STRAIN_MIN, 0.2, 60))
    upper, lower = (
        force(branch, columns["pressure"], columns["strain"]) for branch in (UPPER, LOWER)
    )
    return {**columns, "force": (upper + lower) / 2, "hysteresis": (upper - lower) / 2}


def noted_pressures(notes, what):
    """The range of pressures in the one note that says `what`."""
    (note,) = [note for note in notes if what in note]
    numbers = re.search(r"between (\S+) and (\S+) kPa", note)
    return float(numbers[1]), float(numbers[2])


@pytest.mark.parametrize("formula", [LOSS, PRINTED], ids=lambda formula: formula.name)
def test_both_branches_are_recovered_from_mean_and_half_width(formula):
    fit = formula.fit_cycles(cycles(), LENGTH)
    assert (fit.name, fit.status, fit.rank, fit.samples) == (formula.name, "converged", 12, 360)
    assert tuple(fit.parameters) == formula.parameters
    assert dict(fit.parameters) == pytest.approx(PLANTED, rel=1e-8)
    assert [name for name, error in fit.errors.items() if np.isnan(error)] == [
        "length",
        "strain_min",
    ]


def test_a_fit_adds_the_squares_of_both_branches():
    columns = cycles()
    columns["force"] += np.random.default_rng(0).normal(size=180)
    fit = LOSS.fit_cycles(columns, LENGTH)
    each = [
        get("sarosi").fit(columns, columns["force"] + sign * columns["hysteresis"])
        for sign in (1, -1)
    ]
    assert fit.sse == pytest.approx(sum(one.sse for one in each))
    assert fit.condition == pytest.approx(max(one.condition for one in each))


@pytest.mark.parametrize(
    ("B", "C", "start", "end"),
    [
        (200.0, 5.0, 0.0, np.log(15) / 30),  # it pulls everywhere, least where its slope is zero
        (200.0, -30.0, 0.0, None),  # it has a zero before it turns
        (-10.0, 50.0, 0.0, 1.0),
        (-10.0, -99.0, 0.1, 0.1),  # it does not pull at the start
        (4000.0, -100.0, 0.0, 0.0),  # it is zero at the start and rises
    ],
)
def test_a_stroke_ends_at_the_first_zero_or_where_the_force_is_least(B, C, start, end):
    """Of the force `100 exp(-30 x) + B x + C`."""
    curve = ForceCurve(np.array([100.0]), np.array([B]), np.array([C]), -30.0)
    if end is None:
        end = brentq(lambda x: 100 * np.exp(-30 * x) + B * x + C, 0, np.log(15) / 30)
    assert curve.end_of_stroke(start) == pytest.approx([end])


def test_a_straight_line_that_pulls_everywhere_has_the_longest_stroke():
    line = ForceCurve(np.array([100.0]), np.array([10.0]), np.array([50.0]), 0.0)
    assert line.end_of_stroke(0.0) == pytest.approx([1.0])
    rising = ForceCurve(np.array([100.0]), np.zeros(1), np.array([-100.0]), 30.0)
    assert rising.end_of_stroke(0.0).tolist() == [0]  # it does not pull at the start


def test_without_an_upper_force_zeta_is_one():
    nothing = {f"au{i}": 0.0 for i in range(1, 7)}
    known = PLANTED | nothing | {f"al{i}": 5.0 * (i == 6) for i in range(1, 7)}
    assert zeta(known, np.array([100.0])).tolist() == [1.0]


def test_equal_branches_lose_no_energy_and_are_not_limited():
    columns = cycles()
    columns["hysteresis"] = np.zeros(180)
    fit = LOSS.fit_cycles(columns, LENGTH)
    assert zeta(fit.parameters, np.array([80.0, 350.0])).tolist() == [0.0, 0.0]
    assert noted_pressures(fit.notes, "zeta is limited to")[1] < 80  # of the slack muscle alone


@pytest.mark.parametrize("upper", [True, False])
@pytest.mark.parametrize("status", ["at_bound", "rank_deficient"])
def test_a_fit_of_both_branches_has_the_worse_status(monkeypatch, status, upper):
    def fit(self, columns, _force):
        worse = (self.parameters == tuple(f"au{i}" for i in range(1, 7))) == upper
        numbers = {name: PLANTED[name] for name in self.parameters}
        state = status if worse else "converged"
        return FormulaFit(self.name, numbers, numbers, state, "-", 6, 1.0, 0.0, 180)

    monkeypatch.setattr(Formula, "fit", fit)
    assert LOSS.fit_cycles(cycles(), LENGTH).status == status


def test_the_damping_force_is_that_of_m2():
    """Eq 19-21: `2 zeta sqrt(|k_t| m)` times the strain rate, and times the length for a force."""
    columns = motion(3)
    p, x, mass = columns["pressure"], columns["strain"], columns["load"] / 9.81
    a1, a2, a3, a4, *_ = UPPER.values()
    stiffness = ((a1 * p + a2) * a3 * np.exp(a3 * x) + a4 * p) / LENGTH
    critical = 2 * np.sqrt(np.abs(stiffness) * mass)
    expected = -zeta(PLANTED, p) * critical * columns["strain_rate"]
    np.testing.assert_allclose(PRINTED.predict(PLANTED, columns), expected, rtol=1e-12)
    np.testing.assert_allclose(LOSS.predict(PLANTED, columns), LENGTH * expected, rtol=1e-12)


@pytest.mark.parametrize("pressure", [20.0, 80.0, 143.7, 350.0, 500.0])
def test_zeta_is_the_lost_share_of_the_energy_by_quadrature(pressure):
    free = brentq(lambda strain: force(UPPER, pressure, strain), STRAIN_MIN, 0.5, xtol=1e-15)
    up, low = (
        quad(lambda strain, b=branch: force(b, pressure, strain), STRAIN_MIN, free, epsabs=0)[0]
        for branch in (UPPER, LOWER)
    )
    assert 0.0 < (up - low) / up < 1.0
    assert zeta(PLANTED, np.array([pressure])) == pytest.approx([(up - low) / up], rel=1e-9)


def test_where_the_muscle_is_slack_zeta_is_one_as_just_above():
    threshold = brentq(lambda pressure: force(UPPER, pressure, STRAIN_MIN), 0.0, 80.0, xtol=1e-14)
    around = threshold + np.array([-5.0, -1e-3, -1e-9, 1e-9, 1e-3])
    np.testing.assert_array_equal(zeta(PLANTED, around), 1.0)
    above = zeta(PLANTED, np.linspace(threshold, 350.0, 2000))
    assert np.abs(np.diff(above)).max() < 0.03
    notes = LOSS.fit_cycles(cycles(), LENGTH).notes
    lowest, highest = noted_pressures(notes, "zeta is limited to")
    assert lowest == 0.0
    assert zeta(PLANTED, np.array([highest - 0.4, highest + 0.4])).tolist() == [
        1.0,
        pytest.approx(0.96, abs=0.04),
    ]


def test_a_curve_that_overflows_beyond_the_strains_tested_is_no_reason_to_raise():
    """Strokes of 2 % leave room for a decay within 0.04 % of strain, of either sign."""
    steep = PLANTED | {"au3": 2500.0, "al3": 2500.0}
    assert np.isfinite(zeta(steep, np.array([-1.0, 0.0, 50.0, 350.0]))).all()
    assert np.isfinite(zeta(PLANTED | {"au3": -2500.0}, np.array([-1.0, 0.0, 50.0, 350.0]))).all()


def test_crossed_branches_give_no_negative_damping():
    """Where the lower curve lies above the upper one, energy would come out of nothing."""
    swapped = PLANTED | {name.replace("a", "au"): value for name, value in LOWER.items()}
    swapped |= {name.replace("a", "al"): value for name, value in UPPER.items()}
    assert zeta(swapped, np.array([80.0, 250.0])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize("formula", [LOSS, PRINTED], ids=lambda formula: formula.name)
def test_the_equations_are_the_prediction_but_for_zeta(formula):
    fit, columns = formula.fit_cycles(cycles(), LENGTH), motion(3)
    equations = formula.equations(fit)
    assert list(equations) == [
        formula.name,
        f"{formula.name}: upper curve",
        f"{formula.name}: lower curve",
    ]
    known = {**columns, "zeta": zeta(fit.parameters, columns["pressure"])}
    np.testing.assert_allclose(
        evaluate(equations[formula.name], known),
        formula.predict(fit.parameters, columns),
        rtol=1e-12,
    )
    assert to_text(equations[f"{formula.name}: upper curve"], digits=3).startswith(
        "(0.39*pressure + 217)*exp(-37*strain) - 8.3*"
    )


def test_what_is_no_load_cycle_is_refused():
    with pytest.raises(DataError, match="fitted to load cycles, not to a target"):
        LOSS.fit(motion(0), np.zeros(400))
    for length in (0.0, -0.1, np.nan, np.inf):
        with pytest.raises(DataError, match="needs a positive length of the muscle"):
            LOSS.fit_cycles(cycles(), length)
    for name in cycles():
        columns = cycles()
        columns[name][3] = np.nan
        with pytest.raises(DataError, match=f"{name} is not finite in row 3"):
            LOSS.fit_cycles(columns, LENGTH)
        del columns[name]
        with pytest.raises(DataError, match=f"no column `{name}`"):
            LOSS.fit_cycles(columns, LENGTH)
    with pytest.raises(DataError, match="only 5 samples"):
        LOSS.fit_cycles({name: column[:5] for name, column in cycles().items()}, LENGTH)


def test_one_pressure_does_not_pass_for_a_good_fit():
    columns = {name: column[cycles()["pressure"] == 150.0] for name, column in cycles().items()}
    fit = LOSS.fit_cycles(columns, LENGTH)
    assert fit.status == "rank_deficient"
    assert {note.split(":")[0] for note in fit.notes if "rank" in note} == {
        "upper curve",
        "lower curve",
    }
    assert sum("the solution of least norm was taken" in note for note in fit.notes) == 2
    assert np.isfinite(LOSS.predict(fit.parameters, motion(5))).all()
