"""H's muscle-like model: table I is recovered, its numbers mean what the text says, and the simplex
does what it can.
"""

import numpy as np
import pytest
from literature_cases import MUSCLE_LIKE, TABLE_I, muscle_like, uniform

from mapmore_cli.modelling.literature import get


def motion(seed, rows=1500):
    """Scattered samples: kPa, m, m/s."""
    return uniform(seed, rows, pressure=(200, 650), length=(0, 0.03), velocity=(-0.3, 0.3))


def force(values, columns):
    return muscle_like(values, *columns.values())


@pytest.mark.parametrize("method", ["variable_projection", "levenberg_marquardt"])
@pytest.mark.parametrize("muscle", TABLE_I)
def test_the_seven_parameters_of_each_muscle_are_recovered(muscle, method):
    """Noise-free, to 1e-4 and better; nothing of the truth goes into the search, whose starts
    lie within the declared bounds of b0.
    """
    columns = motion(1)
    fit = get("muscle_like").fit(columns, force(TABLE_I[muscle], columns), method)
    assert fit.status == "converged"
    assert [fit.parameters[name] for name in MUSCLE_LIKE] == pytest.approx(
        TABLE_I[muscle], rel=1e-9
    )
    if method == "levenberg_marquardt":
        assert fit.notes == ("10 of 10 starts found the same sum of squares",)


# muscle, pressure, elongation, force; a muscle of no elongation does not pull at its pressure of
# rest
STATED = [
    *(
        ("16 cm", pressure, 0.02, force)
        for pressure, force in ((200.0, -17.0), (400.0, 67.0), (600.0, 150.0))
    ),
    *(
        (muscle, rest, 0.0, 0.0)
        for muscle, rest in (("22 cm", 592.0), ("16 cm", 500.0), ("12 cm", 482.0))
    ),
]


@pytest.mark.parametrize(("muscle", "pressure", "length", "expected"), STATED)
def test_the_forces_that_the_text_states(muscle, pressure, length, expected):
    row = {"pressure": np.array([pressure]), "length": np.array([length]), "velocity": np.zeros(1)}
    found = get("muscle_like").predict(dict(zip(MUSCLE_LIKE, TABLE_I[muscle], strict=True)), row)
    assert found[0] == pytest.approx(expected, abs=0.5 if length else 0.2)


def test_hill_is_what_h_prints_and_its_numbers_are_found():
    """H eq 1-3 with velocities positive in lengthening, written independently."""
    c, l_opt, w, v_max, kappa, n = np.log(0.05), 0.9, 0.56, -11.0, 4.0, 1.4
    columns = uniform(5, 300, pressure=(0.1, 1), length=(0.5, 1.5), velocity=(-4, 4))
    share = (columns["length"] - l_opt) / (l_opt * w)
    v = -columns["velocity"]
    shortens = (v_max - v) / (v_max + kappa * v)
    lengthens = n + (n - 1) * (v_max + v) / (7.56 * kappa * v - v_max)
    y = 800 * columns["pressure"] * np.exp(c * np.abs(share) ** 3)
    fit = get("hill").fit(columns, y * np.where(v < 0, shortens, lengthens))
    assert fit.parameters == pytest.approx(
        {"F_max": 800, "l_opt": l_opt, "w": w, "v_max": -v_max, "kappa": kappa, "N": n}, rel=1e-6
    )
