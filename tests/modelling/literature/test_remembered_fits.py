"""A formula is fitted to the same training data once."""

from dataclasses import replace

import numpy as np
from common import curve_of
from literature_cases import uniform

from mapmore_cli.modelling.literature.backbone import fit_formula


def curve():
    columns = uniform(3, 60, pressure=(0, 300), strain=(0, 0.2))
    return curve_of({**columns, "force": 2 * columns["pressure"] * (1 - 4 * columns["strain"])})


def test_the_same_data_are_fitted_once_and_others_anew():
    whole = curve()
    first = fit_formula("polynomial_2", [whole], "force")
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
