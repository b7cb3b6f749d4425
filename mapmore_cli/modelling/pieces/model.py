"""Predict with a model of fused pieces (MAPMORE). Return its training range and its equations."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.models import CurveFunction, Equation, Model, Pieces, SegmentFunction
from mapmore_cli.domain.results import SimulatedRun
from mapmore_cli.modelling.equations import equation
from mapmore_cli.modelling.expressions import Expression, parse
from mapmore_cli.modelling.expressions.syntax import names_in
from mapmore_cli.modelling.kinds import Verbs
from mapmore_cli.modelling.literature.model import (
    backbone_values,
    formula_equations,
    formula_value,
    where_finite,
)
from mapmore_cli.modelling.pieces.definition import (
    held_between,
    pieces_program,
    pieces_value,
    rule_of_weights,
    zones_of,
)
from mapmore_cli.modelling.pieces.levels import rule_of_levels
from mapmore_cli.modelling.program.values import evaluator
from mapmore_cli.modelling.program.writing import Inputs, Writer, limit

OUTSIDE = {
    "continue": "the equations continue",
    "saturate": "it is held at the limit",
    "continue_linear": "the equations continue as straight lines with their slope at the limit",
    "zero": "the pieces are 0",
}
OUTER_LEVEL = {
    "continue": "only the outermost curve counts",
    "saturate": "only the outermost curve counts, at its level",
    "continue_linear": "the curves continue with their slope at the outermost level",
    "zero": "the pieces are 0",
}
"""Sentences that say how a model continues outside the outermost levels, as `definition` writes it.
"""


@lru_cache(maxsize=8)
def _ready(body: Pieces, names: tuple[str, ...]) -> Callable[[Columns], list[Array]]:
    """Return the pieces, prepared for evaluation. The result is kept, because preparing it takes
    ten times as long as predicting a few rows.
    """
    return evaluator(pieces_program(body, names))


def _weight(
    segment: SegmentFunction, curve: CurveFunction, body: Pieces, units: Mapping[str, float]
) -> str:
    """Return a text about one segment: at which values of the inputs its weight rises and falls,
    and outside which values its function is constant.
    """
    words = []
    held = held_between(segment, curve, body)
    for (name, ends), place in zip(zones_of(curve, body).items(), segment.cell, strict=True):
        ways = np.array(ends).T / units.get(name, 1.0)
        changes = [
            f"{verb} {start:.6g} to {end:.6g}"
            for verb, at in (("rises", place - 2), ("falls", place - 1))
            if 0 <= at < len(ways)
            for start, end in [ways[at]]
        ]
        sides = zip(("below", "above"), held.get(name, ()), strict=False)
        changes += [f"held {s} {v / units.get(name, 1.0):.6g}" for s, v in sides if v is not None]
        words += [f"{name} {', '.join(changes)}"] if changes else []
    return "; ".join(words)


class PiecesVerbs(Verbs):
    """Operations of a model of fused pieces."""

    def simulate(self, model: Model, columns: Columns) -> SimulatedRun:
        """Return `backbone(inputs) + sum_i f_i(E(x)) prod_j w_ij(E(x_j))` at every row, shape (n,);
        NaN if an input is NaN. The sum is that of M2 eq 9, except that the weights are evaluated at
        E(x) too. Inside the limits, it is M1 eq 5.
        """
        body = model.body_of(Pieces)
        names = model.input_names
        pieces = _ready(body, names) if body.segments else None

        def value(inputs: dict[str, Array], n: int) -> Array:
            base = backbone_values(body.backbone, inputs, n)
            return base if pieces is None else base + pieces(inputs)[0]

        return SimulatedRun(where_finite(model.inputs, columns, value))

    def equations(self, model: Model, units: Mapping[str, float]) -> tuple[Equation, ...]:
        """Return the equation of the backbone, then the equation of every segment function, in the
        model's units or in other units.
        """
        body = model.body_of(Pieces)
        pieces = (
            equation(
                segment.id,
                segment.terms,
                segment.theta,
                segment.scaling,
                {**curve.limits, **segment.limits},
                units,
                weight=_weight(segment, curve, body, units),
            )
            for curve in body.curves
            for segment in curve.segments
        )
        return *formula_equations(body.backbone, units), *pieces

    def rules(self, model: Model) -> Iterator[str]:
        """Yield sentences that say how the pieces are joined, and which rule applies outside the
        limits (M2 eq 9-12).
        """
        body = model.body_of(Pieces)
        level = body.level
        if not body.segments:
            return
        if body.backbone is not None:
            yield f"{model.output.name} is {body.backbone.name} plus the pieces."
        if any(len(ends) > 2 for curve in body.curves for ends in curve.boundaries):
            yield rule_of_weights(body)
        if level is not None and len(body.curves) > 1:
            yield rule_of_levels(body)
        for name, sides in body.fusion.extrapolation.items():
            known = OUTER_LEVEL if name == level else OUTSIDE
            below, above = (known.get(str(side), f"it is taken to be {side}") for side in sides)
            both_sides = f"below its limits {below}, above {above}"
            yield f"{name}: {f'beyond its limits {below}' if below == above else both_sides}."

    def parameters(self, model: Model) -> int:
        """Return the number of coefficients of all segments plus the parameters of the backbone."""
        body = model.body_of(Pieces)
        return sum(len(segment.theta) for segment in body.segments) + (
            0 if body.backbone is None else len(body.backbone.parameters)
        )

    def write(self, m: Writer, model: Model, inputs: Inputs) -> Expression:
        """Write the pieces and their backbone as statements of a program, and return the output."""
        body = model.body_of(Pieces)
        limit(m, body.ranges, body.level, inputs)
        base = formula_value(m, body.backbone, inputs)
        if not body.segments:
            return base
        return m.let(
            "model",
            base + pieces_value(m, body, {name: inputs[name] for name in model.input_names}),
        )

    def faults(self, model: Model) -> Iterator[str]:
        """Yield a sentence for each fault of a stored model that its predictions would not show."""
        levels = np.array([curve.level for curve in model.body_of(Pieces).curves], dtype=np.float64)
        if model.level is not None and not (
            np.isfinite(levels).all() and (np.diff(levels) > 0).all()
        ):
            yield "the levels of its curves do not increase"
        for segment in model.body_of(Pieces).segments:
            if not names_in(map(parse, segment.terms)) <= {*segment.scaling.variables}:
                yield f"the terms of {segment.id} use other quantities than its scaling"
