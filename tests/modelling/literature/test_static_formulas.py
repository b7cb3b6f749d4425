"""The static formulas: what they say and what is recovered; nothing better is nearby, ends at a
bound are named, many samples are quick.
"""

import numpy as np
import pytest
from literature_cases import WRIST, grid, noisy, scattered, wrist_force
from scipy.optimize import brentq

from mapmore_cli.modelling.expressions import to_latex, to_text
from mapmore_cli.modelling.literature import Formula, get, names, problem

WRIST_GRID = grid(np.arange(1.0, 8.0), np.linspace(0.0, 0.2, 13))


def test_the_text_of_every_formula_agrees_with_its_declaration():
    for formula in map(get, names()):
        if type(formula) is Formula:
            formula.checked()


def test_an_unknown_formula_is_a_key_error_with_all_names():
    with pytest.raises(KeyError, match=r"no formula `saroshi`; there are: .*polynomial_2"):
        get("saroshi")


def test_published_wrist_muscle():
    sarosi = get("sarosi")

    def force(pressure, strain):
        return float(
            sarosi.predict(WRIST, {"pressure": np.array([pressure]), "strain": np.array([strain])})[
                0
            ]
        )

    assert force(7.0, 0.0) == pytest.approx(525.5, abs=0.1)
    assert brentq(lambda strain: force(7.0, strain), 0.1, 0.25) == pytest.approx(0.194, abs=5e-4)
    np.testing.assert_allclose(
        sarosi.predict(WRIST, WRIST_GRID), wrist_force(WRIST_GRID), rtol=1e-13, atol=1e-10
    )


def braid(x, theta=0.5):
    """W eq 4 with eq 6-7, of a muscle of 10 mm at 4 bar, in N."""
    return (
        4e5 * np.pi / 4 * 0.01**2 * (3 / np.tan(theta) ** 2 * (1 - x) ** 2 - 1 / np.sin(theta) ** 2)
    )


def bolen(largest, c0, c1, c2):
    """At 400 kPa, a rest length of 0.15 m, and two fifths of the largest strain."""
    return largest * (c0 * (np.exp(-c1 * 0.4) - 1) + 400 / 620 * np.exp(-c2 * 0.4**2))


AREA, FACTOR = 250 * np.pi * 0.01**2, 3.55 * np.exp(-4) + 2.1079  # in 1e-3 m^2; W eq 10
TURNS, THREAD, LENGTH = 8.9, 0.27, 0.23 * (1 - 0.08)
CONSTANTS = {"theta": 0.5, "a_k": 3.55, "b_k": -2.1079}
PER_TURN = 1e3 / (4 * np.pi * TURNS**2)


@pytest.mark.parametrize(
    ("name", "parameters", "force"),
    [
        (
            "chou_hannaford",
            {"c1": 3 * 0.23**2 * PER_TURN, "c2": THREAD**2 * PER_TURN},
            4e5 * THREAD**2 * (3 * LENGTH**2 / THREAD**2 - 1) / (4 * np.pi * TURNS**2),
        ),
        ("tondu_lopez", {"area": AREA, "theta": 0.5}, braid(0.08)),
        ("tondu_lopez_fixed_area", {"diameter": 0.01, "theta": 0.5}, braid(0.08)),
        ("tondu_lopez_corrected", CONSTANTS | {"area": AREA}, braid(0.08 * FACTOR)),
        ("tondu_lopez_corrected_fixed_area", CONSTANTS | {"diameter": 0.01}, braid(0.08 * FACTOR)),
        (
            "kerscher",
            CONSTANTS | {"a_e": 17.679 * AREA, "b_e": -15.448 * AREA},
            (17.679 * np.exp(-40 * 0.08) + 15.448) * braid(0.08 * FACTOR),
        ),
        (
            "bolen",
            {"F620": 300.0, "c0": 0.5, "k1": 4 / 0.2, "k2": 0.6 / 0.2**2},
            bolen(300.0, 0.5, 4.0, 0.6),
        ),
        (
            "bolen_10mm",
            {"length": 0.15, "e620": 0.2},
            bolen(303.5 * np.arctan(19.03 * (0.15 - 0.0075)), 0.5682, 4.254, 0.5597),
        ),
        (
            "bolen_20mm",
            {"length": 0.15, "e620": 0.2},
            bolen(922.4 * np.arctan(15.37 * (0.15 - 0.013)), 0.2579, 6.477, 1.321),
        ),
    ],
)
def test_forces_are_those_that_are_published(name, parameters, force):
    """At 400 kPa and a strain of 0.08."""
    found = get(name).predict(
        parameters, {"pressure": np.array([400.0]), "strain": np.array([0.08])}
    )
    assert found == pytest.approx([force], rel=1e-12)


@pytest.mark.parametrize(
    ("name", "parameter", "limits"),
    [
        ("bolen", "k1", (0.01, 50)),
        ("kerscher", "theta", (np.radians(5), np.radians(85))),
        ("hill", "v_max", (1, 100)),
        ("hill", "kappa", (0.1, 20)),
        ("hill", "N", (1, 3)),
    ],
)
def test_limits_of_a_search(name, parameter, limits):
    """In multiples of the largest input, or of its reciprocal, for numbers that often end there."""
    (bounds,) = (one.bounds for one in get(name).nonlinear if one.name == parameter)
    assert bounds == pytest.approx(limits)


@pytest.mark.parametrize(
    ("pressures", "rank"), [(1, 6), (2, 11), (3, 15), (4, 18), (5, 20), (6, 21), (7, 21)]
)
def test_rank_of_polynomial_5_by_number_of_pressures(pressures, rank):
    columns = grid(np.linspace(80, 350, pressures), np.linspace(0, 0.25, 40))
    fit = get("polynomial_5").fit(
        columns, wrist_force({**columns, "pressure": columns["pressure"] / 100})
    )
    assert fit.rank == rank
    assert (fit.status == "rank_deficient") == (rank < 21)
    assert np.isnan(list(fit.errors.values())).any() == (rank < 21)
    if rank < 21:
        assert f"rank {rank} of 21" in fit.notes[0]
        assert f"{pressures} of pressure" in fit.notes[0]


def test_the_equation_reads_as_published():
    fit = get("sarosi").fit(WRIST_GRID, wrist_force(WRIST_GRID))
    assert to_text(get("sarosi").equation(fit), digits=6) == (
        "(-5.699*pressure + 158.773)*exp(-42.647*strain) - 299.482*strain*pressure + "
        "86.216*pressure - 196.865"
    )
    assert to_latex(get("sarosi").expression).startswith(
        r"\left(a_{1} \, \mathrm{pressure} + a_{2}\right) \, \exp\left("
    )


SEVERAL = ["tondu_lopez_corrected", "kerscher"]


def test_a_parameter_that_ends_at_its_bound_is_put_there_and_named():
    """A factor on the strain that does not depend on the pressure has a_k at its least."""
    columns = scattered(0, 150)
    y = get("tondu_lopez").predict(
        {"area": 0.6, "theta": 0.6}, {**columns, "strain": 1.4 * columns["strain"]}
    )
    fit = get("tondu_lopez_corrected").fit(
        columns, y + np.where(columns["pressure"] < 200, 20.0, 0.0) * columns["strain"]
    )
    assert fit.status == "at_bound"
    assert fit.parameters["a_k"] * np.abs(columns["strain"]).max() == 0.01
    assert any(
        "a_k went to the limit of its search, 0.01/max|strain|" in note for note in fit.notes
    )


@pytest.mark.parametrize("name", SEVERAL)
def test_starts_over_cells_end_at_the_minimum_of_all_samples(name, monkeypatch):
    columns, y = noisy(name, 5, rows=3 * problem.LIMIT)
    quick = get(name).fit(columns, y)
    monkeypatch.setattr(problem, "LIMIT", len(y))
    assert quick.sse == pytest.approx(get(name).fit(columns, y).sse, rel=1e-12)
