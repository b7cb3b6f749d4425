"""Sums of models: dynamic force as a static and a damping model (M2 section 3), the muscles of a pair with their signs (H section II.D)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.models import Model, Part, Sum
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.expressions import Name, parse


def sum_of(name: str, parts: Sequence[Part], output: Quantity, quantities: Mapping[str, Quantity]) -> Model:
    """Return the model `output = sum_m sign_m m(inputs_m)`, a function of every quantity that its parts' inputs are made of.

    Raises SpecError where an output is not in the unit of the sum, or an input is not among the `quantities` in its unit.
    """
    used: set[str] = set()
    for part in parts:
        model = part.model
        if model.output.unit != output.unit:
            raise SpecError(
                f"needs: the model of {model.name} is in {model.output.unit}, the {output.name} of this study in {output.unit}",
                "add up models of one unit",
            )
        for quantity in model.inputs:
            source = parse(part.inputs.get(quantity.name, quantity.name))
            used |= source.names
            missing = sorted(source.names - {*quantities})
            if quantity.name in part.inputs and missing:
                raise SpecError(f"the sum: there is no quantity {missing[0]} for {quantity.name} of {model.name}", "declare its column")
            other = quantities.get(source.name) if isinstance(source, Name) else None
            if quantity.name in part.inputs:
                if other is not None and other.unit != quantity.unit:
                    raise SpecError(
                        f"the sum: {quantity.name} of {model.name} is in {quantity.unit}, {other.name} in {other.unit}",
                        f"set the unit of {other.name} under `units`",
                    )
            elif other != quantity:
                raise SpecError(
                    f"needs: the model of {model.name} is a function of {quantity.name} in {quantity.unit}, which this study lacks",
                    "declare its column, derive it, or set its unit under `units`",
                )
    return Model(
        name=name,
        output=output,
        inputs=tuple(quantities[key] for key in sorted(used)),
        body=Sum(tuple(parts)),
        notes=tuple(f"{part.model.name}: {note}" for part in parts for note in part.model.notes),
    )


def refuse_shared_names(inputs_of: Sequence[tuple[str, Sequence[str], Mapping[str, str]]]) -> None:
    """Raise `SpecError` where two parts of a sum have an input of one name of which nothing is said: two pressures are two quantities.

    `inputs_of` has for every part what it is called, its own inputs, and what is said of them.
    """
    for i, (first, names, said) in enumerate(inputs_of):
        for second, others, of_other in inputs_of[i + 1 :]:
            for name in names:
                if name in others and not (name in said and name in of_other):
                    raise SpecError(
                        f"{first} and {second} both have an input `{name}`",
                        f"write what it is for each, as `inputs: {{{name}: {name}_1}}` and `inputs: {{{name}: {name}_2}}`; "
                        f"where it is one quantity, `inputs: {{{name}: {name}}}` for both",
                    )
