"""What holds for every formula that is fitted to a target: recovery, units, order, refusals, and
that its equation is its prediction.
"""

from pathlib import Path

import numpy as np
import pytest
from common import files_without_parts
from hypothesis import given, settings
from hypothesis import strategies as st
from literature_cases import DAMPING, PLANTED, STATIC, grid, motion, noisy, noisy_wrist

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import evaluate
from mapmore_cli.modelling.literature import COMPONENTS, Formula, formulas, get, names, reference


def test_every_file_of_the_folder_declares_a_formula_of_a_known_component():
    assert files_without_parts("formulas", Formula, formulas) == set()
    assert {get(name).component for name in names()} <= {*COMPONENTS}
    assert all(get(name).reference for name in names())
    assert [*names()] == sorted(names())


EVERY = [*STATIC, *(name for name in DAMPING if name in PLANTED)]
every = pytest.mark.parametrize("name", EVERY)


def training(name, seed, rows=60):
    """Noisy samples: of the formula itself, or of W's muscle in kPa."""
    if name in DAMPING:
        return noisy(name, seed, rows)
    columns, y = noisy_wrist(seed, rows=rows)
    return {**columns, "pressure": 100.0 * columns["pressure"]}, y


@pytest.mark.parametrize(
    ("name", "method"),
    [
        *((name, None) for name in PLANTED),
        *((name, "levenberg_marquardt") for name in PLANTED if name in DAMPING),
    ],
)
def test_planted_parameters_are_recovered_without_starting_values(name, method):
    columns = (
        motion(2) if name in DAMPING else grid(np.linspace(60, 600, 8), np.linspace(0, 0.25, 15))
    )
    fit = get(name).fit(columns, get(name).predict(PLANTED[name], columns), method)
    assert fit.status == "converged"
    assert fit.rank == len(PLANTED[name])
    assert tuple(fit.parameters) == get(name).parameters
    assert dict(fit.parameters) == pytest.approx(
        PLANTED[name], rel=1e-8 if name in DAMPING else 1e-6
    )


@pytest.mark.parametrize(
    ("name", "method"),
    [
        *((name, None) for name in EVERY),
        *((name, "levenberg_marquardt") for name in ("sarosi", "polynomial_5")),
    ],
)
def test_row_order_does_not_change_a_digit(name, method):
    columns, y = training(name, 5, 80)
    order = np.random.default_rng(0).permutation(len(y))
    shuffled = {quantity: column[order] for quantity, column in columns.items()}
    # as text, where NaN equals NaN
    assert str(get(name).fit(shuffled, y[order], method)) == str(get(name).fit(columns, y, method))


@every
def test_the_equation_is_the_prediction(name):
    columns, y = training(name, 1, 300)
    fit = get(name).fit(columns, y)
    (equation,) = get(name).equations(fit).values()
    assert equation.names <= {*get(name).inputs}
    predicted = get(name).predict(fit.parameters, columns)
    np.testing.assert_allclose(
        evaluate(equation, columns, len(y)), predicted, rtol=1e-9, atol=1e-9 * np.abs(y).max()
    )


@settings(max_examples=60)
@given(
    st.sampled_from(
        [
            *(
                (name, method)
                for name in ("sarosi", "polynomial_2", "polynomial_5")
                for method in (None, "levenberg_marquardt")
            ),
            *((name, None) for name in EVERY if name in DAMPING or name == "chou_hannaford"),
        ]
    ),
    *[st.floats(1e-4, 1e4)] * 3,
)
def test_units_change_the_numbers_but_not_the_fit(case, pressure, motion, force):
    """Quantities for which a formula contains numbers, as Cao's 200 kPa, keep their unit."""
    name, method = case
    columns, y = training(name, 3, 120)
    factors = {"pressure": pressure, "strain": motion, "strain_rate": motion}
    factors |= dict.fromkeys(get(name).constants_for, 1.0)
    changed = {
        quantity: column * factors.get(quantity, 1.0) for quantity, column in columns.items()
    }
    fit, other = get(name).fit(columns, y, method), get(name).fit(changed, y * force, method)
    assert other.status == fit.status == "converged"
    assert other.sse == pytest.approx(fit.sse * force**2, rel=1e-9)
    assert other.condition == pytest.approx(fit.condition, rel=1e-3)
    predicted = get(name).predict(fit.parameters, columns)
    np.testing.assert_allclose(
        get(name).predict(other.parameters, changed) / force,
        predicted,
        rtol=0,
        atol=1e-6 * np.abs(y).max(),
    )


@every
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_values_that_are_not_finite_are_refused_with_column_and_row(name, value):
    for column in (*get(name).inputs, "the target"):
        columns, y = training(name, 14)
        {**columns, "the target": y}[column][7] = value
        with pytest.raises(DataError, match=f"{column} is not finite in row 7"):
            get(name).fit(columns, y)


@pytest.mark.parametrize("name", [*EVERY, "sarosi_hysteresis_loss"])
def test_an_unknown_input_is_unknown_in_the_prediction_and_an_absent_one_refused(name):
    for column in get(name).inputs:
        columns = motion(15, 60)
        columns[column][7] = np.nan
        parameters = dict.fromkeys(get(name).parameters, 0.5)
        predicted = get(name).predict(parameters, columns)
        assert np.flatnonzero(np.isnan(predicted)).tolist() == [7]
        del columns[column]
        with pytest.raises(DataError, match=f"no column `{column}`"):
            get(name).predict(parameters, columns)
        if name != "sarosi_hysteresis_loss":
            with pytest.raises(DataError, match=f"no column `{column}`"):
                get(name).fit(columns, predicted)


def test_every_formula_is_on_the_page_and_in_the_reference():
    page, text = (
        (Path(__file__).resolve().parents[3] / "docs" / "formulas.md").read_text(encoding="utf-8"),
        reference(),
    )
    for name in names():
        assert f"`{name}`" in page
        assert f"### {name}\n" in text
        assert f"- The source of the formula is {get(name).reference}.\n" in text
        inputs = ", ".join(get(name).inputs)
        said = f"The inputs of the formula are: {inputs}." if inputs else "has no inputs."
        assert said in text.partition(f"### {name}\n")[2].partition("\n### ")[0]
