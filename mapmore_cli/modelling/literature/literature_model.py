"""What every model of the literature offers, whatever it is fitted to."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.fits import FormulaFit, Optimum
from mapmore_cli.modelling.expressions import Expression

TARGET = "target"
LOAD_CYCLES = "load_cycles"


@dataclass(frozen=True)
class LiteratureModel(ABC):
    """A parametric model with a name; its output may stand against any target.

    - `name`, `reference`: as in the spec, and where it is published.
    - `title`: as people write the name; the name where there is none.
    - `inputs`: quantities that it predicts from.
    - `parameters`: in the order of the publication.
    - `component`: the component of the force that it was published for, `static`, `damping` or `dynamic`.
    - `dimensions`: those of its parameters that are dimensions of the muscle (`diameter`, in m), given and not fitted.
    - `given`: values of the dimensions, once `of_muscle` has put them in.
    - `units`, `definition`: units of the parameters, and what defines the formula, where a spec does (`own`).
    - `fitted_to`: `target`: fitted by `fit`. `load_cycles`: fitted by a method of its own to another experiment than it predicts.
    """

    name: str
    reference: str
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    title: str = field(default="", kw_only=True)
    component: str = field(default="static", kw_only=True)
    dimensions: tuple[str, ...] = field(default=(), kw_only=True)
    given: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    units: Mapping[str, str] = field(default_factory=dict, kw_only=True)
    definition: str = field(default="", kw_only=True)

    fitted_to: ClassVar[str] = TARGET
    side_by_side: ClassVar[int] = 0
    """Rows of a table up to which `fit_each` is quicker than one fit after the other."""

    def of_muscle(self, lengths: Mapping[str, float | None]) -> Self:
        """Return the model with the dimensions of a muscle, in m, those that it needs among `lengths`.

        Raises `SpecError` where one of them is not known.
        """
        given = {name: value for name in self.dimensions if (value := lengths.get(name)) is not None}
        for name in self.dimensions:
            if name not in given:
                raise SpecError(f"{self.name} needs the {name} of the muscle", f"add `{name}: 10 mm` (with your own number) to `muscle`")
        return replace(self, given=given) if given else self

    def starting_from(self, start: str) -> LiteratureModel:
        """Return the model fitted from starting values that a paper prints; raises `SpecError` where none are published."""
        raise SpecError(f"{self.name} has no starting values called `{start}`", "leave out `starts`")

    @abstractmethod
    def fit(self, columns: Columns, y: Array, method: str | None = None, *, advice: bool = True) -> FormulaFit:
        """Fit to the target `y`, `(n,)`, with the inputs among `columns`; raises `DataError` where that is impossible.

        Without `advice`, notes do not say what to measure for parameters that the data do not show.
        """

    def fit_each(self, tables: Sequence[tuple[Columns, Array]], method: str | None = None, *, advice: bool = True) -> list[FormulaFit]:
        """`fit` of several tables, inputs and target: the same fits, to the last digit."""
        return [self.fit(columns, y, method, advice=advice) for columns, y in tables]

    @abstractmethod
    def predict(self, parameters: Mapping[str, float], columns: Columns) -> Array:
        """Return the model on every row, `(n,)`; NaN with the parameters of a failed fit."""

    @abstractmethod
    def equations(self, fit: FormulaFit) -> dict[str, Expression]:
        """Return the model with the numbers of a fit that has not failed, in physical units: one equation, or one for each of its parts."""


SEVERITY = ("converged", "at_bound", "stopped_by_limit", "rank_deficient", "failed")
"""The statuses of `FormulaFit`, the better ones first."""


def renamed(fit: FormulaFit, name: Callable[[str], str]) -> FormulaFit:
    """Return the fit with `name(parameter)` for every parameter."""
    return replace(
        fit,
        parameters={name(parameter): value for parameter, value in fit.parameters.items()},
        errors={name(parameter): value for parameter, value in fit.errors.items()},
        rivals=tuple(replace(r, parameters={name(parameter): value for parameter, value in r.parameters.items()}) for r in fit.rivals),
    )


def merged(name: str, parts: Mapping[str, FormulaFit]) -> FormulaFit:
    """Return the fit called `name` of independent parts, whose parameters have different names, by what their notes are headed with.

    Status and condition are those of the worst part; ranks, sums of squares and samples add up. A rival is that of one part, with the
    others as they are.
    """
    fits = parts.values()
    parameters = {parameter: value for fit in fits for parameter, value in fit.parameters.items()}
    sse = sum(fit.sse for fit in fits)
    return FormulaFit(
        name=name,
        parameters=parameters,
        errors={parameter: value for fit in fits for parameter, value in fit.errors.items()},
        status=max((fit.status for fit in fits), key=SEVERITY.index),
        method=", ".join(dict.fromkeys(fit.method for fit in fits)),
        rank=sum(fit.rank for fit in fits),
        condition=max(fit.condition for fit in fits),
        sse=sse,
        samples=sum(fit.samples for fit in fits),
        notes=tuple(f"{part}: {note}" for part, fit in parts.items() for note in fit.notes),
        rivals=tuple(Optimum({**parameters, **r.parameters}, sse - fit.sse + r.sse) for fit in fits for r in fit.rivals),
    )
