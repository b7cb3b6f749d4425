"""Sárosi's formula with a slack foot: what it is, what it finds, when it gives way to the plain
one, what it says of itself.
"""

from dataclasses import replace

import numpy as np
import pytest
from literature_cases import sarosi, slack_muscle, wrist_points

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import evaluate, to_text
from mapmore_cli.modelling.literature import Formula, get, hinge

HINGED, PLAIN = get("sarosi_hinged"), get("sarosi")
FOUR = np.array([0.0, 0.04, 0.08, 0.12])
SWEPT = np.linspace(0.0, 0.12, 400)


def normalised(columns, y, parameters):
    """Pressure, strain and force divided by their largest, and the coordinates of parameters."""
    p, x, f = (np.abs(one).max() for one in (columns["pressure"], columns["strain"], y))
    units = np.array([f / p, f, 1 / x, f / p / x, f / p, f, f, f / p, f / x, f])
    q = np.array([parameters[name] for name in hinge.NAMES]) / units
    q[9] = np.log(q[9])
    return (columns["pressure"] / p, columns["strain"] / x, y / f), q, units


def penalised(q, rows, widest):
    """Residuals of `lo + w ln(1 + exp((hi - lo)/w))` and of the priors, written out; all rows have
    together the weight of at most 300 samples.
    """
    p, x, f = rows
    *_, b0, b1, b2, log_w = q
    high, low, w = sarosi(q[:6], p, x), b0 + b1 * p + b2 * x, np.exp(log_w)
    root = np.sqrt(min(len(p), 300) / len(p))
    left = root * (low + w * np.log(1 + np.exp((high - low) / w)) - f)
    centre = np.array([0, 0, max(-33 * widest, -12), 0, 0, 0, 0, 0, 0, np.log(0.03)])
    weight = [0.01, 0.003, 0.002 / widest, *[0.003] * 3, 0.001, 0.03, 0.03, 0.001]
    return np.append(left, weight * (q - centre))


@pytest.mark.parametrize("strains", [FOUR, SWEPT], ids=["levels", "swept"])
def test_a_slack_muscle_is_described_where_the_plain_formula_fails(strains):
    columns, y = slack_muscle(0, strains)
    hinged, plain = HINGED.fit(columns, y), PLAIN.fit(columns, y)
    assert hinged.sse < 0.06 * plain.sse
    held_out, truth = slack_muscle(1, np.array([0.02, 0.06, 0.1]))
    scatter = [
        np.sqrt(np.mean((f.predict(fit.parameters, held_out) - truth) ** 2))
        for f, fit in ((HINGED, hinged), (PLAIN, plain))
    ]
    assert scatter[0] < 0.3 * scatter[1]


def test_data_without_a_foot_keep_sarosi():
    """On the wrist robot's table the plain formula is exact; the blend halves what the hinge is
    off.
    """
    columns, y = wrist_points()
    fit = HINGED.fit(columns, y)
    assert fit.parameters["share"] <= 0.5
    assert fit.rank == hinge.fit_hinge(columns, y).rank + 6 + 1
    assert np.sqrt(fit.sse / fit.samples) < 0.005 * y.max()
    for plain, own in (("a1", "s1"), ("a3", "s3"), ("a6", "s6")):
        assert fit.parameters[own] == PLAIN.fit(columns, y).parameters[plain]


def test_parameters_and_equation_are_the_whole_prediction():
    """Which does not overflow where the printed equation does."""
    columns, y = slack_muscle(4, FOUR)
    fit = HINGED.fit(columns, y)
    assert fit.sse == pytest.approx(
        np.sum((HINGED.predict(fit.parameters, columns) - y) ** 2), rel=1e-12
    )
    assert to_text(HINGED.equation(fit), 3).count("log(1 + exp(") == 1
    far = {"pressure": np.array([1e7]), "strain": np.array([0.0])}
    assert np.isfinite(HINGED.predict(fit.parameters, far)).all()
    assert not np.isfinite(evaluate(HINGED.equation(fit), far)).all()


def test_sums_of_squares_and_errors_of_a_hinge_are_with_the_priors():
    """`s^2 (J'J)^-1` of the rows and the priors, s^2 of the rows alone; that of w follows from that
    of its logarithm.
    """
    columns, y = slack_muscle(0, FOUR)
    fit = hinge.fit_hinge(columns, y)
    rows, q, units = normalised(columns, y, fit.parameters)
    residual = penalised(q, rows, 0.12)
    assert fit.sse == pytest.approx(residual @ residual * units[9] ** 2, rel=1e-6)
    steps = 1e-5 * np.eye(10)
    J = np.transpose([penalised(q + d, rows, 0.12) - penalised(q - d, rows, 0.12) for d in steps])
    variance = residual[:-10] @ residual[:-10] / (300 - 10)
    expected = np.sqrt(variance * np.diag(np.linalg.inv(J.T @ J))) * 2e-5 * units
    expected[9] *= np.exp(q[9])
    assert [*fit.errors.values()] == pytest.approx(expected.tolist(), rel=1e-3)


def test_a_known_curvature_is_the_only_start(monkeypatch):
    seen = []

    def searched(system, starts, *more, **options):
        seen.append([start[hinge.A3] for start in starts])
        return descend(system, starts, *more, **options)

    descend = hinge.descend
    monkeypatch.setattr(hinge, "descend", searched)
    columns, y = slack_muscle(0, FOUR)
    fit = hinge.fit_hinge(columns, y)
    again = hinge.fit_hinge(columns, y, fit.parameters["a3"])
    assert seen[0] == [-8.0, -4.0, -2.0, -0.7, 1.5]
    assert seen[-1] == [pytest.approx(fit.parameters["a3"] * 0.12)]
    assert again.sse == pytest.approx(fit.sse, rel=1e-6)


@pytest.mark.parametrize("unit", [1.0, 0.0])
@pytest.mark.parametrize(
    ("hinged_off", "plain_off", "plain_status", "near"),
    [
        (0.02, 0.01, "converged", None),
        (0.0, 0.05, "converged", 0.3),
        (0.01, 0.01, "converged", 1.0),
        (0.01, 0.0, "at_bound", 0.3),
    ],
)
def test_parts_are_blended_by_their_squared_errors(
    monkeypatch, hinged_off, plain_off, plain_status, near, unit
):
    """Of a target that is one everywhere, or zero; each part is off by a constant. The errors
    are fractions of the largest target, or of one.
    """
    columns, y = {"pressure": np.ones(20), "strain": np.zeros(20)}, np.full(20, unit)
    given = None if near is None else {"share": near, "a3": -7.0}

    def part(names, rank, status, **numbers):
        numbers = dict.fromkeys(names, 0.0) | numbers
        return FormulaFit("part", numbers, numbers, status, "-", rank, 1.0, 0.0, 20, ("note",))

    def fit_hinge(*asked):
        assert asked[2] == (None if near is None else -7.0)
        constant = {"a6": unit + hinged_off, "b0": unit + hinged_off, "w": 1e-300}
        return part(hinge.NAMES, 10, "stopped_by_limit", **constant)

    def fit(self, _columns, _y, _method):
        assert self.near == (given if near == 0.3 else None)
        return part(self.parameters, 6, plain_status, s6=unit + plain_off)

    monkeypatch.setattr(hinge, "fit_hinge", fit_hinge)
    monkeypatch.setattr(Formula, "fit", fit)
    found = replace(HINGED, near=given).fit(columns, y)
    ratio = (hinged_off**2 + 1e-4) / (plain_off**2 + 1e-4)
    alone = plain_status != "converged"
    share = 1.0 if alone else 1 / (1 + ratio**2)
    assert found.parameters["share"] == pytest.approx(share, rel=1e-6)
    assert found.parameters["s6"] == (0.0 if alone else unit + plain_off)
    assert found.rank == 10 + (0 if alone else 6 + 1)
    assert found.status == ("stopped_by_limit" if ratio < 1 or alone else "converged")
    assert np.isnan(found.errors["s6"]) == alone
    assert any("hinged alone" in note for note in found.notes) == alone


def test_a_plain_fit_that_ran_away_has_no_share():
    """Three levels do not show its curvature: past them exp(+-400 strain) would swamp the blend,
    whatever the share.
    """
    columns, y = slack_muscle(0, FOUR[[0, 1, 3]])
    fit = HINGED.fit(columns, y)
    assert PLAIN.fit(columns, y).status != "converged"
    assert fit.parameters["share"] == 1.0
    assert any("hinged alone" in note for note in fit.notes)
    beyond = HINGED.predict(
        fit.parameters, {"pressure": np.full(9, 300.0), "strain": np.linspace(-0.05, 0.3, 9)}
    )
    assert np.abs(beyond).max() < 10 * np.abs(y).max()


@pytest.mark.parametrize(
    ("strains", "warned"),
    [(FOUR, False), (FOUR[[0, 1, 3]], True), (FOUR[[0, 3]], True), (SWEPT, False)],
)
@pytest.mark.parametrize("jitter", [0.0, 5e-4])
def test_three_levels_or_fewer_leave_the_curvature_to_the_prior(strains, warned, jitter):
    """Measured strains scatter a little about their levels."""
    columns, y = slack_muscle(2, strains)
    columns["strain"] = columns["strain"] + jitter * np.random.default_rng(0).uniform(-1, 1, len(y))
    fit = HINGED.fit(columns, y)
    assert any("a3 keeps its prior value" in note for note in fit.notes) == warned
    assert "a3 is " in fit.notes[0]
    assert "w is " in fit.notes[0]
    assert "blend" in fit.notes[1]


@pytest.mark.parametrize(
    "strains", [FOUR, FOUR[[0, 1, 3]], SWEPT], ids=["four levels", "three levels", "swept"]
)
def test_the_fit_minimises_the_penalised_squares_as_specified(strains):
    """The objective and its priors written out, in normalised parameters: no small step of any of
    them lowers it.
    """
    columns, y = slack_muscle(11, strains, rows=280)
    rows, q, _ = normalised(columns, y, HINGED.fit(columns, y).parameters)
    widest = columns["strain"].max()

    def objective(q):
        return np.sum(penalised(q, rows, widest) ** 2)

    least = objective(q)
    for step in (1e-2, 1e-4):
        for direction in np.vstack(
            [np.eye(10), np.random.default_rng(0).standard_normal((20, 10))]
        ):
            for moved in (q + step * direction, q - step * direction):
                assert moved[7] < 0 or objective(moved) >= least * (1 - 1e-9)


def test_a_hinge_that_bends_the_whole_curve_has_the_largest_width_by_name():
    """The width is a fraction of the largest target."""
    columns, _ = slack_muscle(9, FOUR)
    fit = HINGED.fit(columns, y := columns["pressure"] ** 2 * (1 - columns["strain"]))
    assert fit.parameters["w"] == pytest.approx(0.3 * y.max())
    assert "w ends at its bound" in fit.notes


def test_a_foot_that_does_not_rise_is_at_its_bound_by_name():
    columns, y = slack_muscle(9, FOUR)
    fit = HINGED.fit(columns, y - 0.05 * columns["pressure"])
    assert fit.status == "at_bound"
    assert fit.parameters["b1"] == 0.0
    assert "b1 ends at its bound" in fit.notes
    assert not any("do not determine" in note for note in fit.notes)
