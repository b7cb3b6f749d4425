"""What a free run needs of a model at every sample, taken apart beforehand."""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.memory import MemoryModel
from mapmore_cli.modelling.terms import Expression, Name, evaluate, multiply, parse, to_text
from mapmore_cli.modelling.terms.syntax import ONE, Power, Product

Delayed = list[float]
"""Delayed outputs at one sample, scaled as the model's states are."""

Own = Callable[[Delayed], float]
"""The part of a term that depends on delayed outputs."""


@dataclass(frozen=True)
class Feedback:
    """`y[k] = base[k] + sum_m weights_m[k] own_m(delayed outputs at k)`: terms with the same own part share one weight.

    Attributes
    ----------
    base
        (n,) the terms of inputs alone, and the constant.
    own, weights
        Parts of delayed outputs, and (n,) what each is multiplied with.
    lags
        Steps of the delayed outputs.
    limits
        Lower end, width and least and greatest value of each delayed output's scale; None where states are not scaled.
    """

    base: list[float]
    own: tuple[Own, ...]
    weights: tuple[list[float], ...]
    lags: tuple[int, ...]
    limits: tuple[tuple[float, float], ...] | None
    margin: float

    def delayed(self, past: list[float]) -> Delayed:
        """The delayed outputs, given all outputs so far."""
        outputs = [past[-lag] for lag in self.lags]
        if self.limits is None:
            return outputs
        least, greatest = -self.margin, 1 + self.margin
        return [min(max((y - low) / width, least), greatest) for y, (low, width) in zip(outputs, self.limits, strict=True)]


def fed_back(model: MemoryModel, lags: Mapping[str, int], driven: Columns, n: int) -> Feedback:
    """The model along one piece of n samples.

    Parameters
    ----------
    lags
        Steps of the delayed outputs, by the names of their states.
    driven
        The states of inputs alone, (n,) each.
    """
    places = {name: place for place, name in enumerate(lags)}
    base, weights = np.full(n, model.constant), dict[Expression, Array]()
    for text, theta in zip(model.terms, model.theta, strict=True):
        own, inputs = parted(parse(text), places)
        weight = float(theta) * evaluate(inputs, driven, n)
        if own == ONE:
            base += weight
        else:
            weights[own] = weights.get(own, 0.0) + weight
    return Feedback(
        base.tolist(),
        tuple(compiled(own, places) for own in weights),
        tuple(weight.tolist() for weight in weights.values()),
        tuple(lags.values()),
        tuple(_limits(model, name) for name in lags) if model.states.scaled else None,
        model.states.margin,
    )


def _limits(model: MemoryModel, name: str) -> tuple[float, float]:
    """Lower end and width of a state's training range; an infinite width, and so zero, where it stood still."""
    place = model.states.names.index(name)
    low, high = float(model.states.low[place]), float(model.states.high[place])
    return low, high - low if high > low else math.inf


def parted(term: Expression, delays: Container[str]) -> tuple[Expression, Expression]:
    """A term as (part of delayed outputs) times (part of inputs).

    Raises
    ------
    DataError
        Where one factor has both: its value at every sample could not be prepared.
    """
    fed: list[Expression] = []
    inputs: list[Expression] = []
    for factor in term.factors if isinstance(term, Product) else (term,):
        own = [name for name in factor.names if name in delays]
        if own and len(own) < len(factor.names):
            raise DataError(
                f"the term `{to_text(term)}` has delayed outputs and inputs in one factor, `{to_text(factor)}`",
                "write it as a product of a part with delayed outputs and a part with inputs",
            )
        (fed if own else inputs).append(factor)
    return multiply(*fed), multiply(*inputs)


def compiled(expression: Expression, places: Mapping[str, int]) -> Own:
    """`expression` of delayed outputs as a function of their list; products of few delays, the usual case, are the quickest.

    Values that are not finite come out as such.
    """
    factors = _monomial(expression, places)
    match factors:
        case [i]:
            return lambda y: y[i]
        case [i, j]:
            return lambda y: y[i] * y[j]
        case [i, j, *rest]:
            return lambda y: math.prod([y[place] for place in rest], start=y[i] * y[j])
    return _computed(expression, places)


def _monomial(expression: Expression, places: Mapping[str, int]) -> list[int]:
    """Places of the factors of a product of powers of delayed outputs, each as often as it stands; empty for anything else."""
    match expression:
        case Name(name):
            return [places[name]]
        case Power(Name(name), exponent) if exponent > 0 and exponent.is_integer():
            return [places[name]] * int(exponent)
        case Product(factors):
            each = [_monomial(factor, places) for factor in factors]
            return [place for one in each for place in one] if all(each) else []
    return []


def _computed(expression: Expression, places: Mapping[str, int]) -> Own:
    names = sorted(expression.names)

    def value(y: Delayed) -> float:
        return float(evaluate(expression, {name: np.array([y[places[name]]]) for name in names}, 1)[0])

    return value
