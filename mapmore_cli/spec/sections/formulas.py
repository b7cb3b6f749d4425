"""The section `formulas`: formulas of the user's own, each written as an expression."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, model_validator

from mapmore_cli.domain.declared import Contradiction
from mapmore_cli.spec.fields import Quantity, Section


class FormulaParameter(Section):
    """A parameter: its `unit`, shown beside its value; `bounds` between which it is sought, where the formula is not linear in it.

    `start` is what `method: levenberg_marquardt` with `starts: given` begins from, once every fitted parameter has one. A `value` is a
    constant, which is not fitted.
    """

    unit: str | None = None
    bounds: Annotated[tuple[float, float], Field(strict=False)] | None = None
    start: float | None = None
    value: float | None = None

    @model_validator(mode="after")
    def _constant_or_sought(self) -> FormulaParameter:
        if self.value is not None and (self.bounds is not None or self.start is not None):
            raise Contradiction("a constant `value` is not sought", "remove `bounds` and `start`, or the `value`", "bounds", "start")
        if self.bounds is not None and not self.bounds[0] < self.bounds[1]:
            raise Contradiction(f"the bounds run from {self.bounds[0]:g} to {self.bounds[1]:g}", "put the lower one first", "bounds")
        if self.bounds is not None and self.start is not None and not self.bounds[0] <= self.start <= self.bounds[1]:
            raise Contradiction(f"it starts at {self.start:g}, outside of its bounds", "move one of them", "start")
        return self


class OwnFormula(Section):
    """A formula by an `expression` of quantities and `parameters`, to be named wherever a formula of the literature may be.

    `units` are those that the expression is written in, by quantity, and `output` that of its value; where nothing is said they are the
    model's. `source` says where it is from. Every parameter without `bounds` must be one in which the formula is linear.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=60)]
    expression: Annotated[str, Field(max_length=2000)]
    source: Annotated[str, Field(max_length=500)] = ""
    output: str | None = None
    units: dict[Quantity, str] = {}
    parameters: Annotated[dict[Quantity, FormulaParameter], Field(min_length=1)]

    def definition(self, units: Mapping[str, str], target: str) -> str:
        """Return the formula in a model's `units`, for an output in the unit `target`, as a definition that needs no spec.

        Raises ExpressionError, SpecError, ValueError for an expression that is none, a unit that does not fit, or a parameter in which it
        is not linear.
        """
        from mapmore_cli.modelling.expressions import Name, Number, multiply, parse, substitute, to_text
        from mapmore_cli.modelling.literature.own import definition
        from mapmore_cli.spec.units import convert

        own = {name: convert(1.0, units[name], unit) for name, unit in self.units.items() if name in units and units[name] != unit}
        values = {name: Number(one.value) for name, one in self.parameters.items() if one.value is not None}
        scaled = {name: multiply(Number(factor), Name(name)) for name, factor in own.items() if factor != 1.0}
        whole = 1.0 if self.output is None or self.output == target else convert(1.0, self.output, target)
        expression = multiply(Number(whole), substitute(parse(self.expression), {**scaled, **values}))
        fitted = {name: one for name, one in self.parameters.items() if one.value is None}
        starts = {name: one.start for name, one in fitted.items() if one.start is not None}
        return definition(
            self.name,
            self.source or "the spec",
            to_text(expression),
            {name: one.bounds for name, one in fitted.items()},
            {name: one.unit for name, one in fitted.items() if one.unit is not None},
            starts if fitted and len(starts) == len(fitted) else None,
        )
