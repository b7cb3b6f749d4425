"""NIST StRD nonlinear regression: correct digits of parameters, standard errors and residual sum of squares."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from certified import FOLDER, LEVELS, PROBLEMS, Certified, digits

from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.literature import Formula, levenberg_marquardt

STARTS = (None, 1, 2)
ENOUGH = 6  # digits; those beyond depend on the last step of a search, and so on the machine
ROUNDING = "Lanczos1"  # its residuals are the rounding of its data: their sum, and the standard errors, have few digits in any program
SHORT_OF_STEPS = ("MGH17", "MGH09", "Bennett5")  # from their first start


@cache
def fitted(problem: Certified, start: int | None) -> FormulaFit:
    return problem.fitted(start)


def test_all_problems_of_all_levels_are_there() -> None:
    assert {problem.name for problem in PROBLEMS} == {path.stem for path in FOLDER.glob("*.dat")}
    assert [sum(problem.level == level for problem in PROBLEMS) for level in LEVELS] == [8, 11, 8]


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
@pytest.mark.parametrize("start", STARTS)
def test_certified_digits(problem: Certified, start: int | None) -> None:
    fit = fitted(problem, start)
    if start == 1 and problem.name in SHORT_OF_STEPS:
        assert fit.status == "stopped_by_limit"  # far from the minimum, and told
        return
    assert fit.status == "converged"
    parameters, errors, sse = problem.digits(fit)
    assert parameters >= ENOUGH - 1
    assert errors >= (ENOUGH - 1 if problem.name != ROUNDING else 1)
    assert sse >= (9 if problem.name != ROUNDING else 1)


@pytest.mark.parametrize("problem", [p for p in PROBLEMS if p.name in SHORT_OF_STEPS], ids=lambda problem: problem.name)
def test_only_steps_are_missing_where_a_start_ends_early(problem: Certified, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(levenberg_marquardt, "EVALUATIONS", 20_000)
    fit = problem.fitted(1)
    assert fit.status == "converged"
    assert min(problem.digits(fit)) >= ENOUGH


def digits_table() -> list[str]:
    """The rows of the table of docs/reliability.md."""
    rows = []
    for problem in PROBLEMS:
        cells = [" / ".join(map(str, problem.digits(fitted(problem, start)))) for start in STARTS]
        told = [cell if fitted(problem, start).status == "converged" else "stopped" for cell, start in zip(cells, STARTS, strict=True)]
        rows.append(f"| {problem.name} | {problem.level.lower()} | {' | '.join(told)} |")
    return rows


def test_the_page_states_no_more_digits_than_are_reached() -> None:
    """Of the last two digits, the rounding of a machine decides."""
    page = (Path(__file__).resolve().parents[3] / "docs" / "reliability.md").read_text()
    for row in digits_table():
        name, level, *reached = row.strip("| ").split(" | ")
        (printed,) = [line.strip("| ").split(" | ") for line in page.splitlines() if line.startswith(f"| {name} |")]
        assert printed[1] == level
        for found, told in zip(reached, printed[2:], strict=True):
            assert (found == "stopped") == (told == "stopped"), row
            if found != "stopped":
                pairs = zip(map(int, found.split(" / ")), map(int, told.split(" / ")), strict=True)
                assert all(now >= then - 2 for now, then in pairs), (row, printed)


def test_wampler_polynomials_have_their_certified_digits() -> None:
    """Wampler1 and Wampler2: exact polynomials of order five on 0..20 (coefficients one, and powers of a tenth)."""
    x = np.arange(21.0)
    for base, least in ((1.0, 9), (0.1, 9)):
        names = tuple(f"b{i}" for i in range(6))
        formula = Formula("wampler", "NIST StRD", ("x",), names, " + ".join(f"b{i}*x^{i}" for i in range(6)))
        fit = formula.fit({"x": x}, np.polynomial.polynomial.polyval(x, base ** np.arange(6)))
        assert min(digits(fit.parameters[f"b{i}"], base**i) for i in range(6)) > least


if __name__ == "__main__":
    print(*digits_table(), sep="\n")
