"""Combine the models of several outputs. Operations that need a single output use the models in
`Model.each`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import BoolArray, Columns
from mapmore_cli.domain.models import Equation, Model, Outputs
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.expressions import Expression
from mapmore_cli.modelling.kinds import Verbs
from mapmore_cli.modelling.program.writing import Inputs, Writer


def outputs_model(name: str, models: Sequence[Model]) -> Model:
    """Return one model that holds the models of all outputs."""
    first = models[0]
    return Model(
        name=name,
        output=first.output,
        inputs=tuple(dict.fromkeys(quantity for model in models for quantity in model.inputs)),
        body=Outputs(tuple(models)),
        signals=tuple(dict.fromkeys(signal for model in models for signal in model.signals)),
        notes=tuple(dict.fromkeys(note for model in models for note in model.notes)),
    )


def _structure(model: Model) -> tuple[object, ...]:
    segments = () if model.pieces is None else model.pieces.segments
    cells = [(segment.id, segment.cell) for segment in segments]
    return type(model.body), model.level, *cells


class OutputsVerbs(Verbs):
    """Operations of a model of several outputs. An operation for a single output raises
    UsageError.
    """

    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Raise UsageError if there are several outputs; otherwise, predict the only output."""
        return kinds.simulate(kinds.alone(model), columns)

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Raise UsageError if there are several outputs; otherwise, write the only output."""
        return kinds.verbs_of(model).write(m, kinds.alone(model), inputs)

    def outside_range(self, model: Model, columns: Columns) -> BoolArray:
        """Return True for rows at which an input lies outside the training range of any output,
        shape (n,).
        """
        beyond: BoolArray = np.logical_or.reduce(
            [kinds.outside_range(part, columns) for part in model.each]
        )
        return beyond

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the equations of every output, with the name of the output added."""
        return tuple(
            replace(row, id=f"{part.output.name}: {row.id}")
            for part in model.each
            for row in kinds.equations(part, units)
        )

    def rules(self, model: Model) -> tuple[str, ...]:
        """Return sentences that say how the equations are combined. They are the same for all
        outputs.
        """
        return tuple(dict.fromkeys(rule for part in model.each for rule in kinds.rules(part)))

    def parameters(self, model: Model) -> int:
        """Return the number of parameters of all outputs together."""
        return sum(map(kinds.parameters, model.each))

    def faults(self, model: Model) -> Iterator[str]:
        """Yield a sentence for each fault of a stored model. A model with a fault is refused."""
        each = model.each
        names = [part.output.name for part in each]
        if len(names) < 2 or len({*names}) < len(names) or model.output != each[0].output:
            yield "it does not have at least two outputs with different names"
        if any(isinstance(part.body, Outputs) for part in each):
            yield "one of its outputs is itself a model of several outputs"
        if {*model.inputs} != {quantity for part in each for quantity in part.inputs}:
            yield "its inputs are not those of the models of its outputs"
        if len({_structure(part) for part in each}) > 1:
            yield "its outputs do not share their segments"
