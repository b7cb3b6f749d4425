"""The nonlinear problems of NIST's Statistical Reference Datasets (StRD), read from the files that NIST publishes (`nist/`)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import permutations
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.literature import Formula, Nonlinear
from mapmore_cli.modelling.literature.formula import LinearForm

FOLDER = Path(__file__).parent / "nist"
LEVELS = ("Lower", "Average", "Higher")
PUBLISHED = 11  # digits that NIST prints
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[Ee][-+]?\d+)?")

WIDE = ((1e-3, 50.0),)
SIGNED = ((-1000.0, -1e-3), (1e-3, 1000.0))
RATE = ((0.1, 50.0),)


@dataclass(frozen=True, eq=False)
class Certified:
    """A problem: the formula, where its nonlinear parameters are sought, and the numbers in NIST's file.

    `powers` says up to which power of x there are columns (`x2`, `x3`), so that coefficients of powers are sought in their own scale.
    `alike` holds groups of parameters that may change places, as the terms of a sum of exponentials.
    """

    name: str
    text: str
    nonlinear: tuple[Nonlinear, ...]
    form: LinearForm | None = None
    starts: Mapping[str, str] = field(default_factory=dict)
    powers: int = 1
    alike: tuple[tuple[str, ...], ...] = ()
    given: Mapping[str, float] = field(default_factory=dict)
    logarithm: bool = False

    @cached_property
    def lines(self) -> list[str]:
        return (FOLDER / f"{self.name}.dat").read_text(encoding="ascii").splitlines()

    @cached_property
    def level(self) -> str:
        return next(level for line in self.lines for level in LEVELS if line.strip() == f"{level} Level of Difficulty")

    @cached_property
    def table(self) -> dict[str, list[float]]:
        """Start 1, start 2, certified value and certified standard deviation of every parameter."""
        rows = [line.split("=") for line in self.lines if re.match(r"\s*b\d\s*=", line)]
        return {name.strip(): [float(number) for number in NUMBER.findall(numbers)] for name, numbers in rows}

    @cached_property
    def sse(self) -> float:
        (line,) = [line for line in self.lines if line.startswith("Residual Sum of Squares:")]
        return float(line.split(":")[1])

    @cached_property
    def data(self) -> tuple[dict[str, Array], Array]:
        """The predictors by name, and the response."""
        start = max(place for place, line in enumerate(self.lines) if line.startswith("Data:"))
        values = np.array([[float(number) for number in line.split()] for line in self.lines[start + 1 :] if line.strip()])
        (count,) = [int(line.split(":")[1]) for line in self.lines if line.startswith("Number of Observations:")]
        assert len(values) == count
        names = ("x",) if values.shape[1] == 2 else ("x1", "x2")
        columns = {name: values[:, place + 1] for place, name in enumerate(names)}
        columns |= {f"x{power}": columns["x"] ** power for power in range(2, self.powers + 1)}
        return columns, np.log(values[:, 0]) if self.logarithm else values[:, 0]

    def formula(self, start: int | None = None) -> Formula:
        """The formula, to be fitted from one of the two published starts or from none."""
        published = {}
        for number in (0, 1):
            values = {name: np.asarray(row[number]) for name, row in self.table.items()}
            moved = {name: float(evaluate(parse(text), values, 1)[0]) for name, text in self.starts.items()}
            published[f"start {number + 1}"] = {name: float(value) for name, value in values.items()} | moved
        return Formula(
            self.name,
            "NIST StRD",
            tuple(self.data[0]),
            (*self.table, *self.given),
            self.text,
            self.nonlinear,
            self.form,
            published,
            "random" if start is None else f"start {start}",
            dimensions=tuple(self.given),
            given=self.given,
        )

    def fitted(self, start: int | None = None) -> FormulaFit:
        """From a published start by Levenberg-Marquardt, or without one by variable projection."""
        columns, y = self.data
        return self.formula(start).fit(columns, y, "levenberg_marquardt" if start else None)

    def digits(self, fit: FormulaFit) -> tuple[int, int, int]:
        """Whole correct digits of the worst parameter, of the worst standard error, and of the sum of squares."""
        if fit.status == "failed":
            return 0, 0, 0
        return max(self._worst(fit, dict(zip(sum(self.alike, ()), sum(order, ()), strict=True))) for order in permutations(self.alike))

    def _worst(self, fit: FormulaFit, places: Mapping[str, str]) -> tuple[int, int, int]:
        worst = [
            min(digits(found[places.get(name, name)], row[column]) for name, row in self.table.items())
            for found, column in ((fit.parameters, 2), (fit.errors, 3))
        ]
        return math.floor(worst[0]), math.floor(worst[1]), math.floor(digits(fit.sse, self.sse))


def digits(found: float, certified: float) -> float:
    """Number of correct digits (LRE), as NIST counts them."""
    if not math.isfinite(found):
        return 0.0
    return float(PUBLISHED) if found == certified else max(0.0, min(PUBLISHED, -math.log10(abs(found - certified) / abs(certified))))


def _exponentials(name: str) -> Certified:
    rates = tuple(Nonlinear(rate, "x", RATE) for rate in ("b2", "b4", "b6"))
    return Certified(name, "b1*exp(-b2*x) + b3*exp(-b4*x) + b5*exp(-b6*x)", rates, alike=(("b1", "b2"), ("b3", "b4"), ("b5", "b6")))


def _peaks(name: str) -> Certified:
    text = "b1*exp(-b2*x) + b3*exp(-(x - b4)^2*exp(-2*log(b5))) + b6*exp(-(x - b7)^2*exp(-2*log(b8)))"
    places = [Nonlinear(place, None, ((0.05, 1.0),), "x") for place in ("b4", "b7")]
    widths = [Nonlinear(width, None, ((0.01, 0.5),), "x") for width in ("b5", "b8")]
    return Certified(name, text, (Nonlinear("b2", "x", RATE), *places, *widths), alike=(("b3", "b4", "b5"), ("b6", "b7", "b8")))


def _chwirut(name: str) -> Certified:
    form = LinearForm("a*exp(-b1*x)/(1 + r*x)", ("a",), {"b1": "b1", "b2": "1/a", "b3": "r/a"})
    nonlinear = (Nonlinear("b1", "x", WIDE), Nonlinear("r", "x", WIDE))
    return Certified(name, "exp(-b1*x)/(b2 + b3*x)", nonlinear, form, {"a": "1/b2", "r": "b3/b2"})


def _cubics(name: str) -> Certified:
    nonlinear = (Nonlinear("b5", "x", SIGNED), Nonlinear("b6", "x2", SIGNED), Nonlinear("b7", "x3", SIGNED))
    return Certified(name, "(b1 + b2*x + b3*x2 + b4*x3)/(1 + b5*x + b6*x2 + b7*x3)", nonlinear, powers=3)


def _one(name: str, text: str, per: str | None = "x") -> Certified:
    return Certified(name, text, (Nonlinear("b2", per, WIDE),))


OF_X = ((1e-3, 10.0),)
PROBLEMS = (
    _one("Misra1a", "b1*(1 - exp(-b2*x))"),
    _chwirut("Chwirut2"),
    _chwirut("Chwirut1"),
    _exponentials("Lanczos3"),
    _peaks("Gauss1"),
    _peaks("Gauss2"),
    _one("DanWood", "b1*exp(b2*log(x))", None),
    _one("Misra1b", "b1*(1 - (1 + b2*x/2)^-2)"),
    Certified(
        "Kirby2",
        "(b1 + b2*x + b3*x2)/(1 + b4*x + b5*x2)",
        (Nonlinear("b4", "x", SIGNED), Nonlinear("b5", "x2", SIGNED)),
        powers=2,
    ),
    _cubics("Hahn1"),
    Certified("Nelson", "b1 - b2*x1*exp(-b3*x2)", (Nonlinear("b3", "x2", SIGNED),), logarithm=True),
    Certified(
        "MGH17",
        "b1 + b2*exp(-x*b4) + b3*exp(-x*b5)",
        (Nonlinear("b4", "x", RATE), Nonlinear("b5", "x", RATE)),
        alike=(("b2", "b4"), ("b3", "b5")),
    ),
    _exponentials("Lanczos1"),
    _exponentials("Lanczos2"),
    _peaks("Gauss3"),
    _one("Misra1c", "b1*(1 - (1 + 2*b2*x)^-0.5)"),
    _one("Misra1d", "b1*b2*x/(1 + b2*x)"),
    Certified(
        "Roszman1",
        "b1 - b2*x - w*atan(b3/(x - b4))",
        (Nonlinear("b3", None, OF_X, "x"), Nonlinear("b4", None, ((-10.0, -1e-3), (1e-3, 10.0)), "x")),
        given={"w": 1 / math.pi},
    ),
    Certified(
        "ENSO",
        "b1 + b2*cos(w*x/12) + b3*sin(w*x/12) + b5*cos(w*x/b4) + b6*sin(w*x/b4) + b8*cos(w*x/b7) + b9*sin(w*x/b7)",
        (Nonlinear("b4", None, ((0.1, 0.5),), "x"), Nonlinear("b7", None, ((0.1, 0.5),), "x")),
        alike=(("b4", "b5", "b6"), ("b7", "b8", "b9")),
        given={"w": 2 * math.pi},
    ),
    Certified(
        "MGH09",
        "b1*(x^2 + x*b2)/(x^2 + x*b3 + b4)",
        (Nonlinear("b2", None, OF_X, "x"), Nonlinear("b3", None, OF_X, "x"), Nonlinear("b4", None, ((1e-3, 100.0),))),
    ),
    _cubics("Thurber"),
    _one("BoxBOD", "b1*(1 - exp(-b2*x))"),
    Certified("Rat42", "b1/(1 + exp(b2 - b3*x))", (Nonlinear("b2", None, ((0.1, 10.0),)), Nonlinear("b3", "x", RATE))),
    Certified(
        "MGH10",
        "b1*exp(b2/(x + b3))",
        (Nonlinear("b2", None, ((0.1, 1000.0),), "x"), Nonlinear("b3", None, ((0.1, 100.0),), "x")),
    ),
    Certified(
        "Eckerle4",
        "(b1/b2)*exp(-0.5*((x - b3)/b2)^2)",
        (Nonlinear("b2", None, ((1e-3, 1.0),), "x"), Nonlinear("b3", None, ((0.5, 1.5),), "x")),
    ),
    Certified(
        "Rat43",
        "b1*exp(-log(1 + exp(b2 - b3*x))/b4)",
        (Nonlinear("b2", None, ((0.1, 20.0),)), Nonlinear("b3", "x", RATE), Nonlinear("b4", None, ((0.1, 10.0),))),
    ),
    Certified(
        "Bennett5",
        "b1*exp(-log(b2 + x)/b3)",
        (Nonlinear("b2", None, ((0.1, 100.0),), "x"), Nonlinear("b3", None, ((0.1, 10.0),))),
    ),
)
