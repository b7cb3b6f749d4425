"""W's five models on its own points, rebuilt from its best fit (eq 12): which printed numbers hold,
and how they came about.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from literature_cases import WRIST, wrist_points
from scipy.optimize import minimize_scalar

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.modelling.literature import get
from mapmore_cli.modelling.validation.metrics import uncentred_correlation

COLUMNS, FORCE = wrist_points()
AREA = np.pi / 4 * 10.0**2 * 1e-3  # of a diameter of 10 mm, in 1e-3 m^2, which is N/kPa
MUSCLE = {"diameter": 0.01}
REST_LENGTH, THREAD, TURNS = 0.23, 0.0099, 8.9212
PRINTED = {
    "chou_hannaford": {
        "c1": 3e3 * REST_LENGTH**2 / (4 * np.pi * TURNS**2),
        "c2": 1e3 * THREAD**2 / (4 * np.pi * TURNS**2),
    },
    "tondu_lopez_fixed_area": {**MUSCLE, "theta": np.radians(28.975)},
    "tondu_lopez_corrected_fixed_area": {
        **MUSCLE,
        "theta": np.radians(24.9921),
        "a_k": 3.55,
        "b_k": -2.1079,
    },
    "kerscher": {
        "theta": np.radians(51.069),
        "a_k": 3.55,
        "b_k": -0.372,
        "a_e": AREA * 17.679,
        "b_e": AREA * -15.448,
    },
}
"""W section IV, with D = 10 mm and L0 = 230 mm put in."""


def test_a_quarter_of_the_points_has_a_slightly_negative_strain() -> None:
    assert len(FORCE) == 91
    assert np.count_nonzero(COLUMNS["strain"] < 0) == 23
    assert COLUMNS["strain"].min() == pytest.approx(-0.0224, abs=1e-4)


def test_eq_3_is_eq_4_with_one_parameter_more() -> None:
    """So its converged fit cannot be worse, as printed (0.8185 against 0.8667); the printed thread
    of 9.9 mm is shorter than the muscle.
    """
    three, four = get("chou_hannaford").fit(COLUMNS, FORCE), get("tondu_lopez").fit(COLUMNS, FORCE)
    assert four.status == three.status == "converged"
    assert four.sse == pytest.approx(
        three.sse, rel=1e-10
    )  # with the area fitted, they are the same
    as_printed = get("tondu_lopez_fixed_area").of_muscle(MUSCLE).fit(COLUMNS, FORCE)
    with_diameter = minimize_scalar(
        lambda angle: float(
            np.sum(
                (get("tondu_lopez").predict({"area": AREA, "theta": angle}, COLUMNS) - FORCE) ** 2
            )
        ),
        bounds=(0.1, 1.5),
    )
    assert as_printed.parameters["theta"] == pytest.approx(with_diameter.x, rel=1e-5)
    assert as_printed.sse == pytest.approx(with_diameter.fun, rel=1e-10)
    assert np.degrees(as_printed.parameters["theta"]) == pytest.approx(
        28.57, abs=0.01
    )  # 28.975 is printed
    assert three.sse < 0.6 * as_printed.sse
    assert uncentred_correlation(
        FORCE, get("chou_hannaford").predict(three.parameters, COLUMNS)
    ) == pytest.approx(0.9236, abs=5e-4)
    thread = REST_LENGTH * np.sqrt(3 * three.parameters["c2"] / three.parameters["c1"])
    assert thread == pytest.approx(0.330, abs=0.001)
    assert THREAD < REST_LENGTH < thread


def test_with_the_pressure_in_bar_eq_8_has_a_better_fit() -> None:
    """With W's diameter it reaches 0.995 where 0.927 is printed, with a_k = 88 where 3.55 is; with
    the area fitted, the angle runs away.
    """
    as_printed = get("tondu_lopez_corrected_fixed_area").of_muscle(MUSCLE).fit(COLUMNS, FORCE)
    assert as_printed.status == "converged"
    assert uncentred_correlation(
        FORCE, get(as_printed.name).predict(as_printed.parameters, COLUMNS)
    ) == pytest.approx(0.9947, abs=5e-4)
    assert [as_printed.parameters["a_k"], as_printed.parameters["b_k"]] == pytest.approx(
        [87.65, -1.798], rel=1e-3
    )
    fit = get("tondu_lopez_corrected").fit(COLUMNS, FORCE)
    assert fit.sse < as_printed.sse
    assert uncentred_correlation(
        FORCE, get(fit.name).predict(fit.parameters, COLUMNS)
    ) == pytest.approx(0.9949, abs=5e-4)
    assert fit.status == "at_bound"
    assert np.degrees(fit.parameters["theta"]) == pytest.approx(5.0)
    assert any("theta runs to the limit" in note for note in fit.notes)


@pytest.mark.parametrize("name", ["tondu_lopez_corrected", "kerscher"])
def test_the_notes_say_how_many_of_ten_starts_agree(name: str) -> None:
    agreeing = re.fullmatch(
        r"(\d+) of 10 starts agree on the sum of squares", get(name).fit(COLUMNS, FORCE).notes[0]
    )
    assert agreeing is not None
    assert 3 <= int(agreeing[1]) <= 10


@pytest.mark.parametrize(
    ("start", "method"),
    [
        ("random", None),
        *((start, "levenberg_marquardt") for start in ("random", "published", "printed")),
    ],
)
def test_sarosi_is_recovered_from_the_table_itself(start: str, method: str | None) -> None:
    """The table has 13 strains of its own at each pressure; `printed` starts from the numbers as
    they stand, for a strain in per cent.
    """
    fit = get("sarosi").starting_from(start).fit(COLUMNS, FORCE, method)
    assert fit.status == "converged"
    per_bar = {
        name: value * (100 if name in ("a1", "a4", "a5") else 1)
        for name, value in fit.parameters.items()
    }
    assert per_bar == pytest.approx(WRIST, rel=1e-6)


def test_starting_values_that_lead_nowhere_are_refused() -> None:
    with pytest.raises(SpecError, match="no starting values called `guessed`") as caught:
        get("sarosi").starting_from("guessed")
    assert "random, published, printed" in caught.value.remedy
    with pytest.raises(SpecError, match="variable_projection takes no starting values"):
        get("sarosi").starting_from("published").fit(COLUMNS, FORCE)


@pytest.mark.parametrize("name", ["tondu_lopez_fixed_area", "tondu_lopez_corrected_fixed_area"])
def test_a_formula_of_a_nominal_diameter_asks_for_it(name: str) -> None:
    with pytest.raises(SpecError, match=f"{name} needs the diameter of the muscle"):
        get(name).fit(COLUMNS, FORCE)
    with pytest.raises(SpecError, match="needs the diameter"):
        get(name).of_muscle({"length": 0.23, "diameter": None})
    fit = get(name).of_muscle(MUSCLE).fit(COLUMNS, FORCE)
    assert fit.parameters["diameter"] == MUSCLE["diameter"]
    assert np.isnan(fit.errors["diameter"])
    assert fit.rank == len(fit.parameters) - 1
    assert np.isfinite(fit.errors["theta"])


def test_a_force_that_no_braid_of_this_area_has_is_a_failed_fit() -> None:
    fit = (
        get("tondu_lopez_fixed_area")
        .of_muscle(MUSCLE)
        .fit(COLUMNS, -FORCE - 10 * COLUMNS["pressure"])
    )
    assert fit.failed
    assert "no finite value" in fit.notes[-1]
