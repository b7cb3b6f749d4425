"""From a fit with memory to a model that stands alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mapmore_cli.domain.fits import FormulaFit, SegmentedCurve
from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.domain.models import CurveFunction, Fusion, Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.memory.resolution import memory_inputs


def model_with_memory(
    name: str,
    memory: MemoryModel,
    backbone: FormulaFit | None,
    training: Sequence[SegmentedCurve],
    quantities: Mapping[str, Quantity],
) -> Model:
    """A model with memory, on the backbone that it was fitted on; the `training` curves say the range of the inputs."""
    formula = () if backbone is None else literature.get(backbone.name).inputs
    inputs = sorted({*memory_inputs(memory), *formula})
    curves = tuple(CurveFunction(c.curve, c.level, (), {name: c.limits[name] for name in inputs}, ()) for c in training)
    return Model(
        name=name,
        output=quantities[memory.output],
        inputs=tuple(quantities[name] for name in inputs),
        level=None,
        variables=(),
        curves=curves,
        fusion=Fusion("linear", 0.0, {}),
        backbone=backbone,
        memory=memory,
    )
