"""Estimate the gain and offset of each group, for example of a session, at equal inputs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Curve, Dataset, Grouping, uncertainty_of
from mapmore_cli.modelling.signals.sampling import even_share

ORDER = 3
"""Order of the polynomial of all inputs that all groups share."""

TOLD_APART = 1e-6
"""Smallest fraction of a group's indicator column that must remain after the part that the
polynomial explains is subtracted. If less remains, the offset of the group cannot be determined.
"""

SPREAD = 0.5
"""Prior standard deviation of the logarithm of a gain: two of three specimens or sessions lie
within a factor of 1.6 of the mean.
"""


@dataclass(frozen=True)
class GroupEffects:
    """Estimated gain and offset of each group. The keys of `gains` and `offsets` are the values of
    the quantity `of`, which distinguishes the groups. A mapping is empty if it was not requested.

    The offsets have mean zero, and so have the logarithms of the gains. `unknown` holds the groups
    without training samples, whose gains and offsets cannot be estimated.
    """

    of: str
    gains: dict[float, float]
    offsets: dict[float, float]
    unknown: tuple[float, ...]

    def removed_from(self, curve: Curve, target: str) -> Curve:
        """Return the curve without the effects of its groups: the target becomes `(y - b_g) /
        gain_g`, and its uncertainty is divided by `gain_g`. Samples of unknown groups are
        unchanged.
        """
        name, raw = uncertainty_of(target), curve.columns[target]
        offset, gain = np.zeros(curve.size), np.ones(curve.size)
        for group in self.gains | self.offsets:
            rows = curve.columns[self.of] == group
            offset[rows] = self.offsets.get(group, 0.0)
            gain[rows] = self.gains.get(group, 1.0)
        columns = {**curve.columns, target: (raw - offset) / gain}
        sigma = curve.columns.get(name)
        if sigma is not None:
            columns[name] = sigma / gain
        return replace(curve, columns=columns, raw_target=raw, raw_uncertainty=sigma)

    def describe(self, target: str, unit: str) -> Iterator[str]:
        """Yield sentences with the gains and the offsets, for the page of the run."""
        unknown = ", ".join(f"{group:g}" for group in self.unknown)
        if self.gains:
            each = ", ".join(f"{group:g}: {gain:.4g}" for group, gain in self.gains.items())
            rest = f"; {unknown} is held out completely and gets a gain of 1" if unknown else ""
            yield f"gains of {self.of}, by which {target} is divided: {each}{rest}"
        if self.offsets:
            each = ", ".join(f"{group:g}: {offset:+.4g}" for group, offset in self.offsets.items())
            rest = (
                f"; for {unknown}, which is held out completely, the offset is not known"
                if unknown
                else ""
            )
            yield (
                f"offsets of {self.of} [{unit}], which are subtracted from {target}: {each}{rest}"
            )


def without_effects(
    curves: Sequence[Curve], grouping: Grouping
) -> tuple[tuple[Curve, ...], GroupEffects]:
    """Estimate the effects of groups on the training samples, and remove them from the curves.
    Return the curves and the effects. Raises the same errors as `group_effects`.
    """
    effects = group_effects(curves, grouping)
    return tuple(effects.removed_from(curve, grouping.target) for curve in curves), effects


def regrouped(dataset: Dataset) -> Dataset:
    """Estimate the effects of groups again for one fold of a cross-validation, from the training
    samples of the fold alone. Return the fold without these effects. Raises the same errors as
    `group_effects`.
    """
    if dataset.grouping is None:
        return dataset
    try:
        curves, _ = without_effects(dataset.raw_curves, dataset.grouping)
    except DataError as error:
        message = f"with a part of the data left out, {error.message}"
        raise DataError(message, error.remedy) from error
    return replace(dataset, curves=curves)


def group_effects(curves: Sequence[Curve], groups: Grouping) -> GroupEffects:
    """Estimate the gain and the offset of each group on training samples: `y = gain_g p(x) + b_g`,
    with `sum_g b_g = 0` and `sum_g log gain_g = 0`.

    `p` is a polynomial of order 3 of all quantities that vary within a group. The quantities in
    `groups.outputs` are not used: the hysteresis, for example, is computed from the force, and is
    therefore proportional to the gain of the force. This is an analysis of covariance: groups are
    compared at equal inputs. If a group was measured at larger strains than the others, for
    example, this difference is not mistaken for an offset.

    The logarithm of a gain has a normal prior with mean zero and standard deviation `SPREAD`. The
    standard deviation of the noise is estimated from fits of a separate polynomial to each group.
    Because of the prior, the gain of a group with few samples, or with small `p`, is near 1.

    Raises
    ------
    DataError
        If inputs and groups are so correlated that an offset cannot be distinguished from the
        effect of the inputs.
    """
    group, y, inputs = _training(curves, groups)
    values, member = np.unique(group, return_inverse=True)
    names = [
        name for name in inputs if any(np.ptp(inputs[name][group == value]) > 0 for value in values)
    ]
    basis = np.linalg.svd(
        _polynomial([inputs[name] for name in names], len(y)), full_matrices=False
    )
    common = basis.U[:, TOLD_APART * basis.S[0] < basis.S]
    # the offset of the last group is minus the sum of the others, so that the mean is zero
    coded = np.vstack([np.eye(len(values) - 1), -np.ones(len(values) - 1)])
    if groups.offset:
        _require_apart(common, coded[member], groups.of, names)
    table = np.column_stack([common, np.ones(len(y)), y])
    problem = _GroupFit([table[group == value] for value in values], coded, groups.offset)
    gains = np.exp(problem.log_gains()) if groups.gain else np.ones(len(values))
    offsets = coded @ problem.solved(gains)[0][common.shape[1] :] if groups.offset else np.zeros(0)
    every = np.unique(np.concatenate([curve.columns[groups.of] for curve in curves]))
    return GroupEffects(
        groups.of,
        dict(zip(values.tolist(), gains.tolist(), strict=True)) if groups.gain else {},
        dict(zip(values.tolist(), offsets.tolist(), strict=True)) if groups.offset else {},
        tuple(value for value in every.tolist() if value not in values),
    )


def _require_apart(common: Array, coded: Array, of: str, names: Sequence[str]) -> None:
    left = coded - common @ (common.T @ coded)
    sizes = np.linalg.svd(left, compute_uv=False)
    if len(sizes) and sizes[-1] < TOLD_APART * np.linalg.norm(coded):
        raise DataError(
            f"groups: offsets of {of} cannot be separated from the effects of "
            f"{', '.join(names)}, because no two groups were measured at similar inputs",
            "remove `offset`, or add recordings in which two groups have the same values of the "
            "inputs",
        )


class _GroupFit:
    """Least-squares problem for the gains and offsets of the groups.

    Each group has a table of its n_g samples, (n_g, k + 2). The columns are the k terms of the
    polynomial, a column of ones, and the target. Each table is replaced by the triangular factor R
    of its QR decomposition, which has the same sums of squares but at most k + 2 rows.
    """

    def __init__(self, tables: Sequence[Array], coded: Array, offset: bool) -> None:
        triangles = [np.linalg.qr(table).R for table in tables]
        rows = np.vstack(triangles)
        self.polynomials, self.target, self.coded = rows[:, :-2], rows[:, -1], coded
        self.group = np.repeat(np.arange(len(tables)), [len(triangle) for triangle in triangles])
        self.offsets = rows[:, [-2]] * coded[self.group] if offset else np.empty((len(rows), 0))
        free = [max(len(table) - table.shape[1] + 1, 0) for table in tables]
        alone = sum(triangle[-1, -1] ** 2 for triangle, n in zip(triangles, free, strict=True) if n)
        scatter = np.sqrt(alone / sum(free)) if any(free) else 0.0
        self.scatter = max(scatter, TOLD_APART * float(np.abs(self.target).max()))

    def solved(self, gains: Array) -> tuple[Array, Array]:
        """Return the least-squares solution for given gains, and the residuals, (n,). The solution
        holds the coefficients of the polynomials and the coded offsets (the offset of the last
        group is minus the sum of the others).
        """
        design = np.hstack([gains[self.group, None] * self.polynomials, self.offsets])
        solution = np.asarray(np.linalg.lstsq(design, self.target, rcond=None)[0], dtype=float)
        return solution, self.target - design @ solution

    def log_gains(self) -> Array:
        """Return the logarithm of the gain of each group. These gains have the largest posterior
        probability.
        """
        # imported here because the import would cost every run without groups half a second
        from scipy.optimize import least_squares

        def unlikely(free: Array) -> Array:
            logs = self.coded @ free
            left = self.solved(np.exp(logs))[1]
            return np.concatenate([left / self.scatter, logs / SPREAD])

        start = np.zeros(self.coded.shape[1])
        return self.coded @ (least_squares(unlikely, start).x if start.size else start)


def _training(curves: Sequence[Curve], groups: Grouping) -> tuple[Array, Array, dict[str, Array]]:
    """Return the group, the target and all inputs of the training samples, (n,) each. If there are
    many samples, an evenly spread part of them is returned.
    """
    uncertainties = {uncertainty_of(name) for name in curves[0].columns}
    not_inputs = (uncertainties | {"time", *groups.outputs}) - {groups.target}
    columns = {
        name: even_share(np.concatenate([curve.columns[name][curve.training] for curve in curves]))
        for name in curves[0].columns
        if name not in not_inputs
    }
    usable = np.logical_and.reduce([np.isfinite(values) for values in columns.values()])
    columns = {name: values[usable] for name, values in columns.items()}
    return columns.pop(groups.of), columns.pop(groups.target), columns


def _polynomial(inputs: Sequence[Array], size: int) -> Array:
    """Return products of up to three inputs, each scaled to -1 ... 1, shape (n, k)."""
    scaled = [2 * (x - x.min()) / np.ptp(x) - 1 for x in inputs]
    products = [np.ones(size)]
    for order in range(1, ORDER + 1):
        products += [
            np.prod(factors, axis=0) for factors in combinations_with_replacement(scaled, order)
        ]
    return np.stack(products, axis=1)
