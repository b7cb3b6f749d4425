"""A formula whose parameters differ between regions of the inputs."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.modelling.expressions import Expression
from mapmore_cli.modelling.literature.formula import Formula, LiteratureModel, merged, renamed
from mapmore_cli.modelling.literature.problem import finite, needed

_COMPARISONS: Mapping[str, Callable[[Array, float], BoolArray]] = {
    ">": operator.gt,
    "<": operator.lt,
    "<=": operator.le,
}


@dataclass(frozen=True)
class Condition:
    """`quantity comparison value`, with `>`, `<` or `<=`."""

    quantity: str
    comparison: str
    value: float

    def __str__(self) -> str:
        return f"{self.quantity} {self.comparison} {self.value:g}"

    def holds(self, columns: Columns) -> BoolArray:
        """Rows on which it holds, `(n,)`; False where the quantity is NaN."""
        return _COMPARISONS[self.comparison](needed(self.quantity, columns), self.value)


@dataclass(frozen=True)
class Region:
    """Rows on which all `conditions` hold; `label` ends the names of its parameters."""

    label: str
    conditions: tuple[Condition, ...]

    def __and__(self, other: Region) -> Region:
        return Region(f"{self.label}_{other.label}", (*self.conditions, *other.conditions))

    def __str__(self) -> str:
        return ", ".join(map(str, self.conditions))

    def parameter(self, name: str) -> str:
        """Return what the parameter `name` is called in this region, as `B0_rise`."""
        return f"{name}_{self.label}"

    def rows(self, columns: Columns) -> BoolArray:
        """Return True on the rows in the region, `(n,)`."""
        return np.asarray(
            np.all([condition.holds(columns) for condition in self.conditions], axis=0)
        )


DIRECTIONS = (
    Region("rise", (Condition("direction", ">", 0.0),)),
    Region("fall", (Condition("direction", "<", 0.0),)),
)
"""Rise and fall of the pressure, `direction` +1 and -1 (M2 eq 16); where it is 0 the muscle has not
moved yet, which is neither.
"""


@dataclass(frozen=True)
class PiecewiseFormula(LiteratureModel):
    """A `local` formula with parameters of its own in each of the disjoint `regions`, and zero
    outside of all; made by `by_region`.
    """

    local: Formula
    regions: tuple[Region, ...]

    def fit(
        self, columns: Columns, y: Array, method: str | None = None, *, advice: bool = True
    ) -> FormulaFit:
        """Fit the local formula to the rows of each region; rows outside of all are left out, and
        counted in a note.

        Status and condition are those of the worst region, ranks and sums of squares add up, and
        notes name their region. A region with fewer samples than parameters has zeros, as the
        solution of least norm would: nothing is predicted there, and the status is
        `rank_deficient`.

        Raises DataError for a value that is not finite, an absent input, or too few samples in
        every region.
        """
        inputs = {name: finite(name, needed(name, columns)) for name in self.inputs}
        target = finite("the target", y)
        parts = {
            f"{region.label} ({region})": self._fit_region(region, inputs, target, method, advice)
            for region in self.regions
        }
        if all(part.samples < len(self.local.parameters) for part in parts.values()):
            raise DataError(
                f"{self.name} has {len(self.local.parameters)} parameters in each region, but "
                "no region has as many samples: "
                + ", ".join(f"{part.samples} in {region}" for region, part in parts.items()),
                "give it more training data, or leave the formula out",
            )
        whole = merged(self.name, parts)
        if not (left_out := len(target) - whole.samples):
            return whole
        note = (
            f"{left_out} of {len(target)} samples are in no region: they are not fitted, and "
            "zero is predicted for them"
        )
        return replace(whole, notes=(*whole.notes, note))

    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the formula of the region that each row lies in, `(n,)`; zero in no region, NaN
        where an input is.
        """
        inputs = np.array([needed(name, columns) for name in self.inputs])
        y = np.where(np.isnan(inputs).any(axis=0), np.nan, 0.0)
        for region in self.regions:
            y += np.where(
                region.rows(columns),
                self.local.predict(self._own(region, parameters), columns),
                0.0,
            )
        return y

    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """Return the local formula with the numbers of each region, by the conditions of the
        region.
        """
        parts = {
            region: replace(fit, parameters=self._own(region, fit.parameters))
            for region in self.regions
        }
        return {
            f"{self.name}: {region}": self.local.equation(part) for region, part in parts.items()
        }

    def _own(self, region: Region, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return the parameters of one region, as the local formula names them."""
        return {name: parameters[region.parameter(name)] for name in self.local.parameters}

    def _fit_region(
        self, region: Region, inputs: Columns, target: Array, method: str | None, advice: bool
    ) -> FormulaFit:
        rows = region.rows(inputs)
        y, names = target[rows], self.local.parameters
        if len(y) >= len(names):
            fit = self.local.fit(
                {name: column[rows] for name, column in inputs.items()}, y, method, advice=advice
            )
        else:
            zeros, unknown = dict.fromkeys(names, 0.0), dict.fromkeys(names, float("nan"))
            note = (
                f"{len(y)} samples for {len(names)} parameters: it is not fitted, and zero is "
                "predicted there"
            )
            fit = FormulaFit(
                self.name,
                zeros,
                unknown,
                "rank_deficient",
                "not fitted",
                0,
                1.0,
                float(y @ y),
                len(y),
                (note,),
            )
        return renamed(fit, region.parameter)


def by_region(local: Formula, regions: tuple[Region, ...]) -> PiecewiseFormula:
    """`local` in each of `regions`, which must be disjoint; its parameter `B0` is `B0_rise` in the
    region labelled `rise`.
    """
    conditioned = [condition.quantity for region in regions for condition in region.conditions]
    return PiecewiseFormula(
        name=local.name,
        reference=local.reference,
        inputs=tuple(dict.fromkeys((*local.inputs, *conditioned))),
        parameters=tuple(region.parameter(name) for region in regions for name in local.parameters),
        local=local,
        regions=regions,
        component=local.component,
        title=local.title,
        about=local.about,
    )
