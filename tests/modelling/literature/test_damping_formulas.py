"""The damping formulas that are fitted to a damping force: viscous ones, by region or not, and
kinetic friction.
"""

import numpy as np
import pytest
from literature_cases import DAMPING, PLANTED, motion, noisy

from mapmore_cli.modelling.literature import get

DAMPED = [name for name in PLANTED if name in DAMPING]
WAYS = ("rise", "fall")


def written_out(name, planted, columns):
    """M2 table 1 and eq 16, 24, without the parser."""
    B = planted
    P, v = columns["pressure"], columns["strain_rate"]
    rise, low = columns["direction"] == 1.0, columns["pressure"] <= 200.0
    moved = columns["direction"] != 0.0
    match name:
        case "none":
            return np.zeros_like(v)
        case "linear_viscous":
            return B["B0"] * v
        case "pressure_viscous":
            return B["B1"] * P * v
        case "reynolds":
            return (
                np.where(rise, *(B[f"B0_{way}"] + B[f"B1_{way}"] * P for way in WAYS)) * v * moved
            )
        case "cao":
            up, down = (
                np.where(
                    low,
                    B[f"B0_{way}_low"] + B[f"B1_{way}_low"] * P,
                    B[f"B0_{way}_high"] + B[f"B1_{way}_high"] * P,
                )
                for way in WAYS
            )
            return np.where(rise, up, down) * v * moved
        case "tondu_kinetic_friction":
            return np.sign(v) * ((B["B0"] - B["B1"]) * np.exp(-np.abs(v) / B["B2"]) + B["B1"])
    x = v if name == "peternel" else np.abs(v)
    return np.sign(v) * (
        B["B0"] + B["B1"] * x + B["B2"] * x**2 + B["B3"] * np.exp(-np.abs(v) / B["B4"])
    )


def test_every_damping_formula_is_here_or_fitted_to_load_cycles():
    assert {*DAMPING} == {*DAMPED, "sarosi_hysteresis_loss", "sarosi_hysteresis_loss_printed"}
    for name in DAMPING:
        assert get(name).fitted_to == ("target" if name in PLANTED else "load_cycles")
        assert {*get(name).inputs} <= {*motion(0)}


@pytest.mark.parametrize("name", DAMPED)
def test_it_is_what_is_published(name):
    columns = motion(1)
    # which Cao's lower region includes
    columns["pressure"][:4], columns["direction"][:4] = (
        200.0,
        [1.0, 1.0, -1.0, -1.0],
    )
    columns["strain_rate"][4:6] = columns["direction"][6:8] = 0.0
    np.testing.assert_allclose(
        get(name).predict(PLANTED[name], columns),
        written_out(name, PLANTED[name], columns),
        rtol=1e-12,
        atol=1e-12,
    )


@pytest.mark.parametrize("name", ["tondu_kinetic_friction", "peternel_absolute"])
def test_a_friction_that_does_not_decay_is_at_bound(name):
    columns = motion(9)
    cubic = columns["strain_rate"] ** 3 if name == "peternel_absolute" else columns["strain_rate"]
    fit = get(name).fit(columns, -30.0 * cubic)
    last = get(name).parameters[-1]
    assert fit.status == "at_bound"
    assert fit.notes == (f"{last} went to the limit of its search, 10 max|strain_rate|",)
    assert fit.parameters[last] == pytest.approx(10 * np.abs(columns["strain_rate"]).max())


@pytest.mark.parametrize("name", DAMPED)
def test_a_muscle_that_stands_still_shows_no_parameter(name):
    columns, y = noisy(name, 18)
    fit = get(name).fit({**columns, "strain_rate": np.zeros(len(y))}, y)
    assert fit.rank == 0
    assert fit.sse == pytest.approx(y @ y)
    assert fit.status == ("converged" if name == "none" else "rank_deficient")
    assert np.isfinite(get(name).predict(fit.parameters, columns)).all()
