"""How far each sample may be off: the standard deviations that a spec gives, as columns of the
curves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, uncertainty_of
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.units import convert, split_quantity
from mapmore_cli.storage.spool import by_blocks

SPREAD = 1e-3
"""Of the median of a curve: a sample with a smaller uncertainty would count as much as a million
others.
"""


def with_uncertainty(
    curves: Sequence[Curve], data: Data, units: dict[str, str], measured: str, target: str
) -> tuple[Curve, ...]:
    """Return the curves with the uncertainty of each quantity that has one; its unit is put into
    `units`. That of what was `measured` is the one of the `target` made from it.

    Raises DataError for an uncertainty that is not above zero, or far below others of its curve.
    """
    for name, rule in data.uncertainty.items():
        column = uncertainty_of(target if name == measured else name)
        units[column] = units[name]
        curves = [
            replace(
                curve, columns={**curve.columns, column: _checked(curve, name, rule, data, units)}
            )
            for curve in curves
        ]
    return tuple(curves)


def _checked(curve: Curve, name: str, rule: Any, data: Data, units: Mapping[str, str]) -> Array:
    if isinstance(rule, dict):
        assert data.groups is not None
        group = curve.columns[data.groups.of]
        sigma = np.full(curve.size, np.nan)
        for key, one in rule.items():
            rows = group == float(key)
            sigma[rows] = _deviation(curve, name, one, units)[rows]
    else:
        sigma = _deviation(curve, name, rule, units)
    least = 0.0 if isinstance(rule, float) else SPREAD * float(np.nanmedian(sigma))
    faulty = by_blocks(lambda values: ~(values > least), sigma)
    if faulty.any():
        row = int(np.argmax(faulty))
        where = curve.recordings[0 if curve.origin is None else int(curve.origin[row])]
        raise DataError(
            f"data.uncertainty.{name}: {sigma[row]:.3g} at {name} {curve.columns[name][row]:g} "
            f"({where}, curve {curve.id}); the median of the curve is {np.nanmedian(sigma):.3g}",
            "give each sample an uncertainty, and shares of small values a floor, as "
            f"`[0.5 {units[name]}, 2 %]`",
        )
    return sigma


def _deviation(curve: Curve, name: str, rule: Any, units: Mapping[str, str]) -> Array:
    """Return the standard deviation of each sample, (n,); squares of several add up."""
    if isinstance(rule, list):
        return np.sqrt(sum(_deviation(curve, name, one, units) ** 2 for one in rule))
    if isinstance(rule, float):
        return np.broadcast_to(np.float64(rule), curve.size)
    if rule.endswith("%"):
        share = convert(split_quantity(rule)[0], "%", "1")
        return by_blocks(lambda values: share * np.abs(values), curve.columns[name])
    # a column of one's own, whose unit nobody says, is in that of the quantity
    unit = units[name] if units[rule] == "1" else units[rule]
    return by_blocks(
        partial(convert, source_unit=unit, target_unit=units[name]), curve.columns[rule]
    )
