"""Sárosi's formula with a slack foot, blended with the plain one (ours; M1's outlook asks for physics-based terms).

Measured muscles give almost no force below a threshold pressure that rises with strain, and the plain formula spends its terms on that
corner. Here `hi`, Sárosi's formula with a1..a6, and the foot `lo = b0 + b1 P + b2 strain` are joined by a hinge of width w:

    F = share (lo + w ln(1 + exp((hi - lo)/w))) + (1 - share) (Sárosi's with s1..s6)

The second is the plain formula fitted to the same data. The shares are in proportion to `(r^2 + 0.01^2)^-2`, r the training RMSE/max|F| of
each, so that data without a foot keep Sárosi's. A plain fit whose curvature ran to a bound or is not determined has no share: past the
strains tested its exp(+-400 strain) would swamp the rest, however small the share. Strain must be a fraction (the prior of a3 is a decay
over a strain of 1/33).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.fits import FormulaFit, Optimum
from mapmore_cli.modelling.expressions import Expression, Number, parse, substitute
from mapmore_cli.modelling.literature import hinge
from mapmore_cli.modelling.literature.formula import Formula, dependence
from mapmore_cli.modelling.literature.formulas.sarosi import FORMULA as PLAIN
from mapmore_cli.modelling.literature.hinge import HingeFit

METHOD = "penalised least squares"
GOOD_ENOUGH = 0.01  # RMSE/max|F| below which better is no longer a reason for a larger share
FEW_LEVELS = 3  # strain levels that any curvature passes through
APART = 0.05  # of max|strain|: levels nearer than that are one

HIGH = PLAIN.text
LOW = "b0 + b1*pressure + b2*strain"
PLAIN_NAMES = {name: name.replace("a", "s") for name in PLAIN.parameters}
PLAIN_TEXT = "(s1*pressure + s2)*exp(s3*strain) + s4*strain*pressure + s5*pressure + s6"
PRINTED = f"share*({LOW} + w*log(1 + exp(({HIGH} - ({LOW}))/w))) + (1 - share)*({PLAIN_TEXT})"
COMPUTED = (  # the same, but cannot overflow: ln(1 + exp(z)) = (z + |z|)/2 + ln(1 + exp(-|z|))
    f"share*(({HIGH} + {LOW} + abs({HIGH} - ({LOW})))/2 + w*log(1 + exp(-abs({HIGH} - ({LOW}))/w))) + (1 - share)*({PLAIN_TEXT})"
)


class SarosiHinged(Formula):
    """A formula with a fit of its own, whose equation is printed in another form than it is computed in."""

    side_by_side = hinge.SIDE_BY_SIDE

    def fit(self, columns: Columns, y: Array, method: str | None = None, *, advice: bool = True) -> FormulaFit:
        """Penalised least-squares fit of the hinged part (`hinge.fit`), blended with the plain formula.

        `method` is that of the plain formula. Standard errors are those of the two parts, the share's is unknown; status and condition are
        those of the part with the larger share. Raises as `Formula.fit`.
        """
        return self.fit_each([(columns, y)], method, advice=advice)[0]

    def fit_each(
        self,
        tables: Sequence[tuple[Columns, Array]],
        method: str | None = None,
        *,
        advice: bool = True,  # noqa: ARG002 - has none
    ) -> list[FormulaFit]:
        """`fit` of several tables, whose hinged parts are sought side by side."""
        problems = [self._problem(*table) for table in tables]
        ordered = [(problem.columns, problem.y) for problem in problems]
        plain = [PLAIN.fit(*table, method, advice=False) for table in ordered]
        return [self._blended(*parts) for parts in zip(hinge.fit_each(ordered), plain, ordered, strict=True)]

    def _blended(self, hinged: HingeFit, plain: FormulaFit, table: tuple[Columns, Array]) -> FormulaFit:
        columns, y = table
        parameters, errors = _both(hinged, plain)
        alone = self.predict({**parameters, "share": 1.0}, columns), PLAIN.predict(plain.parameters, columns)
        scatter = [_relative_rmse(predicted, y) for predicted in alone]
        share = parameters["share"] = _share(*scatter) if plain.status == "converged" else 1.0
        residual = self.predict(parameters, columns) - y
        return FormulaFit(
            name=self.name,
            parameters={name: parameters[name] for name in self.parameters},
            errors={name: errors[name] for name in self.parameters},
            status=_status(hinged) if share > 0.5 else plain.status,
            method=METHOD,
            rank=hinged.rank + (plain.rank + 1 if share < 1.0 else 0),
            condition=hinged.condition if share > 0.5 else plain.condition,
            sse=float(residual @ residual),
            samples=len(y),
            notes=tuple(_notes(hinged, plain, share, scatter, columns)),
            rivals=tuple(
                self._rival({**parameters, **dict(zip(hinge.NAMES, map(float, q), strict=True))}, columns, y) for q in hinged.others
            ),
        )

    def _rival(self, parameters: dict[str, float], columns: Columns, y: Array) -> Optimum:
        residual = self.predict(parameters, columns) - y
        return Optimum({name: parameters[name] for name in self.parameters}, float(residual @ residual))

    def equation(self, fit: FormulaFit) -> Expression:
        """Return the formula as a person would write it; where `hi - lo` is beyond 700 w it overflows, which `predict` does not."""
        return substitute(parse(PRINTED), {name: Number(value) for name, value in fit.parameters.items()})


def _both(hinged: HingeFit, plain: FormulaFit) -> tuple[dict[str, float], dict[str, float]]:
    """Parameters and standard errors of both parts; zeros for a plain formula that has no share."""
    usable = plain.status == "converged"
    parameters = dict(zip(hinge.NAMES, map(float, hinged.parameters), strict=True))
    errors = dict(zip(hinge.NAMES, map(float, hinged.errors), strict=True))
    parameters |= {PLAIN_NAMES[name]: value if usable else 0.0 for name, value in plain.parameters.items()}
    errors |= {PLAIN_NAMES[name]: value if usable else float("nan") for name, value in plain.errors.items()}
    return parameters, {**errors, "share": float("nan")}


def _relative_rmse(predicted: Array, y: Array) -> float:
    return float(np.sqrt(np.mean((predicted - y) ** 2))) / (float(np.abs(y).max()) or 1.0)


def _share(hinged: float, plain: float) -> float:
    """Share of the hinged part, from the RMSE/max|F| of both on the training data."""
    return 1.0 / (1.0 + ((hinged**2 + GOOD_ENOUGH**2) / (plain**2 + GOOD_ENOUGH**2)) ** 2)


def _status(hinged: HingeFit) -> str:
    if hinged.rank < len(hinge.NAMES):
        return "rank_deficient"
    if not hinged.converged:
        return "stopped_by_limit"
    return "at_bound" if hinged.limits else "converged"


def _notes(hinged: HingeFit, plain: FormulaFit, share: float, scatter: list[float], columns: Columns) -> Iterator[str]:
    yield f"a3 is {hinged.a3:.3g}/max|strain|, w is {hinged.w:.3g} of the largest target; {hinged.agreement}"
    if share < 1.0:
        yield f"blend: {share:.1%} hinged (training RMSE {scatter[0]:.2%} of the largest target), {1 - share:.1%} plain ({scatter[1]:.2%})"
    else:
        yield f"blend: hinged alone (training RMSE {scatter[0]:.2%} of the largest target), as the plain fit is {plain.status}"
    levels = _levels(columns["strain"])
    if levels <= FEW_LEVELS:
        yield (
            f"with {levels} strain level{'s' * (levels > 1)} any curvature fits: a3 is left to its prior, {hinged.prior:.3g}/max|strain|, "
            "and values between the levels depend on it"
        )
    yield from (f"{name} ends at its bound" for name in hinged.limits)
    if hinged.rank < len(hinge.NAMES):
        yield dependence(hinged.rank, len(hinge.NAMES), columns, "the priors decided")


def _levels(strain: Array) -> int:
    """Return number of strains that lie apart; many where the strain is swept."""
    values = np.unique(strain)
    gap = APART * float(np.abs(values).max())
    count, i = 0, 0
    while i < len(values):
        count, i = count + 1, int(np.searchsorted(values, values[i] + gap, side="right"))
    return count


FORMULA = SarosiHinged(
    name="sarosi_hinged",
    title="Sárosi, hinged",
    reference="ours, on M1 eq 1",
    inputs=("pressure", "strain"),
    parameters=(*hinge.NAMES, "share", *PLAIN_NAMES.values()),
    text=COMPUTED,
)
