"""What ingest depends on."""

from __future__ import annotations

from typing import Literal

from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.fields import Section
from mapmore_cli.spec.sections.data import Data, Split
from mapmore_cli.stages.kinds.signals import derivations_of, units_of


class IngestSlice(Section):
    """What ingest depends on: the quantity that is `measured`, its `component` to model, and the model's unit of every quantity.

    `static` is the spec of the run whose model leaves the damping force.
    """

    data: Data
    measured: str
    component: Literal["static", "hysteresis", "damping"]
    units: dict[str, str]
    static: str | None = None


def slice_of(spec: ExperimentSpec) -> IngestSlice:
    """Return the part of the spec that ingest reads; cross-validation is no business of its."""
    split = Split(validate=spec.data.split.hold_out)
    component: Literal["static", "hysteresis", "damping"] = "static"
    if spec.target in ("hysteresis", "damping"):
        component = "hysteresis" if spec.target == "hysteresis" else "damping"
    return IngestSlice(
        data=spec.data.model_copy(update={"split": split, "derive": derivations_of(spec)}),
        measured=spec.target_quantity,
        component=component,
        units=units_of(spec),
        static=spec.needs.static if component == "damping" else None,
    )
