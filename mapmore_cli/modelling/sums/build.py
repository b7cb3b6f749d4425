"""Dynamic force as the sum of a static and a damping model (M2 section 3)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.models import Model, Part, Sum
from mapmore_cli.domain.recording import Quantity


def sum_of(name: str, models: Sequence[Model], output: Quantity, quantities: Mapping[str, Quantity]) -> Model:
    """The model `output = sum_m m(inputs)`, a function of every input of its summands.

    Raises
    ------
    SpecError
        Where an output is not in the unit of the sum, or an input is not among the `quantities` in its unit.
    """
    for model in models:
        if model.output.unit != output.unit:
            raise SpecError(
                f"needs: the model of {model.name} is in {model.output.unit}, the {output.name} of this study in {output.unit}",
                "add up models of one unit",
            )
        for quantity in model.inputs:
            if quantities.get(quantity.name) != quantity:
                raise SpecError(
                    f"needs: the model of {model.name} is a function of {quantity.name} in {quantity.unit}, which this study lacks",
                    "declare its column, derive it, or set its unit under `units`",
                )
    inputs = {quantity.name: quantity for model in models for quantity in model.inputs}
    return Model(
        name=name,
        output=output,
        inputs=tuple(inputs[key] for key in sorted(inputs)),
        body=Sum(tuple(map(Part, models))),
        notes=tuple(f"{model.name}: {note}" for model in models for note in model.notes),
    )
