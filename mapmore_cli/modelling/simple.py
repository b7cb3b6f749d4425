"""Competitors that need no muscle: polynomials in a model's own inputs, and a linear model of the
next output (ARX) in free run.

A reviewer asks for them first: whatever a study models, a plane through its inputs costs nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray, by_blocks, in_blocks, picked, stacked
from mapmore_cli.domain.models import Equation
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.signals.sampling import even_share

# total degree of each polynomial, every monomial up to it included
DEGREES = {
    "plane": 1,
    "quadratic": 2,
    "cubic": 3,
}
SIMPLE: Mapping[str, str] = {name: name.capitalize() for name in (*DEGREES, "backbone")} | {
    "arx": "ARX"
}
"""The simple competitors with their titles; every validation has those that its model allows."""

ORDERS = (1, 2, 4, 8)  # samples that an ARX looks back; the free run on training data chooses
MOST_ROWS = 50_000  # training rows that a fit takes, an even share
DIGITS = 6  # of printed coefficients
LARGEST = 1e3  # times the largest measured output, from which a free run has diverged


Rows = tuple[Array, Array]
"""Inputs, (n, m), and outputs, (n,), that a polynomial is fitted to."""


def training_rows(dataset: Dataset, names: Sequence[str]) -> Rows:
    """Return known inputs and outputs of training samples, in an order that does not depend on that
    of the samples; of many, an even share.
    """
    *inputs, y = _training_samples(dataset, [*names, dataset.target])
    x = np.column_stack(inputs)
    known = np.isfinite(x).all(axis=1) & np.isfinite(y)
    x, y = x[known], y[known]
    order = np.lexsort([y, *x.T])  # the order of the rows must not change a digit
    return even_share(x[order], MOST_ROWS), even_share(y[order], MOST_ROWS)


@dataclass(frozen=True)
class Polynomial:
    """A polynomial in the quantities `names`, (m,), each less its `middle` and over its `half`
    range, with a coefficient `theta`, (k,), for every monomial up to a total degree.
    """

    names: Sequence[str]
    degree: int
    middle: Array
    half: Array
    theta: Array

    def __call__(self, *at: Array) -> Array:
        """Return its values at places of its quantities, (n,) each."""
        ends = zip(at, self.middle, self.half, strict=True)
        return self.theta @ _monomials([(x - m) / h for x, m, h in ends], self.degree)

    def of_curves(self, dataset: Dataset) -> list[Array]:
        """Return its values at the samples of every curve: (n_c,) each."""
        return [by_blocks(self, *(one.columns[n] for n in self.names)) for one in dataset.curves]

    def equation(self, name: str) -> Equation:
        """Return it in coordinates `s_NAME` that are -1 and 1 at the ends of the training data."""
        from mapmore_cli.modelling.equations import as_equation  # which load SciPy
        from mapmore_cli.modelling.expressions import add, folded, parse

        factors = _powers(len(self.names), self.degree)
        terms = (
            "*".join([f"({value!r})", *(f"s_{self.names[i]}^{of.count(i)}" for i in sorted({*of}))])
            for value, of in zip(self.theta.tolist(), factors, strict=True)
        )
        scaled = zip(self.names, self.middle.tolist(), self.half.tolist(), strict=True)
        where = {f"s_{one}": parse(f"({one} - ({m!r}))/({h!r})") for one, m, h in scaled}
        return as_equation(name, folded(add(*map(parse, terms))), DIGITS, where)


def polynomial_fit(
    degree: int, dataset: Dataset, names: Sequence[str], rows: Rows | None = None
) -> Polynomial | None:
    """Return the least-squares polynomial in the quantities `names`.

    Inputs are scaled to [-1, 1] on the training samples; where these leave coefficients open, the
    solution of least norm is taken. It is fitted to `rows`, the `training_rows` where they are
    left out. None if there are fewer of them than coefficients, or no inputs.
    """
    if not names:
        return None
    x, y = rows or training_rows(dataset, names)
    if len(y) < comb(len(names) + degree, degree):
        return None
    low, high = x.min(axis=0), x.max(axis=0)
    middle, half = (low + high) / 2, np.where(high > low, (high - low) / 2, 1.0)
    theta: Array = np.linalg.lstsq(_monomials(((x - middle) / half).T, degree).T, y, rcond=None)[
        0
    ].astype(np.float64, copy=False)
    return Polynomial(tuple(names), degree, middle, half, theta)


def arx(dataset: Dataset, names: Sequence[str]) -> list[Array] | None:
    """Free run of `y[k] = c + sum a_i y[k-i] + sum b_j u[k-j]` along every recording, (n_c,) each.

    It starts from the first measured output, at rest. Least squares on one step fits it; of
    `ORDERS`, the one whose free run errs least on the training samples is taken. None if none of
    them runs without diverging.
    """
    best, least = None, np.inf
    for order in ORDERS:
        if (theta := _one_step_fit(dataset, names, order)) is not None:
            runs = [_run(curve, dataset.target, names, order, theta) for curve in dataset.curves]
            error = sum(
                float(np.sum((said - y)[training] ** 2))
                for run, curve in zip(runs, dataset.curves, strict=True)
                for said, y, training in in_blocks(
                    run, curve.columns[dataset.target], curve.training
                )
            )
            if error < least:
                best, least = runs, error
    return best


def _training_samples(dataset: Dataset, names: Sequence[str]) -> list[Array]:
    """Return some columns of the training samples of all curves, (n,) each; of far more than a fit
    takes, an even share.
    """
    every = _thinning(dataset)
    rows = [np.flatnonzero(curve.training)[::every] for curve in dataset.curves]
    parts = list(zip(dataset.curves, rows, strict=True))
    return [
        np.concatenate([picked(curve.columns[name], own) for curve, own in parts]) for name in names
    ]


def _thinning(dataset: Dataset) -> int:
    """Return of how many samples one is taken, so that few more are than a fit takes."""
    return max(1, sum(curve.size for curve in dataset.curves) // (4 * MOST_ROWS))


def _monomials(x: Sequence[Array] | Array, degree: int) -> Array:
    """Every monomial of `m` inputs, (n,) each, of total degree up to `degree`: (k, n)."""
    values: dict[tuple[int, ...], Array] = {(): np.ones(len(x[0]))}
    for of in _powers(len(x), degree)[1:]:
        values[of] = values[of[:-1]] * x[of[-1]]
    return np.array([*values.values()])


def _powers(inputs: int, degree: int) -> list[tuple[int, ...]]:
    """Return the numbers of the inputs that are the factors of each monomial, in their order."""
    return [
        of
        for total in range(degree + 1)
        for of in combinations_with_replacement(range(inputs), total)
    ]


def _one_step_fit(dataset: Dataset, names: Sequence[str], order: int) -> Array | None:
    """Coefficients: the constant, `order` of the output, then `order + 1` of each input."""
    every, tables, outputs = _thinning(dataset), [], []
    for curve in dataset.curves:
        for rows in curve.stretches:
            own = np.flatnonzero(curve.training[rows])
            own = own[own >= order][::every]
            y, *inputs = (curve.columns[name][rows] for name in (dataset.target, *names))
            delayed = [(y, step) for step in range(1, order + 1)]
            delayed += [(x, step) for x in inputs for step in range(order + 1)]
            past = [picked(x, own - step) for x, step in delayed]
            tables.append(np.column_stack([np.ones(len(own)), *past]))
            outputs.append(picked(y, own))
    P, y = np.concatenate(tables), np.concatenate(outputs)
    known = np.isfinite(P).all(axis=1) & np.isfinite(y)
    P, y = even_share(P[known], MOST_ROWS), even_share(y[known], MOST_ROWS)
    if len(y) < P.shape[1]:
        return None
    scale = np.abs(P).max(axis=0)
    scale[scale == 0] = 1.0
    return np.asarray(np.linalg.lstsq(P / scale, y, rcond=None)[0] / scale)


def _run(curve: Curve, target: str, names: Sequence[str], order: int, theta: Array) -> Array:
    """Return the free run along every recording of a curve, (n,); NaN from where it diverges."""
    from scipy.signal import lfilter  # a fifth of the seconds of a run without any

    y = curve.columns[target]
    a, weights = theta[1 : order + 1], theta[order + 1 :].reshape(len(names), order + 1)
    most = LARGEST * max(np.abs(x[np.isfinite(x)]).max(initial=1e-300) for (x,) in in_blocks(y))

    def at_rest(coefficients: Array, first: float) -> Array:
        """Return what values that were always the first one add to the samples 0, 1, ..."""
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
