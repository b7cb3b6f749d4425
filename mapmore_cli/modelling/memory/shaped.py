"""Fit a model with memory so that its static gain has a known sign.

If the inputs are constant for a long time, the states of all operators become constant. If the
model has no delayed outputs, its output at rest is linear in the coefficients. The coefficients are
then fitted with the sign as a constraint, by the same method as for a static model
(`shape.exchange`). The sign is only checked if the model has delayed outputs, estimated parameters
of operators, or a ridge.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.declared import Word
from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.domain.models import Memory, Model
from mapmore_cli.domain.recording import Curve
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.frols.engine import triangle
from mapmore_cli.modelling.frols.moments import Blocks, weighted
from mapmore_cli.modelling.kinds import fed_back, settled
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.memory.selectors import regressors
from mapmore_cli.modelling.selection import MemoryRecipe
from mapmore_cli.modelling.shape.exchange import Exchange
from mapmore_cli.modelling.shape.region import Region, region_of
from mapmore_cli.modelling.shape.stencils import ShapeWord, asked_of
from mapmore_cli.modelling.shape.violations import CLEARLY, verified, violations, with_shape

OTHER: Mapping[Word, Word] = MappingProxyType(
    {"increasing": "decreasing", "decreasing": "increasing"}
)
"""Opposite of each sign of a gain."""

VANISHED = 1e-3
"""A static gain is zero if the output at rest changes by less than this fraction of its change in
the fit without the required sign.
"""

REMEDY = (
    "this condition can be imposed only on a model without delays of the output, without "
    "free operator parameters and without `ridge`: give the numbers, or remove the condition"
)


def with_signed_gain(
    model: Model,
    fit: MemoryFit,
    curves: Sequence[Curve],
    records: Sequence[Record],
    recipe: MemoryRecipe,
) -> Model:
    """Return the model, fitted again if necessary, so that its static gains have the signs that the
    recipe requires.

    `records` are the pieces of recordings to which the model was fitted. Raises FitError if the
    chosen terms cannot have these signs with any coefficients, or if the signs can only be checked
    and are wrong.
    """
    memory = fit.model
    body = model.body_of(Memory)
    region = region_of(model, curves, recipe)
    if region is None or fed_back(model) or fit.identified or recipe.ridge:
        return verified(model, curves, recipe, "static gain", REMEDY)
    terms = [parse(text) for text in memory.terms]
    data = regressors(records, memory.states, terms, memory.output)
    blocks: Blocks = data.blocks
    blocks = blocks if data.uncertainty is None else weighted(blocks, data.uncertainty)
    R = triangle(blocks)[0][: len(terms)]

    def with_coefficients(theta: Array) -> Model:
        errors = memory.theta_error if theta is memory.theta else np.full(len(theta), np.nan)
        kept = replace(memory, theta=theta, theta_error=errors)
        return replace(model, body=replace(body, model=kept))

    exchange = Exchange(
        model,
        lambda theta, columns: settled(with_coefficients(theta), columns),
        memory.theta,
        R,
        (R[:0], R[:0, 0]),
    )
    exchange.until_kept(region.asks(asked_of(recipe)), region)
    kept = with_coefficients(exchange.theta)
    shaped = with_shape(model, kept, curves, region, recipe, exchange.where())
    return replace(shaped, notes=(*shaped.notes, *_warnings_of_zero_gain(shaped, region)))


def _warnings_of_zero_gain(shaped: Model, region: Region) -> Iterator[str]:
    """Yield a warning for each required sign with which the static gain has become zero. This
    happens if the fit without the required sign has a gain of the opposite sign. If the required
    sign also makes the training error clearly larger, FitError is raised, because the sign is
    wrong.
    """
    shape = shaped.shape
    assert shape is not None
    for kept in shape.kept:
        other = OTHER.get(kept.word)
        if other is None or not kept.violated:
            continue
        (left,) = violations(shaped, [ShapeWord(kept.quantity, other)], region)
        if left.amount > VANISHED * kept.violated:
            continue
        sentence = (
            f"fit.shape: `{kept.quantity}: {kept.word}` makes the static gain zero, because "
            f"without this sign, the output at rest changes by {kept.violated:.3g} "
            f"{shaped.output.unit} in the other direction"
        )
        if shape.training > CLEARLY * shape.training_without:
            raise FitError(
                f"{sentence}, and without it, the training error is "
                f"{shape.training / shape.training_without:.3g} times smaller",
                f"write `{kept.quantity}: {other}` if this is right, or remove the sign",
            )
        yield sentence
