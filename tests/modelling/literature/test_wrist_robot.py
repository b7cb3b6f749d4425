"""W's five models on its own points, rebuilt from its best fit (eq 12): which printed numbers hold,
and how they came about.
"""

import numpy as np
import pytest
from literature_cases import WRIST, wrist_points

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.modelling.literature import get

COLUMNS, FORCE = wrist_points()
MUSCLE = {"diameter": 0.01}
"""W section IV, with D = 10 mm and L0 = 230 mm put in."""


@pytest.mark.parametrize(
    ("start", "method"),
    [
        ("random", None),
        *((start, "levenberg_marquardt") for start in ("random", "published", "printed")),
    ],
)
def test_sarosi_is_recovered_from_the_table_itself(start, method):
    """The table has 13 strains of its own at each pressure; `printed` starts from the numbers as
    they stand, for a strain in per cent.
    """
    fit = get("sarosi").starting_from(start).fit(COLUMNS, FORCE, method)
    assert fit.status == "converged"
    if start != "random":  # one start agrees with nothing
        assert not any("starts agree" in note for note in fit.notes)
    per_bar = {
        name: value * (100 if name in ("a1", "a4", "a5") else 1)
        for name, value in fit.parameters.items()
    }
    assert per_bar == pytest.approx(WRIST, rel=1e-6)


def test_starting_values_that_lead_nowhere_are_refused():
    with pytest.raises(SpecError, match="no starting values called `guessed`") as caught:
        get("sarosi").starting_from("guessed")
    assert "random, published, printed" in caught.value.remedy
    with pytest.raises(SpecError, match="variable_projection does not use starting values"):
        get("sarosi").starting_from("published").fit(COLUMNS, FORCE)


@pytest.mark.parametrize("name", ["tondu_lopez_fixed_area", "tondu_lopez_corrected_fixed_area"])
def test_a_formula_of_a_nominal_diameter_asks_for_it(name):
    with pytest.raises(SpecError, match=f"{name} needs the diameter of the muscle"):
        get(name).fit(COLUMNS, FORCE)
    with pytest.raises(SpecError, match="needs the diameter"):
        get(name).of_muscle({"length": 0.23, "diameter": None})
    fit = get(name).of_muscle(MUSCLE).fit(COLUMNS, FORCE)
    assert fit.parameters["diameter"] == MUSCLE["diameter"]
    assert np.isnan(fit.errors["diameter"])
    assert fit.rank == len(fit.parameters) - 1
    assert np.isfinite(fit.errors["theta"])


def test_a_force_that_no_braid_of_this_area_has_is_a_failed_fit():
    fit = (
        get("tondu_lopez_fixed_area")
        .of_muscle(MUSCLE)
        .fit(COLUMNS, -FORCE - 10 * COLUMNS["pressure"])
    )
    assert fit.failed
    assert "no finite value" in fit.notes[-1]
