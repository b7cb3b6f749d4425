"""NIST StRD nonlinear regression: correct digits of parameters, standard errors and residual sum of
squares.
"""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from certified import FOLDER, LEVELS, PROBLEMS, digits

from mapmore_cli.modelling.literature import Formula, descent

STARTS = (None, 1, 2)
# Digits of parameters, standard errors, sum of squares; those beyond depend on the last step of a
# search, and so on the machine
PROMISED = (5, 5, 9)
OF_ROUNDING = (5, 1, 1)
# its residuals are the rounding of its data: their sum, and the standard errors, have few digits in
# any program
ROUNDING = "Lanczos1"
SHORT_OF_STEPS = ("MGH17", "MGH09", "Bennett5")  # from their first start


@cache
def fitted(problem, start):
    return problem.fitted(start)


def test_all_problems_of_all_levels_are_there():
    assert {problem.name for problem in PROBLEMS} == {path.stem for path in FOLDER.glob("*.dat")}
    assert [sum(problem.level == level for problem in PROBLEMS) for level in LEVELS] == [8, 11, 8]


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
@pytest.mark.parametrize("start", STARTS)
def test_certified_digits(problem, start):
    fit = fitted(problem, start)
    if start == 1 and problem.name in SHORT_OF_STEPS:
        assert fit.status == "stopped_by_limit"  # far from the minimum, and told
        return
    assert fit.status == "converged"
    promised = OF_ROUNDING if problem.name == ROUNDING else PROMISED
    assert all(found >= least for found, least in zip(problem.digits(fit), promised, strict=True))


@pytest.mark.parametrize(
    "problem", [p for p in PROBLEMS if p.name in SHORT_OF_STEPS], ids=lambda problem: problem.name
)
def test_only_steps_are_missing_where_a_start_ends_early(problem, monkeypatch):
    monkeypatch.setattr(descent, "EVALUATIONS", 20_000)
    fit = problem.fitted(1)
    assert fit.status == "converged"
    assert all(found >= least for found, least in zip(problem.digits(fit), PROMISED, strict=True))


def test_the_page_states_what_is_promised():
    page = (Path(__file__).resolve().parents[3] / "docs" / "reliability.md").read_text(
        encoding="utf-8"
    )
    rows = [
        line for line in page.splitlines() if re.match(r"\| (without a|from NIST's) start", line)
    ]
    assert len(rows) == len(STARTS)
    assert all(row.endswith(f"| {' | '.join(map(str, PROMISED))} |") for row in rows)


def test_wampler_polynomials_have_their_certified_digits():
    """Wampler1 and Wampler2: exact polynomials of order five on 0..20 (coefficients one, and powers
    of a tenth).
    """
    x = np.arange(21.0)
    for base in (1.0, 0.1):
        names = tuple(f"b{i}" for i in range(6))
        formula = Formula(
            "wampler", "NIST StRD", ("x",), names, " + ".join(f"b{i}*x^{i}" for i in range(6))
        )
        fit = formula.fit({"x": x}, np.polynomial.polynomial.polyval(x, base ** np.arange(6)))
        assert min(digits(fit.parameters[f"b{i}"], base**i) for i in range(6)) > 9
