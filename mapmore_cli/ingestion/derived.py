"""Compute derived quantities, and leave out the samples that violate a condition of the spec."""

from __future__ import annotations

import graphlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray, by_blocks
from mapmore_cli.domain.errors import DataError
from mapmore_cli.fitting.kinds.dictionary import signal_of
from mapmore_cli.ingestion.samples import Samples, located
from mapmore_cli.modelling import expressions as terms
from mapmore_cli.modelling.signals.rates import signal_values
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.logs import Keep


def derived(samples: Samples, data: Data, units: Mapping[str, str]) -> Samples:
    """Add the quantities of `data.derive`. A quantity is computed after the quantities on which it
    depends. Raises DataError for a value that is not finite.
    """
    derive = data.derive
    expressions = {
        name: terms.parse(rule) for name, rule in derive.items() if isinstance(rule, str)
    }
    signals = {
        name: signal_of(name, rule, units)
        for name, rule in derive.items()
        if not isinstance(rule, str)
    }
    ordered = graphlib.TopologicalSorter(data.sources).static_order()
    for name in filter(derive.__contains__, ordered):
        if name in signals:
            with located(samples.label):
                values = signal_values(signals[name], samples.columns)
        else:
            values = _evaluated(expressions[name], samples)
        finite = by_blocks(np.isfinite, values)
        if not finite.all():
            at = int(np.argmin(finite))
            raise DataError(
                f"{samples.at(at)}: derive.{name} gives {values[at]}",
                "Correct the expression or the data.",
            )
        samples = samples.with_columns({name: values})
    return samples


def _evaluated(expression: terms.Expression, samples: Samples) -> Array:
    names = [name for name in samples.columns if name in expression.names] or list(samples.columns)[
        :1
    ]
    columns = [samples.columns[name] for name in names]
    values: Array = by_blocks(
        lambda *part: terms.evaluate(expression, dict(zip(names, part, strict=True)), len(part[0])),
        *columns,
    )
    return values


def kept(samples: Samples, conditions: Sequence[Keep], units: Mapping[str, str]) -> Samples:
    """Return the samples that fulfil all conditions. A sample that is left out is recorded under
    the first condition that it violates.
    """
    for condition in conditions:
        name = condition.quantity
        fulfils, reason = _condition(
            condition, name, "" if units[name] == "1" else f" {units[name]}"
        )
        samples = samples.keep(by_blocks(fulfils, samples.columns[name]), reason)
    return samples


def _condition(condition: Keep, name: str, unit: str) -> tuple[Callable[[Array], BoolArray], str]:
    """Return a function and a text. The function takes values, (n,), of the quantity `name`, and
    returns True for those that fulfil the condition. The text is the reason that is recorded for
    samples that do not, for example `pressure >= 5 kPa`.
    """
    if (limit := condition.abs_below) is not None:
        return lambda values: np.abs(values) < limit, f"|{name}| >= {limit:g}{unit}"
    if (limit := condition.below) is not None:
        return lambda values: values < limit, f"{name} >= {limit:g}{unit}"
    if (limit := condition.above) is not None:
        return lambda values: values > limit, f"{name} <= {limit:g}{unit}"
    if condition.outside is not None:
        low, high = condition.outside
        return (
            lambda values: (values < low) | (values > high),
            f"{name} from {low:g} to {high:g}{unit}",
        )
    low, high = condition.between or (-np.inf, np.inf)
    return (
        lambda values: (values >= low) & (values <= high),
        f"{name} outside {low:g} to {high:g}{unit}",
    )
