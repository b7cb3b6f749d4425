"""A formula is fitted to the same training data once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from common import curve_of
from literature_cases import uniform

from mapmore_cli.modelling.literature import backbone
from mapmore_cli.modelling.literature.formula import Formula


def curve():
    columns = uniform(3, 60, pressure=(0, 300), strain=(0, 0.2))
    return curve_of({**columns, "force": 2 * columns["pressure"] * (1 - 4 * columns["strain"])})


def test_the_same_data_are_fitted_once(monkeypatch):
    monkeypatch.setattr(backbone, "_FITTED", {})
    fits: list[str] = []
    fit = Formula.fit

    def counted(self, *arguments, **named):
        fits.append(self.name)
        return fit(self, *arguments, **named)

    monkeypatch.setattr(Formula, "fit", counted)
    whole = curve()
    first = backbone.fit_formula("polynomial_2", [whole], "force")
    assert backbone.fit_formula("polynomial_2", [curve()], "force") is first
    assert len(fits) == 1
    backbone.fit_formula("polynomial_5", [whole], "force")
    backbone.fit_formula("polynomial_2", [replace(whole, held_out=np.arange(60) == 7)], "force")
    shifted = {**whole.columns, "force": np.nextafter(whole.columns["force"], np.inf)}
    backbone.fit_formula("polynomial_2", [replace(whole, columns=shifted)], "force")
    assert len(fits) == 4
