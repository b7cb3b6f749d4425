"""Define Sárosi's hysteresis loss (M2 eq 17-23). Its damping force is critical damping multiplied
by the fraction of the energy of a load cycle that hysteresis dissipates.

At one pressure, Sárosi's force (M2 eq 14) is `F(x) = A exp(c x) + B x + C` with the strain x. This
function is integrated exactly.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import (
    Expression,
    Name,
    derivative,
    evaluate,
    parse,
    substitute,
)
from mapmore_cli.modelling.literature.formula import LOAD_CYCLES, Formula, with_numbers
from mapmore_cli.modelling.literature.formulas.sarosi import sarosi
from mapmore_cli.modelling.literature.problem import finite

SHORTEST = 1.0  # the free strain is searched up to this strain
# number of bisections; they shorten an interval of length one to the size of rounding errors
BISECTIONS = 60


class ForceCurve(NamedTuple):
    """Force `A exp(c x) + B x + C` as a function of the strain x at n pressures; A, B and C have
    the shape (n,).
    """

    A: Array
    B: Array
    C: Array
    c: float

    def __call__(self, strain: Array) -> Array:
        """Return the force at the given strain for each of the n pressures, shape (n,)."""
        return self.A * np.exp(self.c * strain) + self.B * strain + self.C

    def mean(self, start: float, end: Array) -> Array:
        """Return the mean force between the strain `start` and each strain in `end`, shape (n,). If
        an end equals `start`, the mean is the force at `start`.
        """
        # imported here, because the import is slow and few studies need it
        from scipy.special import exprel

        ratio = exprel(self.c * (end - start))  # (exp(z) - 1)/z, and 1 for z = 0
        return np.asarray(
            self.A * np.exp(self.c * start) * ratio + self.B * (start + end) / 2 + self.C
        )

    @np.errstate(all="ignore")
    def end_of_stroke(self, start: float) -> Array:
        """Return the strain at which the force first falls to zero after `start`, shape (n,).

        If the force at `start` is not positive, return `start`. If the force is positive at every
        strain, return the strain of the smallest force, or `SHORTEST` if the force has no minimum.
        """
        turns = (self.A > 0.0) & (self.A * self.c * self.B < 0.0)
        # strain of the smallest force, for a curve that is bent upwards
        turning = np.log(-self.B / (self.A * self.c)) / self.c
        low = np.full_like(self.A, start)
        high = np.where(turns, np.clip(turning, start, SHORTEST), SHORTEST)
        slack = self(low) <= 0.0
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            pulls = self(middle) > 0.0
            low, high = np.where(pulls, middle, low), np.where(pulls, high, middle)
        return np.where(slack, start, low)


UPPER, LOWER = sarosi("au"), sarosi("al")
PARAMETERS = (*UPPER.parameters, *LOWER.parameters, "length", "strain_min")
SEVERITY = ("converged", "at_bound", "stopped_by_limit", "rank_deficient", "failed")
"""The statuses of `FormulaFit`, from the best to the worst."""


@dataclass(frozen=True)
class HysteresisLoss(Formula):
    """Damping force: the fraction `zeta(P)` of the critical damping force. Critical damping depends
    on the stiffness of the upper branch and on the mass that hangs on the muscle.

    `text` is the damping force (M2 eq 19) as an expression of the inputs, `length` (m) and two more
    quantities: `zeta`, Lehr's damping coefficient (eq 21), and `stiffness`, `k_t = (d F_su/d
    strain)/length` (eq 20, with the muscle's length in place of n_t w_t). The pressure is in kPa,
    the strain a fraction, strain_rate in 1/s, and the load in N. The load is the weight in the
    experiment that is predicted; its mass is load/9.81 (M2 table 3 prints the mass in newtons).

    zeta is a fraction, so it is limited to [0, 1]. M2 does not define zeta if there is no free
    strain. Here, zeta is 1 if the upper curve does not pull even at `strain_min`; at slightly
    higher pressures, it is 1 because of the limit. If the curve never falls to zero, the stroke
    ends where the curve turns up again, or at a strain of one.
    """

    fitted_to: ClassVar[str] = LOAD_CYCLES

    def fit(self, *_: object, **__: object) -> FormulaFit:
        """Raise DataError, because this formula can be fitted only to load cycles, by `fit_cycles`.
        A measured damping force does not show the energy that is lost in a cycle.
        """
        raise DataError(
            f"{self.name} is fitted to load cycles, not to a target",
            "name it in `validate.against` of a study with `needs: {static: my-static.yaml}`",
        )

    def fit_cycles(self, cycles: Columns, length: float) -> FormulaFit:
        """Fit Sárosi's formula to the upper and to the lower branch of load cycles (M2 eq 17-18),
        each by variable projection.

        - `cycles`: columns `pressure` (kPa), `strain`, `force` (N, the mean of the branches) and
          `hysteresis` (N, half the distance between the branches), shape (n,) each.
        - `length`: length of the muscle at rest, m.

        The result combines both branches: it has the worse status and the larger condition number,
        and ranks and sums of squares are added. A note gives the pressures at which zeta had to be
        limited. The length and the smallest strain are given, not fitted, so that they have no
        standard error.

        Raises DataError for a missing or non-finite column, too few samples, or a length that is
        not positive.
        """
        if not 0.0 < length < np.inf:
            raise DataError(
                f"{self.name} needs a positive length of the muscle, but the length is {length:g} "
                "m",
                "write it as `muscle: {length: 88 mm}`",
            )
        names = ("pressure", "strain", "force", "hysteresis")
        columns = {name: finite(name, cycles) for name in names}
        force, hysteresis = columns["force"], columns["hysteresis"]
        upper = UPPER.fit(columns, force + hysteresis)
        lower = LOWER.fit(columns, force - hysteresis)
        constants = {"length": length, "strain_min": float(columns["strain"].min())}
        parameters = {**upper.parameters, **lower.parameters, **constants}
        notes = [f"upper curve: {note}" for note in upper.notes]
        notes += [f"lower curve: {note}" for note in lower.notes]
        pressure = np.linspace(0.0, float(columns["pressure"].max()), 1001)
        share = lehr(parameters, pressure)
        if (limited := (share < 0.0) | (share > 1.0)).any():
            low, high = pressure[limited].min(), pressure[limited].max()
            notes.append(f"zeta is limited to [0, 1] between {low:.3g} and {high:.3g} kPa")
        return replace(
            max(upper, lower, key=lambda fit: SEVERITY.index(fit.status)),
            name=self.name,
            parameters=parameters,
            errors={**upper.errors, **lower.errors, **dict.fromkeys(constants, float("nan"))},
            rank=upper.rank + lower.rank,
            condition=max(upper.condition, lower.condition),
            sse=upper.sse + lower.sse,
            samples=upper.samples + lower.samples,
            notes=tuple(notes),
            rivals=(),
        )

    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the damping force on every row, shape (n,)."""
        numbers = {name: np.asarray(parameters[name]) for name in self.parameters}
        share = zeta(parameters, evaluate(Name("pressure"), columns))
        return evaluate(self.expression, {**columns, **numbers, "zeta": share}, len(share))

    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """Return the equation of the damping force, in which zeta is a variable, and the equations
        of the two force curves from which zeta is computed.
        """
        return {
            self.name: self.equation(fit),
            f"{self.name}: upper curve": with_numbers(UPPER.expression, fit.parameters),
            f"{self.name}: lower curve": with_numbers(LOWER.expression, fit.parameters),
        }

    @cached_property
    def expression(self) -> Expression:
        """Expression of the damping force `text`, with a formula in place of the stiffness."""
        stiffness = derivative(UPPER.expression, "strain")
        return substitute(parse(self.text), {"stiffness": stiffness / Name("length")})


@np.errstate(all="ignore")
def lehr(parameters: Mapping[str, float], pressure: Array) -> Array:
    """Return `zeta = (U_u - U_l)/U_u` (M2 eq 21) at each `pressure`, shape (n,).

    U_u and U_l are the energies of a stroke on the upper and on the lower branch of a load cycle.
    The result is not limited to [0, 1]. If the muscle is almost slack, U_u is nearly zero, and zeta
    becomes infinite. It is also infinite if U_u overflows.
    """
    upper, lower = (_curve(parameters, branch, pressure) for branch in ("au", "al"))
    start = parameters["strain_min"]
    end = upper.end_of_stroke(start)
    whole, kept = upper.mean(start, end), lower.mean(start, end)
    return np.where((whole > 0.0) & (whole < np.inf), (whole - kept) / whole, np.inf)


def zeta(parameters: Mapping[str, float], pressure: Array) -> Array:
    """Return Lehr's damping coefficient (M2 eq 21) at each `pressure`, shape (n,), limited to [0,
    1].
    """
    return np.clip(lehr(parameters, pressure), 0.0, 1.0)


def _curve(parameters: Mapping[str, float], branch: str, pressure: Array) -> ForceCurve:
    """Return Sárosi's force with the parameters of a branch (`au1` to `au6` for the upper one) at
    each `pressure`.
    """
    a1, a2, a3, a4, a5, a6 = (parameters[f"{branch}{i}"] for i in range(1, 7))
    return ForceCurve(a1 * pressure + a2, a4 * pressure, a5 * pressure + a6, a3)


def _loss(name: str, title: str, reference: str, text: str, about: str) -> HysteresisLoss:
    inputs = ("pressure", "strain", "strain_rate", "load")
    return HysteresisLoss(
        name, reference, inputs, PARAMETERS, text, component="damping", title=title, about=about
    )


FORMULAS = (
    _loss(
        "sarosi_hysteresis_loss",
        "Sárosi, hysteresis loss",
        "M2 eq 17-23, times the length",
        "-2*zeta*sqrt(abs(stiffness)*load/9.81)*length*strain_rate",
        """`sarosi_hysteresis_loss` is Sárosi's hysteresis loss: the product of the damping
ratio zeta, the critical damping `2 sqrt(|k_t| m)` and the muscle's velocity.

The stiffness k_t is in N/m (equation 20 of the paper M2), so the damping `2 zeta sqrt(|k_t| m)` is
in N s/m. To give a force, it must be multiplied by a velocity in m/s. Equation 19 of the paper
multiplies it by the strain rate (1/s) instead, and the result is then in N/m. Therefore
`sarosi_hysteresis_loss` also multiplies by the length of the muscle: the length times the strain
rate is the velocity.""",
    ),
    _loss(
        "sarosi_hysteresis_loss_printed",
        "Sárosi, hysteresis loss, printed",
        "M2 eq 17-23",
        "-2*zeta*sqrt(abs(stiffness)*load/9.81)*strain_rate",
        (
            "`sarosi_hysteresis_loss_printed` is Sárosi's hysteresis loss as equations 19 and 20 "
            "of the paper M2 print it, without the length of the muscle. The result is that of "
            "`sarosi_hysteresis_loss` divided by the length."
        ),
    ),
)
