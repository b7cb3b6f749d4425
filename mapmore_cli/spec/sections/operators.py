"""The families of operators that a dictionary may hold: their form follows from what each operator declares of itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar

from pydantic import Field, create_model, model_validator

from mapmore_cli.modelling.terms.operator import Operator, Parameter
from mapmore_cli.modelling.terms.operators import families
from mapmore_cli.spec.fields import Section, WithUnit, contradiction

Of = Annotated[list[str], Field(min_length=1)]
"""Names of quantities, or of states as `play(pressure, 0.16)`."""
Count = Annotated[int, Field(ge=1, le=100)]


class OperatorFamily(Section):
    """States that one operator makes of the quantities `of`.

    The numbers of an operator with one parameter are a list, or a `count` of them; those of an operator with several are given together,
    or left out where training can find them.
    """

    operator: ClassVar[Operator]
    of: Of

    def numbers(self, step: float, longest: float) -> Sequence[tuple[float, ...]]:
        """The numbers of each state; `step` is the time between samples, `longest` the duration of the longest piece, s."""
        keys = [parameter.key for parameter in self.operator.parameters]
        if len(keys) == 1:
            given = getattr(self, keys[0])
            if given is None and self.operator.spread is not None:
                given = self.operator.spread(getattr(self, "count", 1), step, longest)
            return [(number,) for number in given]
        return [tuple(number for key in keys if (number := getattr(self, key)) is not None)]

    @model_validator(mode="after")
    def _complete(self) -> OperatorFamily:
        name, parameters = self.operator.name, self.operator.parameters
        if self.operator.spread is not None and (getattr(self, parameters[0].key) is None) == (getattr(self, "count", None) is None):
            key, example = parameters[0].key, parameters[0].example
            raise contradiction(f"`{name}` takes either `{key}` or `count`", f"give one of both, as `{key}: [{example}]`", "count", "of")
        missing = [parameter.key for parameter in parameters if getattr(self, parameter.key) is None]
        if len(parameters) > 1 and 0 < len(missing) < len(parameters):
            remedy = f"add `{missing[0]}`, or leave all out: training then finds them"
            raise contradiction(f"`{name}` lacks `{missing[0]}`", remedy, *(parameter.key for parameter in parameters))
        return self


def _number(parameter: Parameter) -> Any:
    bounds = Field(gt=0) if parameter.below == float("inf") else Field(gt=0, lt=parameter.below)
    return Annotated[float, bounds, WithUnit(lambda _, unit=parameter.unit: unit)]  # type: ignore[misc]


def _fields(operator: Operator) -> dict[str, Any]:
    parameters = operator.parameters
    if len(parameters) != 1:
        default = None if operator.needs == "oscillator" else ...
        return {one.key: (_number(one) | None if default is None else _number(one), default) for one in parameters}
    many = Annotated[list[_number(parameters[0])], Field(min_length=1)]  # type: ignore[misc, valid-type]
    if operator.spread is None:
        return {parameters[0].key: (many, ...)}
    return {parameters[0].key: (many | None, None), "count": (Count | None, None)}


def _form(key: str, operator: Operator) -> type[OperatorFamily]:
    form = create_model(key.title(), __base__=OperatorFamily, __doc__=operator.summary, __module__=__name__, **_fields(operator))
    form.operator = operator
    return form


FORMS: Mapping[str, type[OperatorFamily]] = {key: _form(key, operators[0]) for key, operators in families().items()}
"""The form of each family by its key."""
