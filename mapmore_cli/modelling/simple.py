"""Fit simple competitors that need no knowledge of muscles. They are polynomials in the inputs of a
model, and a linear model with past outputs and inputs (ARX) in free run.

Reviewers often ask for these, because they can be fitted in any study.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from mapmore_cli.domain.arrays import (
    Array,
    Ends,
    IntArray,
    by_blocks,
    in_blocks,
    picked,
    row_numbers,
    rows_where,
    stacked,
)
from mapmore_cli.domain.fits import MemoryModel, Scaling, StateSet
from mapmore_cli.domain.models import CurveFunction, Memory, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.memory.records import sampled
from mapmore_cli.modelling.signals.sampling import even_share

# total degree of each polynomial; it has all monomials up to this degree
DEGREES = {
    "plane": 1,
    "quadratic": 2,
    "cubic": 3,
}
SIMPLE: Mapping[str, str] = {name: name.capitalize() for name in (*DEGREES, "backbone")} | {
    "arx": "ARX"
}
"""The simple competitors with their titles. Every validation has those that its model allows."""

# orders that are tried for the ARX; the order with the best free run on training data is used
ORDERS = (1, 2, 4, 8)
# largest number of training rows of a fit; if there are more, an evenly spread part is used
MOST_ROWS = 50_000
LARGEST = 1e3  # a free run has diverged if it exceeds the largest measured output by this factor


AT_REST = (
    "The score is that of a run that begins at rest, as if the first measured output and the first "
    "inputs had always been there. So it needs one measured output, and predicts the first samples "
    "as well."
)
"""Note about an ARX, because a stored model with memory begins with as many measured outputs as it
has delays.
"""

Rows = tuple[Array, Array]
"""Inputs, (n, m), and outputs, (n,), to which a polynomial is fitted."""


def training_rows(dataset: Dataset, names: Sequence[str]) -> Rows:
    """Return the inputs and outputs of all training samples whose values are finite. They are
    sorted by value, so that the order of the samples has no influence, and thinned evenly if there
    are many.
    """
    *inputs, y = _training_samples(dataset, [*names, dataset.target])
    x = np.column_stack(inputs)
    known = np.isfinite(x).all(axis=1) & np.isfinite(y)
    x, y = x[known], y[known]
    # sorted rows, so that their order in the file cannot change a digit of the fit
    order = np.lexsort([y, *x.T])
    return even_share(x[order], MOST_ROWS), even_share(y[order], MOST_ROWS)


@dataclass(frozen=True)
class Polynomial:
    """A polynomial in the quantities `names`, (m,), each shifted by its `middle` and divided by its
    `half` range, with a coefficient in `theta`, (k,), for every monomial up to a total degree.
    """

    names: Sequence[str]
    degree: int
    middle: Array
    half: Array
    theta: Array

    def __call__(self, *at: Array) -> Array:
        """Return the values of the polynomial, shape (n,), at the given values of its quantities,
        (n,) each.
        """
        ends = zip(at, self.middle, self.half, strict=True)
        return self.theta @ _monomials([(x - m) / h for x, m, h in ends], self.degree)

    def of_curves(self, dataset: Dataset) -> list[Array]:
        """Return the values of the polynomial at the samples of every curve, shape (n_c,) each."""
        return [
            by_blocks(self, *(curve.columns[n] for n in self.names)) for curve in dataset.curves
        ]

    def as_pieces(self) -> Pieces:
        """Return the polynomial as a model of one piece. Its inputs are scaled to -1 and 1 at the
        ends of their training ranges.
        """
        terms = [
            "*".join(f"{self.names[i]}^{of.count(i)}" for i in dict.fromkeys(of)) or "1"
            for of in _powers(len(self.names), self.degree)
        ]
        unknown = np.full(len(terms), np.nan)
        ends = zip(
            (self.middle - self.half).tolist(), (self.middle + self.half).tolist(), strict=True
        )
        limits = dict(zip(self.names, ends, strict=True))
        slope, intercept = 1 / self.half, -self.middle / self.half
        scaling = Scaling("middle", "-", tuple(self.names), slope, intercept, 1.0, 0.0)
        cell = (1,) * len(self.names)
        segment = SegmentFunction(
            *(self.theta, unknown, unknown, unknown, 0, math.nan, "all"),
            *("polynomial", cell, tuple(terms), scaling, limits),
        )
        boundaries = tuple(np.array(limits[name]) for name in self.names)
        curve = CurveFunction("all", None, limits, boundaries, (segment,))
        return Pieces.of_one(curve)


@dataclass(frozen=True)
class Arx:
    """ARX model `y[k] = c + sum a_i y[k-i] + sum b_j u[k-j]` with the target y and the inputs u in
    `names`. `theta` holds c, then `order` coefficients of past outputs, and then `order + 1`
    coefficients of each input.
    """

    target: str
    names: Sequence[str]
    order: int
    theta: Array

    def as_memory(self, curves: Sequence[Curve], limits: Ends) -> Memory:
        """Return the ARX model as a model with memory. Its time step is the time between samples of
        the `curves`. A free run is NaN from the sample at which it is far outside the `limits` of
        the target.

        A free run of this model begins with `order` measured outputs, but the free run from which
        the scores are computed (`arx`) begins at rest. Both follow the same equation, so that they
        agree as soon as the effect of the different beginnings has decayed.
        """
        steps = range(1, self.order + 1)
        past = [f"{self.target}[k-{i}]" for i in steps]
        past += [
            regressor
            for name in self.names
            for regressor in (name, *(f"{name}[k-{i}]" for i in steps))
        ]
        none, unknown = np.empty(0), np.full(len(past), np.nan)
        step, uneven, _ = sampled(curves, ordered=True)
        states = StateSet(tuple(past), step, {}, {}, none, none, 0.0, uneven)
        theta, constant = self.theta[1:], float(self.theta[0])
        memory = MemoryModel(self.target, states, tuple(past), theta, unknown, constant, limits)
        return Memory(memory, ())


def polynomial_fit(
    degree: int, dataset: Dataset, names: Sequence[str], rows: Rows | None = None
) -> Polynomial | None:
    """Return the least-squares polynomial in the quantities `names`.

    Inputs are scaled to [-1, 1] on the training samples. If the training samples do not determine
    all coefficients, the solution with the smallest norm is used. The polynomial is fitted to
    `rows`, by default the `training_rows`. The result is None if there are fewer rows than
    coefficients, or no inputs.
    """
    if not names:
        return None
    x, y = rows or training_rows(dataset, names)
    if len(y) < comb(len(names) + degree, degree):
        return None
    low, high = x.min(axis=0), x.max(axis=0)
    middle, half = (low + high) / 2, np.where(high > low, (high - low) / 2, 1.0)
    table = _monomials(((x - middle) / half).T, degree).T
    theta = np.asarray(np.linalg.lstsq(table, y, rcond=None)[0])
    return Polynomial(tuple(names), degree, middle, half, theta)


def arx(dataset: Dataset, names: Sequence[str]) -> tuple[Arx, list[Array]] | None:
    """Return the fitted ARX model and its free run along every recording, (n_c,) for each curve.

    The scores are computed from the free run. It starts at rest, as if the output and the inputs
    had always had their first values. The coefficients are fitted by least squares, one step ahead.
    A model of each order in `ORDERS` is fitted, and the model with the smallest error in free run
    on the training samples is returned. The result is None if every free run diverges.
    """
    best, least = None, np.inf
    for order in ORDERS:
        if (theta := _one_step_fit(dataset, names, order)) is not None:
            fitted = Arx(dataset.target, tuple(names), order, theta)
            runs = [_run(curve, fitted) for curve in dataset.curves]
            error = sum(
                float(np.sum((simulated - y)[training] ** 2))
                for run, curve in zip(runs, dataset.curves, strict=True)
                for simulated, y, training in in_blocks(
                    run, curve.columns[dataset.target], curve.training
                )
            )
            if error < least:
                best, least = (fitted, runs), error
    return best


def _training_samples(dataset: Dataset, names: Sequence[str]) -> list[Array]:
    """Return the columns `names` at the training samples of all curves, shape (n,) each. If there
    are many more samples than a fit needs, only every k-th sample is used.
    """
    every = _thinning(dataset)
    rows = [row_numbers(rows_where(curve.training)[::every]) for curve in dataset.curves]
    parts = list(zip(dataset.curves, rows, strict=True))
    return [
        np.concatenate(
            [picked(curve.columns[name], rows_of_curve) for curve, rows_of_curve in parts]
        )
        for name in names
    ]


def _thinning(dataset: Dataset) -> int:
    """Return the number k for which only every k-th sample is used. About four times as many
    samples remain as a fit needs.
    """
    return max(1, sum(curve.size for curve in dataset.curves) // (4 * MOST_ROWS))


def _monomials(x: Sequence[Array] | Array, degree: int) -> Array:
    """Return every monomial of `m` inputs, (n,) each, with a total degree up to `degree`, shape (k,
    n).
    """
    values: dict[tuple[int, ...], Array] = {(): np.ones(len(x[0]))}
    for of in _powers(len(x), degree)[1:]:
        values[of] = values[of[:-1]] * x[of[-1]]
    return np.array([*values.values()])


def _powers(inputs: int, degree: int) -> list[tuple[int, ...]]:
    """Return, for each monomial, the indices of the inputs that are multiplied. For example, (0, 0,
    1) is the square of the first input times the second input.
    """
    return [
        of
        for total in range(degree + 1)
        for of in combinations_with_replacement(range(inputs), total)
    ]


def _one_step_fit(dataset: Dataset, names: Sequence[str], order: int) -> Array | None:
    """Fit an ARX model of the given order by least squares, one step ahead. Return its
    coefficients: the constant, then `order` coefficients of past outputs, then `order + 1`
    coefficients of each input.
    """
    every, tables, outputs = _thinning(dataset), [], []
    for curve in dataset.curves:
        for rows in curve.stretches:
            at = np.flatnonzero(curve.training[rows])
            at = at[at >= order][::every]
            y, *inputs = (curve.columns[name][rows] for name in (dataset.target, *names))
            delayed = [(y, step) for step in range(1, order + 1)]
            delayed += [(x, step) for x in inputs for step in range(order + 1)]
            past = [picked(x, at - step) for x, step in delayed]
            tables.append(np.column_stack([np.ones(len(at)), *past]))
            outputs.append(picked(y, at))
    P, y = np.concatenate(tables), np.concatenate(outputs)
    known = np.isfinite(P).all(axis=1) & np.isfinite(y)
    P, y = even_share(P[known], MOST_ROWS), even_share(y[known], MOST_ROWS)
    if len(y) < P.shape[1]:
        return None
    scale = np.abs(P).max(axis=0)
    scale[scale == 0] = 1.0
    return np.asarray(np.linalg.lstsq(P / scale, y, rcond=None)[0] / scale)


def _run(curve: Curve, fitted: Arx) -> Array:
    """Return the free run along every recording of a curve, (n,); NaN from the row at which it
    diverges.
    """
    # imported here, because the import is slow and a run without an ARX model does not need it
    from scipy.signal import lfilter

    names, order, theta = fitted.names, fitted.order, fitted.theta
    y = curve.columns[fitted.target]
    a, weights = theta[1 : order + 1], theta[order + 1 :].reshape(len(names), order + 1)
    most = LARGEST * max(np.abs(x[np.isfinite(x)]).max(initial=1e-300) for (x,) in in_blocks(y))

    def at_rest(coefficients: Array, first: float) -> Array:
        """Return the contribution of values before the beginning of a recording to the samples 0,
        1, ..., `order - 1`. All these earlier values are equal to `first`, because the recording is
        assumed to begin at rest.
        """
        return np.array([coefficients[step:].sum() * first for step in range(order)])

    def along(rows: slice | IntArray) -> Iterator[list[Array]]:
        columns = [y[rows], *(curve.columns[name][rows] for name in names)]
        past = at_rest(a, columns[0][0])
        delayed = [at_rest(b[1:], x[0]) for b, x in zip(weights, columns[1:], strict=True)]
        lost = False
        for measured, *inputs in in_blocks(*columns):
            drive = np.full(len(measured), theta[0])
            with np.errstate(over="ignore", invalid="ignore"):
                for place, x in enumerate(inputs):
                    part, delayed[place] = lfilter(weights[place], [1.0], x, zi=delayed[place])
                    drive += part
                values, past = lfilter([1.0], np.concatenate([[1.0], -a]), drive, zi=past)
            far = np.maximum.accumulate(~(np.abs(values) <= most)) | lost
            values[far], lost = np.nan, bool(far[-1:].any())
            yield [values]

    return curve.together([stacked(along(rows))[0] for rows in curve.stretches])
