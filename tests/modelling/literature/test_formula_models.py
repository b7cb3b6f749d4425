"""A fitted formula as a model: its forces, ranges, equations in other units, and program."""

from dataclasses import replace

import numpy as np
import pytest
from literature_cases import PLANTED, WRIST, wrist_force

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.recording import CurveRange, Quantity
from mapmore_cli.modelling import kinds, literature
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.literature.model import (
    backbone_values,
    formula_equations,
    formula_model,
    printed,
)
from mapmore_cli.modelling.programs import slopes

UNITS = {"pressure": "bar", "strain": "1", "force": "N"}
QUANTITIES = {name: Quantity(name, unit) for name, unit in UNITS.items()}
COLUMNS = {"pressure": np.array([1.0, 4.0, np.nan, 7.0]), "strain": np.array([0, 0.05, 0.1, 0.2])}


def fit_of(name, parameters):
    unknown = dict.fromkeys(parameters, np.nan)
    return FormulaFit(name, parameters, unknown, "converged", "by hand", 6, 1.0, 0.0, 9)


def wrist_model():
    """Of two levels, which are given in the wrong order."""
    ends = {"strain": (0.0, 0.1), "pressure": (6.9, 7.1), "force": (0.0, 600.0)}
    high = CurveRange("high", 7.0, ends)
    low = CurveRange("low", 1.0, ends | {"strain": (0.02, 0.06)})
    fit = fit_of("sarosi", WRIST)
    return formula_model("wrist", QUANTITIES["force"], fit, "pressure", (high, low), QUANTITIES)


def test_a_formula_predicts_where_its_inputs_are_known_and_has_the_ranges_of_its_levels():
    model, known = wrist_model(), np.array([0, 1, 3])
    rows = {name: column[known] for name, column in COLUMNS.items()}
    found = kinds.predict(model, COLUMNS)
    np.testing.assert_allclose(found[known], wrist_force(rows))
    assert np.isnan(found).tolist() == [False, False, True, False]
    loss = fit_of("sarosi_hysteresis_loss", WRIST)
    quantities = {name: Quantity(name, "1") for name in literature.of(loss).inputs}
    made = formula_model("loss", QUANTITIES["force"], loss, None, (), quantities)
    assert made.input_names == ("load", "pressure", "strain", "strain_rate")
    assert [one.level for one in model.body.ranges] == [1.0, 7.0]
    assert [set(one.limits) for one in model.body.ranges] == [{"pressure", "strain"}] * 2
    at = {"pressure": np.array([4.0, 4.0]), "strain": np.array([0.079, 0.081])}
    assert kinds.outside_range(model, at).tolist() == [False, True]
    assert kinds.parameters(model) == 6
    h = 1e-6
    up, down = (kinds.predict(model, {**rows, "strain": rows["strain"] + d}) for d in (h, -h))
    np.testing.assert_allclose(slopes(model, rows)["strain"], (up - down) / (2 * h), rtol=1e-5)


def test_equations_may_be_in_other_units():
    rows = {"pressure": np.array([100.0, 500.0]), "strain": np.array([2.0, 10.0])}  # kPa, per cent
    (found,) = kinds.equations(wrist_model(), {"pressure": 0.01, "strain": 0.01})
    in_own = {name: 0.01 * column for name, column in rows.items()}
    np.testing.assert_allclose(evaluate(parse(found.text), rows), wrist_force(in_own), rtol=1e-4)
    six_digits = printed("f", parse("0.12345678*x + 9876543.21"))
    assert parse(six_digits.text) == parse("0.123457*x + 9876540")


def test_without_a_formula_there_is_nothing():
    assert backbone_values(None, {}, 3).tolist() == [0, 0, 0]
    assert formula_equations(None, {}) == ()


@pytest.mark.parametrize(
    ("fit", "words"),
    [
        (replace(fit_of("sarosi", WRIST), status="failed"), "the fit of sarosi failed"),
        (fit_of("sarosi_hysteresis_loss", PLANTED["none"]), "searches for the free strain"),
    ],
)
def test_what_cannot_be_a_program(fit, words):
    model = wrist_model()
    with pytest.raises(DataError, match=words):
        slopes(replace(model, body=replace(model.body, fit=fit)), COLUMNS)
