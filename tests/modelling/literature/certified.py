"""The nonlinear problems of NIST's Statistical Reference Datasets (StRD), read from the files that
NIST publishes (`nist/`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import permutations
from pathlib import Path

import numpy as np

from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.modelling.literature import Formula, Nonlinear
from mapmore_cli.modelling.literature.formula import LinearForm

FOLDER = Path(__file__).parent / "nist"
LEVELS = ("Lower", "Average", "Higher")
PUBLISHED = 11  # digits that NIST prints
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[Ee][-+]?\d+)?")


@dataclass(frozen=True, eq=False)
class Certified:
    """A problem: the formula, where its nonlinear parameters are sought, and the numbers in NIST's
    file.

    `powers` says up to which power of x there are columns (`x2`, `x3`), so that coefficients of
    powers are sought in their own scale. `alike` holds groups of parameters that may change places,
    as the terms of a sum of exponentials.
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
    def lines(self):
        return (FOLDER / f"{self.name}.dat").read_text(encoding="ascii").splitlines()

    @cached_property
    def level(self):
        return next(
            level
            for line in self.lines
            for level in LEVELS
            if line.strip() == f"{level} Level of Difficulty"
        )

    @cached_property
    def table(self):
        """Start 1, start 2, certified value and certified standard deviation of every parameter."""
        rows = [line.split("=") for line in self.lines if re.match(r"\s*b\d\s*=", line)]
        return {
            name.strip(): [float(number) for number in NUMBER.findall(numbers)]
            for name, numbers in rows
        }

    @cached_property
    def sse(self):
        (line,) = [line for line in self.lines if line.startswith("Residual Sum of Squares:")]
        return float(line.split(":")[1])

    @cached_property
    def data(self):
        """The predictors by name, and the response."""
        start = max(place for place, line in enumerate(self.lines) if line.startswith("Data:"))
        values = np.array(
            [
                [float(number) for number in line.split()]
                for line in self.lines[start + 1 :]
                if line.strip()
            ]
        )
        (count,) = [
            int(line.split(":")[1])
            for line in self.lines
            if line.startswith("Number of Observations:")
        ]
        assert len(values) == count
        names = ("x",) if values.shape[1] == 2 else ("x1", "x2")
        columns = {name: values[:, place + 1] for place, name in enumerate(names)}
        columns |= {f"x{power}": columns["x"] ** power for power in range(2, self.powers + 1)}
        return columns, np.log(values[:, 0]) if self.logarithm else values[:, 0]

    def formula(self, start=None):
        """The formula, to be fitted from one of the two published starts or from none."""
        published = {}
        for number in (0, 1):
            values = {name: np.asarray(row[number]) for name, row in self.table.items()}
            moved = {
                name: float(evaluate(parse(text), values, 1)[0])
                for name, text in self.starts.items()
            }
            published[f"start {number + 1}"] = {
                name: float(value) for name, value in values.items()
            } | moved
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

    def fitted(self, start=None):
        """From a published start by Levenberg-Marquardt, or without one by variable projection."""
        columns, y = self.data
        return self.formula(start).fit(columns, y, "levenberg_marquardt" if start else None)

    def digits(self, fit):
        """Whole correct digits of the worst parameter, of the worst standard error, and of the sum
        of squares.
        """
        if fit.status == "failed":
            return 0, 0, 0
        return max(
            self._worst(fit, dict(zip(sum(self.alike, ()), sum(order, ()), strict=True)))
            for order in permutations(self.alike)
        )

    def _worst(self, fit, places):
        worst = [
            min(
                digits(found[places.get(name, name)], row[column])
                for name, row in self.table.items()
            )
            for found, column in ((fit.parameters, 2), (fit.errors, 3))
        ]
        return math.floor(worst[0]), math.floor(worst[1]), math.floor(digits(fit.sse, self.sse))


def digits(found, certified):
    """Number of correct digits (LRE), as NIST counts them."""
    if not math.isfinite(found):
        return 0.0
    return (
        float(PUBLISHED)
        if found == certified
        else max(0.0, min(PUBLISHED, -math.log10(abs(found - certified) / abs(certified))))
    )


EXPONENTIALS = "b1*exp(-b2*x) + b3*exp(-b4*x) + b5*exp(-b6*x)"
PEAKS = "b1*exp(-b2*x) + b3*exp(-(x - b4)^2*exp(-2*log(b5))) + b6*exp(-(x - b7)^2*exp(-2*log(b8)))"
CUBICS = "(b1 + b2*x + b3*x2 + b4*x3)/(1 + b5*x + b6*x2 + b7*x3)"
TIDES = (
    "b1 + b2*cos(w*x/12) + b3*sin(w*x/12) + b5*cos(w*x/b4) + b6*sin(w*x/b4) + b8*cos(w*x/b7) "
    "+ b9*sin(w*x/b7)"
)

RATES = "b2 per x 0.1 50, b4 per x 0.1 50, b6 per x 0.1 50"
PLACES = "b2 per x 0.1 50, b4 of x 0.05 1, b7 of x 0.05 1, b5 of x 0.01 0.5, b8 of x 0.01 0.5"
SIGNED = (
    "b5 per x -1000 -1e-3 1e-3 1000, b6 per x2 -1000 -1e-3 1e-3 1000, b7 per x3 -1000 -1e-3 "
    "1e-3 1000"
)
WIDE = "b2 per x 1e-3 50"

CHWIRUT = {
    "form": LinearForm("a*exp(-b1*x)/(1 + r*x)", ("a",), {"b1": "b1", "b2": "1/a", "b3": "r/a"}),
    "starts": {"a": "1/b2", "r": "b3/b2"},
}
ALIKE = {
    "Lanczos": (("b1", "b2"), ("b3", "b4"), ("b5", "b6")),
    "Gauss": (("b3", "b4", "b5"), ("b6", "b7", "b8")),
    "MGH17": (("b2", "b4"), ("b3", "b5")),
    "ENSO": (("b4", "b5", "b6"), ("b7", "b8", "b9")),
}
OWN = {
    "Chwirut": CHWIRUT,
    "Kirby2": {"powers": 2},
    "Hahn1": {"powers": 3},
    "Thurber": {"powers": 3},
    "Nelson": {"logarithm": True},
    "Roszman1": {"given": {"w": 1 / math.pi}},
    "ENSO": {"given": {"w": 2 * math.pi}},
}
TEXTS = {  # the formula, and where its nonlinear parameters are sought
    "Misra1a": ("b1*(1 - exp(-b2*x))", WIDE),
    "Chwirut2": ("exp(-b1*x)/(b2 + b3*x)", "b1 per x 1e-3 50, r per x 1e-3 50"),
    "Chwirut1": ("exp(-b1*x)/(b2 + b3*x)", "b1 per x 1e-3 50, r per x 1e-3 50"),
    "Lanczos3": (EXPONENTIALS, RATES),
    "Gauss1": (PEAKS, PLACES),
    "Gauss2": (PEAKS, PLACES),
    "DanWood": ("b1*exp(b2*log(x))", "b2 1e-3 50"),
    "Misra1b": ("b1*(1 - (1 + b2*x/2)^-2)", WIDE),
    "Kirby2": (
        "(b1 + b2*x + b3*x2)/(1 + b4*x + b5*x2)",
        "b4 per x -1000 -1e-3 1e-3 1000, b5 per x2 -1000 -1e-3 1e-3 1000",
    ),
    "Hahn1": (CUBICS, SIGNED),
    "Nelson": ("b1 - b2*x1*exp(-b3*x2)", "b3 per x2 -1000 -1e-3 1e-3 1000"),
    "MGH17": ("b1 + b2*exp(-x*b4) + b3*exp(-x*b5)", "b4 per x 0.1 50, b5 per x 0.1 50"),
    "Lanczos1": (EXPONENTIALS, RATES),
    "Lanczos2": (EXPONENTIALS, RATES),
    "Gauss3": (PEAKS, PLACES),
    "Misra1c": ("b1*(1 - (1 + 2*b2*x)^-0.5)", WIDE),
    "Misra1d": ("b1*b2*x/(1 + b2*x)", WIDE),
    "Roszman1": ("b1 - b2*x - w*atan(b3/(x - b4))", "b3 of x 1e-3 10, b4 of x -10 -1e-3 1e-3 10"),
    "ENSO": (TIDES, "b4 of x 0.1 0.5, b7 of x 0.1 0.5"),
    "MGH09": ("b1*(x^2 + x*b2)/(x^2 + x*b3 + b4)", "b2 of x 1e-3 10, b3 of x 1e-3 10, b4 1e-3 100"),
    "Thurber": (CUBICS, SIGNED),
    "BoxBOD": ("b1*(1 - exp(-b2*x))", WIDE),
    "Rat42": ("b1/(1 + exp(b2 - b3*x))", "b2 0.1 10, b3 per x 0.1 50"),
    "MGH10": ("b1*exp(b2/(x + b3))", "b2 of x 0.1 1000, b3 of x 0.1 100"),
    "Eckerle4": ("(b1/b2)*exp(-0.5*((x - b3)/b2)^2)", "b2 of x 1e-3 1, b3 of x 0.5 1.5"),
    "Rat43": ("b1*exp(-log(1 + exp(b2 - b3*x))/b4)", "b2 0.1 20, b3 per x 0.1 50, b4 0.1 10"),
    "Bennett5": ("b1*exp(-log(b2 + x)/b3)", "b2 of x 0.1 100, b3 0.1 10"),
}


def _sought(text):
    """A nonlinear parameter from its name, the quantity that its scale is `per` or `of`, and the
    ends of its intervals.
    """
    name, per, of, ends = re.fullmatch(
        r"(\w+)(?: per (\w+))?(?: of (\w+))?((?: \S+)+)", text
    ).groups()
    numbers = [float(end) for end in ends.split()]
    return Nonlinear(name, per, tuple(zip(numbers[::2], numbers[1::2], strict=True)), of)


def _own(table, name):
    return table.get(name) or table.get(name.rstrip("123"))


PROBLEMS = tuple(
    Certified(
        name,
        text,
        tuple(map(_sought, sought.split(", "))),
        alike=_own(ALIKE, name) or (),
        **_own(OWN, name) or {},
    )
    for name, (text, sought) in TEXTS.items()
)
