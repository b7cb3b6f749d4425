"""Model muscles of one design as a family. All muscles share one function f of pressure and strain.
It is multiplied by the largest force S of the muscle, which depends on one dimension l of the
muscle, for example its length.

    F = zero + S(l) f(P, strain),   S(l) = a atan(b (l - dead))   or   a l^b

f is the hinged Sárosi formula, fitted to the forces of all specimens, each divided by its own
largest force. `zero` is the mean of the forces of the slack muscles, over all specimens. b has a
prior, because a few specimens hardly determine it. For the rest length of McKibben muscles, the
centre of the prior is 19.03 1/m, and `dead`, the length of the fittings, is 7.5 mm (Bolen, Elzein,
Pang, Hunt, Actuators 2026, from 31 muscles of 10 mm diameter). For S = `a l^b`, which is meant for
a diameter, the centre of the prior of b is 2.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares, minimize_scalar

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import Expression, Name, Number, parse, substitute, to_text
from mapmore_cli.modelling.literature.formula import Formula, with_numbers
from mapmore_cli.modelling.literature.formulas.sarosi_hinged import COMPUTED, PRINTED
from mapmore_cli.modelling.literature.formulas.sarosi_hinged import FORMULA as SHAPE
from mapmore_cli.modelling.literature.own import FamilySettings, definition, formula_of

NAME = "family"
DEAD = 0.0075
"""Length of the fittings, m."""

CENTRE = {"saturating": 19.03, "power": 2.0}
"""Centre of the prior of b: in 1/m for `saturating`, and the exponent for `power`."""

SPREAD, SCATTER = 0.3, 0.05
"""Standard deviation of the prior of ln b, and of the logarithm of the largest force among
specimens of equal dimensions.
"""

LOW, HIGH = 0.02, 0.995
"""Quantiles of a specimen's forces that are used as its slack force and as its largest force."""

SLACK = 0.1
"""The lowest force of a specimen is its slack force if it is below this fraction of the
largest force. Otherwise, the specimen was never slack, and its slack force is taken as zero.
"""

PRIOR = 0.15
"""Standard deviation of the priors of the two scales of a new specimen. Both priors have the mean
1.
"""

WITHIN = (0.3, 3.0)
"""Bounds of the scale of the strain."""


@lru_cache(maxsize=64)
def family_of(text: str) -> Family:
    """Return the family that a text defines. Raises ValueError if the text defines no family."""
    try:
        document = dict(json.loads(text)["family"])
        metres = float(document.pop("metres"))
        settings = FamilySettings(**document)
        if (
            not isinstance(parse(settings.of), Name)
            or not metres > 0
            or settings.scale not in CENTRE
        ):
            raise TypeError(
                "`of` must be the name of a quantity, `metres` must be larger than zero, and "
                f"`scale` must be one of {', '.join(CENTRE)}; correct these keys of `family`"
            )
    except (KeyError, TypeError, AttributeError, RecursionError, OverflowError) as error:
        raise ValueError(
            f"the text is no valid definition of a family: {type(error).__name__}: {error}"
        ) from error
    return Family(
        name=NAME,
        reference="ours, on M1 eq 1 and Bolen et al. 2026",
        inputs=("pressure", "strain", settings.of),
        parameters=("zero", "a", "b", *SHAPE.parameters),
        text=f"zero + ({_scale_text(settings, metres)})*({COMPUTED})",
        definition=text,
        settings=settings,
        metres=metres,
    )


def _scale_text(settings: FamilySettings, metres: float) -> str:
    length = settings.of if metres == 1.0 else f"{metres!r}*{settings.of}"
    return (
        f"a*atan(b*({length} - {DEAD!r}))"
        if settings.scale == "saturating"
        else f"a*exp(b*log({length}))"
    )


@dataclass(frozen=True)
class Family(Formula):
    """A formula that is fitted to all specimens together. `metres` is the length, in m, of one unit
    of the quantity in which the specimens differ.
    """

    settings: FamilySettings = field(kw_only=True)
    metres: float = field(kw_only=True)

    def fit(self, columns: Columns, y: Array, method: str | None = None) -> FormulaFit:
        """Fit the function that all specimens share, and the dependence of the largest force on the
        dimension. Standard errors are given only for the parameters of the shared function.

        Raises DataError if all samples are from one specimen.
        """
        of = self.settings.of
        which, number = np.unique(columns[of], return_inverse=True)
        if len(which) < 2:
            raise DataError(
                f"a family needs several specimens, but {of} is {which[0]:g} in all training data",
                "add recordings of another specimen",
            )
        ends = np.array([_slack_and_largest(y[number == i]) for i in range(len(which))])
        zero, largest = ends.T
        a, b = self._law(which * self.metres, largest)
        normal = (y - zero[number]) / largest[number]
        shape = SHAPE.fit(columns, normal, method)
        parameters = {"zero": float(zero.mean()), "a": a, "b": b, **shape.parameters}
        residual = self.predict(parameters, columns) - y
        unknown = dict.fromkeys(("zero", "a", "b"), math.nan)
        forces = ", ".join(
            f"{of} {place:g}: {force:.4g}" for place, force in zip(which, largest, strict=True)
        )
        notes = (
            f"learnt from {len(which)} specimens; largest force of each: {forces}",
            *shape.notes,
        )
        return replace(
            shape,
            name=NAME,
            parameters=parameters,
            errors={**unknown, **shape.errors},
            sse=float(residual @ residual),
            notes=notes,
            rivals=(),
            definition=self.definition,
        )

    def _law(self, lengths: Array, largest: Array) -> tuple[float, float]:
        """Return a and b of the largest force S(l). They are fitted to ln S by least squares, with
        a prior for ln b.
        """
        centre = math.log(CENTRE[self.settings.scale])

        def rest(log_b: float) -> Array:
            """Return the estimate of ln a from each specimen, shape (m,), for a given ln b."""
            b = math.exp(log_b)
            if self.settings.scale == "power":
                return np.log(largest) - b * np.log(lengths)
            return np.log(largest) - np.log(np.arctan(b * np.maximum(lengths - DEAD, 1e-6)))

        def cost(log_b: float) -> float:
            log_a = rest(log_b)
            squares = float(np.sum((log_a - log_a.mean()) ** 2))
            return squares / SCATTER**2 + ((log_b - centre) / SPREAD) ** 2

        within = (centre - 2, centre + 2)
        minimum = minimize_scalar(cost, bounds=within, method="bounded", options={"xatol": 1e-10})
        best = float(minimum.x)
        return math.exp(float(np.mean(rest(best)))), math.exp(best)

    def equation(self, fit: FormulaFit) -> Expression:
        """Return the formula with its fitted numbers. The smooth maximum in the formula is written
        as `w*log(1 + exp(z))`, which is easy to read, but overflows for large z.
        """
        text = f"zero + ({_scale_text(self.settings, self.metres)})*({PRINTED})"
        return with_numbers(parse(text), fit.parameters)


def _slack_and_largest(y: Array) -> tuple[float, float]:
    """Return the force of the slack muscle, and the largest force minus the force of the slack
    muscle.
    """
    low, high = np.quantile(y, [LOW, HIGH])
    zero = float(low) if abs(low) < SLACK * high else 0.0
    return zero, float(high) - zero


def adapted(
    fit: FormulaFit, columns: Mapping[str, Array], target: Array, dimension: float
) -> FormulaFit:
    """Return the formula of a new specimen of the family, `zero + q_force S f(P, q_strain strain)`,
    as a function of pressure and strain only. The scales q are fitted to the measured points of
    this specimen.

    `columns` holds the pressure and strain of these points, shape (n,) each, and `target` holds the
    forces. Without points, both scales are one. The prior of each scale has the mean one and a
    standard deviation of 15 %. Samples at the same strain have a common error. Together, they have
    the weight of one sample with an error of 5 % of the largest force.
    """
    family = family_of(fit.definition)
    known = {**fit.parameters, family.settings.of: dimension}
    numbers = {name: Number(float(value)) for name, value in known.items() if name != "zero"}
    body = parse(family.text.removeprefix("zero + "))
    body = substitute(body, {**numbers, "strain": parse("q_strain*strain")})
    text, bounds = f"zero + q_force*({to_text(body)})", {"q_strain": WITHIN}
    made = definition(
        f"{NAME}, adapted", family.reference, text, {"zero": None, "q_force": None, **bounds}, {}
    )
    formula, n = formula_of(made), len(target)
    columns = columns or dict.fromkeys(("pressure", "strain"), target)  # without rows
    # samples at the same strain have a common error
    span = float(np.ptp(columns["strain"])) or 1.0 if n else 1.0
    strains = np.round(columns["strain"] / span, 2)
    _, number, counts = np.unique(strains, return_inverse=True, return_counts=True)
    weight = 1 / np.sqrt(counts[number])
    scatter = SCATTER * float(np.abs(target).max(initial=0.0) or 1.0)

    def parameters(q: Array) -> dict[str, float]:
        return {"zero": fit.parameters["zero"], "q_force": float(q[0]), "q_strain": float(q[1])}

    def missed(q: Array) -> Array:
        return formula.predict(parameters(q), columns) - target

    def cost(q: Array) -> Array:
        return np.concatenate([weight * missed(q) / scatter, (q - 1.0) / PRIOR])

    solved = least_squares(cost, np.ones(2), xtol=1e-12, ftol=1e-12)
    jacobian, residual = np.asarray(solved.jac), missed(solved.x)
    errors = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
    return replace(
        fit,
        name=formula.name,
        parameters=parameters(solved.x),
        errors={"zero": math.nan, "q_force": float(errors[0]), "q_strain": float(errors[1])},
        method="least squares with priors",
        rank=2,
        condition=1.0,
        sse=float(residual @ residual),
        samples=n,
        notes=(*fit.notes[:1], f"adapted with {n} samples"),
        definition=made,
    )
