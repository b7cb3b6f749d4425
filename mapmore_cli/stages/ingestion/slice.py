"""What ingest depends on."""

from __future__ import annotations

from typing import Literal

from mapmore_cli.spec.models import Data, ExperimentSpec, Rate, Section, Split
from mapmore_cli.spec.units import default_unit


class IngestSlice(Section):
    """What ingest depends on: the quantity that is `measured`, its `component` to model, and the model's unit of every quantity."""

    data: Data
    measured: str
    component: Literal["static", "hysteresis"]
    units: dict[str, str]


def slice_of(spec: ExperimentSpec) -> IngestSlice:
    """Return the part of the spec that ingest reads; cross-validation is no business of its."""
    return IngestSlice(
        data=spec.data.model_copy(update={"split": Split(validate=spec.data.split.hold_out)}),
        measured=spec.target_quantity,
        component="hysteresis" if spec.target == "hysteresis" else "static",
        units={name: _unit(name, spec) for name in spec.data.quantities},
    )


def _unit(name: str, spec: ExperimentSpec) -> str:
    """Model unit of a quantity; a rate by any name has the unit of its quantity per unit of time."""
    rule = spec.data.derive.get(name)
    if isinstance(rule, Rate) and name not in spec.units:
        return f"{default_unit(rule.rate_of, spec.units)}/{default_unit('time', spec.units)}"
    return default_unit(name, spec.units)
