"""Models that are added up, as a static and a damping model (M2 section 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from mapmore_cli.domain.arrays import Number
from mapmore_cli.domain.declared import QuantityName, TermName
from mapmore_cli.domain.models import Body, Model
from mapmore_cli.modelling.kinds import Kind


@dataclass(frozen=True)
class Part:
    """A model in a sum.

    An input may be the output of another model, as the pressure behind a valve: that of a part in
    `fed`, by its name.
    """

    model: Annotated[Model, "the model"]
    sign: Annotated[Number, "+1 or -1: how its output counts"] = 1.0
    inputs: Annotated[
        Mapping[QuantityName, TermName],
        "its inputs that have another name in the sum, as expressions of the sum's inputs",
    ] = field(default_factory=dict)
    fed: Annotated[tuple[Part, ...], "models whose outputs are inputs of this one"] = ()

    @property
    def models(self) -> tuple[Model, ...]:
        """The model, and those that feed it."""
        return (self.model, *(model for part in self.fed for model in part.models))


@dataclass(frozen=True)
class Sum(Body):
    """Models that are added up."""

    parts: Annotated[tuple[Part, ...], "the summands, with their signs and inputs"]

    @property
    def models(self) -> tuple[Model, ...]:
        """The summands, and what feeds them."""
        return tuple(model for part in self.parts for model in part.models)


KIND = Kind("sum", Sum, None, __name__, fitted=f"{__name__}.fitted")
