"""Compute the uncertainty of each sample: the standard deviations that a spec gives, as columns of
the curves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, uncertainty_of
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.units import convert, is_quantity, split_quantity

Rule = float | str | dict[str, float]

LEAST = 1e-3
"""Smallest uncertainty of a sample that is accepted, as a fraction of the median uncertainty of its
curve. A sample with a smaller uncertainty would have the weight of a million other samples.
"""


def with_uncertainty(
    curves: Sequence[Curve], data: Data, units: dict[str, str], measured: str, target: str
) -> tuple[Curve, ...]:
    """Return the curves with an additional column for each quantity in `data.uncertainty`: the
    standard deviation of each sample. The units of these columns are added to `units`. If the
    quantity is `measured`, its column becomes the uncertainty of the `target`, which is computed
    from it.

    Raises DataError for a standard deviation that is missing or not above zero, or that is not
    above 0.001 of the median in its curve.
    """
    for name, rule in data.uncertainty.items():
        column = uncertainty_of(target if name == measured else name)
        units[column] = units[name]
        curves = [
            replace(
                curve,
                columns={
                    **curve.columns,
                    column: _positive_deviation(curve, name, rule, data, units),
                },
            )
            for curve in curves
        ]
    return tuple(curves)


def _positive_deviation(
    curve: Curve, name: str, rule: Rule, data: Data, units: Mapping[str, str]
) -> Array:
    sigma = _deviation(curve, name, rule, data, units)
    median = float(np.median(sigma))
    faulty = np.flatnonzero(~(sigma > LEAST * median))
    if len(faulty):
        row = int(faulty[0])
        raise DataError(
            f"data.uncertainty.{name}: sample {row + 1} of {curve.id} (value "
            f"{curve.columns[name][row]:g}) has the uncertainty {sigma[row]:.3g}; the median "
            f"uncertainty in this curve is {median:.3g}. An uncertainty must not be missing or "
            "almost zero, because the sample would then outweigh all others",
            "if you gave uncertainties by group, give one for each group; if the uncertainty is a "
            "fraction of the value, add a minimum with `derive`, for example "
            f"`sd: sqrt(0.25 + (0.02*{name})^2)`, and name that quantity",
        )
    return sigma


def _deviation(curve: Curve, name: str, rule: Rule, data: Data, units: Mapping[str, str]) -> Array:
    """Return the standard deviation of each sample, (n,). If the spec gives one value for each
    group, samples of a group without a value get NaN.
    """
    if isinstance(rule, dict):
        assert data.groups is not None
        group = curve.columns[data.groups.of]
        return np.select([group == float(value) for value in rule], [*rule.values()], np.nan)
    if isinstance(rule, float):
        return np.full(curve.size, rule)
    if is_quantity(rule):
        return np.abs(curve.columns[name]) * convert(split_quantity(rule)[0], "%", "1")
    # if the column of standard deviations has no unit, its unit is that of the quantity
    unit = units[name] if units[rule] == "1" else units[rule]
    return convert(curve.columns[rule], unit, units[name], difference=True)
