"""A formula is fitted to the same training data once, and to a part of them without a search."""

from dataclasses import replace

import numpy as np
import pytest
from common import curve_of
from literature_cases import slack_muscle, uniform

from mapmore_cli.modelling.literature import hinge, solvers
from mapmore_cli.modelling.literature.backbone import fit_formula, residual_of


def curve():
    columns = uniform(3, 60, pressure=(0, 300), strain=(0, 0.2))
    return curve_of({**columns, "force": 2 * columns["pressure"] * (1 - 4 * columns["strain"])})


def test_the_same_data_are_fitted_once_and_others_anew():
    whole = curve()
    first = fit_formula("polynomial_2", [whole], "force")
    pressure, strain = whole.columns["pressure"], whole.columns["strain"]
    shown = {**whole.columns, "force": 5 + 2 * pressure * (1 - 4 * strain)}
    left = residual_of(replace(whole, columns=shown), "force", first)
    np.testing.assert_allclose(left.columns["force"], 5, rtol=1e-8)
    assert fit_formula("polynomial_2", [curve()], "force") is first
    shifted = {**whole.columns, "force": np.nextafter(whole.columns["force"], np.inf)}
    for name, other in (
        ("polynomial_5", whole),
        ("polynomial_2", replace(whole, held_out=np.arange(60) == 7)),
        ("polynomial_2", replace(whole, columns=shifted)),
    ):
        assert fit_formula(name, [other], "force") is not first
    thin, wide = (
        fit_formula("tondu_lopez_fixed_area", [whole], "force", lengths={"diameter": diameter})
        for diameter in (0.01, 0.02)
    )
    assert thin is not wide


@pytest.mark.parametrize("name", ["sarosi", "sarosi_hinged", "kerscher"])
def test_a_part_of_the_data_is_fitted_from_the_fit_of_all_of_them(name, monkeypatch):
    """The same minimum is reached, without the starts from which it is searched."""
    columns, y = slack_muscle(0, np.array([0.0, 0.03, 0.06, 0.09, 0.12]))
    whole = curve_of({**columns, "force": y})
    near = fit_formula(name, [whole], "force").parameters
    part = replace(whole, held_out=columns["strain"] == 0.06)
    searched = fit_formula(name, [part], "force")
    for module, search in ((solvers, "drawn_starts"), (solvers, "_valleys")):
        monkeypatch.setattr(module, search, None)
    monkeypatch.setattr(hinge, "STARTS", ())
    found = fit_formula(name, [part], "force", near=near)
    assert found.sse == pytest.approx(searched.sse, rel=1e-6)
    assert found.parameters == pytest.approx(searched.parameters, rel=1e-3)
