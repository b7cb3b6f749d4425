"""NIST StRD nonlinear regression: correct digits of parameters, standard errors and residual sum of squares."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mapmore_cli.modelling.literature import Formula, Nonlinear

MISRA_X = [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0]
MISRA_Y = [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78]
WIDE = ((1e-3, 50.0),)


@dataclass(frozen=True)
class Certified:
    """A problem with the published digits: (value, standard error) of every parameter."""

    name: str
    text: str
    nonlinear: tuple[Nonlinear, ...]
    x: list[float]
    y: list[float]
    parameters: dict[str, tuple[float, float]]
    sse: float

    @property
    def formula(self) -> Formula:
        return Formula(self.name, "NIST StRD", ("x",), tuple(self.parameters), self.text, self.nonlinear)


PROBLEMS = [
    Certified(
        "Misra1a",
        "b1*(1 - exp(-b2*x))",
        (Nonlinear("b2", "x", WIDE),),
        MISRA_X,
        MISRA_Y,
        {"b1": (2.3894212918e02, 2.7070075241e00), "b2": (5.5015643181e-04, 7.2668688436e-06)},
        1.2455138894e-01,
    ),
    Certified(
        "Misra1b",
        "b1*(1 - (1 + b2*x/2)^-2)",
        (Nonlinear("b2", "x", WIDE),),
        MISRA_X,
        MISRA_Y,
        {"b1": (3.3799746163e02, 3.1643950207e00), "b2": (3.9039091287e-04, 4.2547321834e-06)},
        7.5464681533e-02,
    ),
    Certified(
        "Misra1c",
        "b1*(1 - (1 + 2*b2*x)^-0.5)",
        (Nonlinear("b2", "x", WIDE),),
        MISRA_X,
        MISRA_Y,
        {"b1": (6.3642725809e02, 4.6638326572e00), "b2": (2.0813627256e-04, 1.7728423155e-06)},
        4.0966836971e-02,
    ),
    Certified(
        "Misra1d",
        "b1*b2*x/(1 + b2*x)",
        (Nonlinear("b2", "x", WIDE),),
        MISRA_X,
        MISRA_Y,
        {"b1": (4.3736970754e02, 3.6489174345e00), "b2": (3.0227324449e-04, 2.9334354479e-06)},
        5.6419295283e-02,
    ),
    Certified(
        "BoxBOD",
        "b1*(1 - exp(-b2*x))",
        (Nonlinear("b2", "x", WIDE),),
        [1, 2, 3, 5, 7, 10],
        [109, 149, 149, 191, 213, 224],
        {"b1": (2.1380940889e02, 1.2354515176e01), "b2": (5.4723748542e-01, 1.0455993237e-01)},
        1.1680088766e03,
    ),
    Certified(
        "DanWood",
        "b1*exp(b2*log(x))",
        (Nonlinear("b2", None, WIDE),),
        [1.309, 1.471, 1.490, 1.565, 1.611, 1.680],
        [2.138, 3.421, 3.597, 4.340, 4.882, 5.660],
        {"b1": (7.6886226176e-01, 1.8281973860e-02), "b2": (3.8604055871e00, 5.1726610913e-02)},
        4.3173084083e-03,
    ),
]
RAT42 = Certified(
    "Rat42",
    "b1/(1 + exp(b2 - b3*x))",
    (Nonlinear("b2", None, ((0.1, 10.0),)), Nonlinear("b3", "x", ((0.1, 50.0),))),
    [9.0, 14.0, 21.0, 28.0, 42.0, 57.0, 63.0, 70.0, 79.0],
    [8.93, 10.80, 18.59, 22.33, 39.35, 56.11, 61.73, 64.62, 67.08],
    {"b1": (7.2462237576e01, 1.7340283401e00), "b2": (2.6180768402e00, 8.8295217536e-02), "b3": (6.7359200066e-02, 3.4465663377e-03)},
    8.0565229338e00,
)
CASES = [(problem, method) for problem in (*PROBLEMS, RAT42) for method in ("variable_projection", "levenberg_marquardt")]


def digits(found: float, certified: float) -> float:
    """Number of correct digits (LRE), as NIST counts them; 11 are published."""
    return 11.0 if found == certified else min(11.0, -math.log10(abs(found - certified) / abs(certified)))


@pytest.mark.parametrize(("problem", "method"), CASES, ids=[f"{problem.name}-{method}" for problem, method in CASES])
def test_certified_digits_without_starting_values(problem: Certified, method: str) -> None:
    fit = problem.formula.fit({"x": np.array(problem.x)}, np.array(problem.y, dtype=float), method)
    assert fit.status == "converged"
    for name, (value, error) in problem.parameters.items():
        assert digits(fit.parameters[name], value) > 8
        assert digits(fit.errors[name], error) > 6.5
    assert digits(fit.sse, problem.sse) > 9


LEVELS = {
    "Misra1a": "lower",
    "Misra1b": "lower",
    "DanWood": "lower",
    "Misra1c": "average",
    "Misra1d": "average",
    "BoxBOD": "higher",
    "Rat42": "higher",
}


def digits_reached(problem: Certified, method: str) -> tuple[int, int, int]:
    """Whole correct digits of the worst parameter, of the worst standard error, and of the sum of squares."""
    fit = problem.formula.fit({"x": np.array(problem.x)}, np.array(problem.y, dtype=float), method)
    parameters = min(digits(fit.parameters[name], value) for name, (value, _) in problem.parameters.items())
    errors = min(digits(fit.errors[name], error) for name, (_, error) in problem.parameters.items())
    return math.floor(parameters), math.floor(errors), math.floor(digits(fit.sse, problem.sse))


def digits_table() -> list[str]:
    """The rows of the table of docs/reliability.md."""
    rows = []
    for problem in sorted((*PROBLEMS, RAT42), key=lambda problem: ("lower", "average", "higher").index(LEVELS[problem.name])):
        cells = [f"{value}" for method in ("variable_projection", "levenberg_marquardt") for value in digits_reached(problem, method)]
        rows.append(f"| {problem.name} | {LEVELS[problem.name]} | {' | '.join(cells)} |")
    return rows


def test_the_page_states_no_more_digits_than_are_reached() -> None:
    """Of the last digits, a machine's own rounding decides; so what is printed may be less."""
    page = (Path(__file__).resolve().parents[3] / "docs" / "reliability.md").read_text()
    for row in digits_table():
        name, _, *reached = row.strip("| ").split(" | ")
        (printed,) = [line.strip("| ").split(" | ")[2:] for line in page.splitlines() if line.startswith(f"| {name} |")]
        assert all(int(found) >= int(told) - 1 for found, told in zip(reached, printed, strict=True)), (row, printed)


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
