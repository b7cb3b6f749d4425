"""Offsets of groups: what a specimen or a session adds to the target, whatever the inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve

ORDER = 3
"""Of the polynomial of all inputs that groups have in common."""

MOST_SAMPLES = 20_000
"""That offsets are estimated from, of more an even share."""

TOLD_APART = 1e-6
"""Of its size, that must remain of the indicator of a group once the polynomial is taken off."""


@dataclass(frozen=True)
class Offsets:
    """What is taken off the target, by the value of the quantity that tells groups apart; their mean is zero."""

    of: str
    by_group: dict[float, float]
    unknown: tuple[float, ...]

    def taken_off(self, curve: Curve, target: str) -> Curve:
        """Return the curve without the offsets of its samples' groups; those of unknown groups stay."""
        offset = np.zeros(curve.size)
        for value, found in self.by_group.items():
            offset[curve.columns[self.of] == value] = found
        return replace(curve, columns={**curve.columns, target: curve.columns[target] - offset})

    def describe(self, target: str, unit: str) -> str:
        """Return the offsets in words, for the page."""
        each = ", ".join(f"{value:g}: {found:+.4g}" for value, found in self.by_group.items())
        rest = f"; none is known of {', '.join(f'{value:g}' for value in self.unknown)}, held out whole" if self.unknown else ""
        return f"offsets of {self.of} [{unit}] taken off {target}: {each}{rest}"


def offsets_of(curves: Sequence[Curve], of: str, target: str) -> Offsets:
    """Estimate the offset `b_g` of each group on training samples: `y = p(x) + b_g`, with `sum_g b_g = 0`.

    `p` is a polynomial of order 3 of all quantities that vary within a group. This is the analysis of covariance: groups are compared at
    equal inputs, so that one that was measured at other strains is not taken for one with an offset.

    Raises
    ------
    DataError
        Where inputs and groups go together, so that nothing tells an offset from their effect.
    """
    group, y, inputs = _training(curves, of, target)
    values = np.unique(group)
    names = [name for name in inputs if any(np.ptp(inputs[name][group == value]) > 0 for value in values)]
    regressors = _polynomial([inputs[name] for name in names], len(y))
    # the last group is minus the sum of the others: their mean is zero
    coded = 1.0 * (group[:, None] == values[:-1]) - 1.0 * (group == values[-1])[:, None]
    basis = np.linalg.svd(regressors, full_matrices=False)
    common = basis.U[:, TOLD_APART * basis.S[0] < basis.S]
    left = coded - common @ (common.T @ coded)
    sizes = np.linalg.svd(left, compute_uv=False)
    if len(sizes) and sizes[-1] < TOLD_APART * np.linalg.norm(coded):
        raise DataError(
            f"groups: offsets of {of} cannot be told from what {', '.join(names)} do: no two groups were measured at like inputs",
            "leave `offset` out, or add recordings of each group at inputs of another",
        )
    found = np.linalg.lstsq(left, y - common @ (common.T @ y), rcond=None)[0]
    known = dict(zip(values.tolist(), [*found.tolist(), -float(found.sum())], strict=True))
    every = np.unique(np.concatenate([curve.columns[of] for curve in curves]))
    return Offsets(of, known, tuple(value for value in every.tolist() if value not in known))


def _training(curves: Sequence[Curve], of: str, target: str) -> tuple[Array, Array, dict[str, Array]]:
    """Return groups, the target and all other quantities of an even share of the training samples, (n,) each."""
    columns = {name: np.concatenate([curve.columns[name][curve.training] for curve in curves]) for name in curves[0].columns}
    step = -(-len(columns[target]) // MOST_SAMPLES)
    columns = {name: values[::step] for name, values in columns.items()}
    usable = np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
    columns = {name: values[usable] for name, values in columns.items()}
    return columns.pop(of), columns.pop(target), {name: values for name, values in columns.items() if name != "time"}


def _polynomial(inputs: Sequence[Array], size: int) -> Array:
    """(n, k) products of up to three inputs, each of which is brought to -1 ... 1."""
    scaled = [2 * (x - x.min()) / np.ptp(x) - 1 for x in inputs]
    products = [np.ones(size)]
    for order in range(1, ORDER + 1):
        products += [np.prod(factors, axis=0) for factors in combinations_with_replacement(scaled, order)]
    return np.stack(products, axis=1)
