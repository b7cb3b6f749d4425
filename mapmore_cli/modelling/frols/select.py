"""Choose the terms of FROLS one by one, and choose the number of terms by a criterion. Each step
needs the part of every candidate, and of the output, that is orthogonal to the chosen terms. The
module `remainders` represents these parts in several ways, with all of which this module works.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.frols.moments import Blocks, divided, standard, weighted
from mapmore_cli.modelling.frols.remainders import TIE_TOLERANCE, Remainders

# An ERR or an unexplained fraction below this value is regarded as zero.
# The value is about the square of the relative rounding error.
NO_GAIN = 1e-28

Price = Callable[[IntArray, int, int], Array]
"""Function that returns the price of each number k of terms, (k,), for n samples and M candidates.
A criterion prefers the number of terms for which `n ln(SSE/n)` plus the price is smallest.
"""


def _aicc(k: IntArray, n: int, _candidates: int) -> Array:
    freedom = n - k - 1
    return np.where(freedom > 0, 2 * k + 2 * k * (k + 1) / np.maximum(freedom, 1), np.inf)


PRICES: Mapping[str, Price] = {
    "bic": lambda k, n, _candidates: k * np.log(n),
    "ebic": lambda k, n, candidates: k * np.log(n) + 2 * k * np.log(candidates),
    "aicc": _aicc,
}
"""Information criteria by name.

- `bic`: `k ln n` (Schwarz 1978);
- `ebic`: larger than `bic` by `2 k ln M`, because the best of M candidates fit some noise by chance
  (Chen and Chen 2008, Biometrika 95, with gamma = 1, and with `M^k` as the number of subsets of k
  candidates);
- `aicc`: `2k + 2k(k+1)/(n-k-1)` (Hurvich and Tsai 1989).
"""
CRITERIA = ("tolerance", *PRICES, "press")  # rules by which the number of terms is chosen


@dataclass(frozen=True)
class Stopping:
    """Rule for the end of a selection. The selection ends with `max_terms` terms (None for no
    limit), or when at most the fraction `tolerance` of the output is unexplained.

    The fraction is relative to `y'y`, or to the sum of squares about the mean (see `to_explain`).
    With any criterion other than `tolerance`, the selection ignores the tolerance, and the
    criterion chooses the number of terms afterwards.
    """

    max_terms: int | None
    tolerance: float
    criterion: str

    def __post_init__(self) -> None:
        if self.max_terms is not None and self.max_terms < 1:
            raise ValueError(f"max_terms is {self.max_terms}; it must be at least 1")
        if self.criterion not in CRITERIA:
            raise ValueError(
                f"unknown stop rule {self.criterion!r}; there are {', '.join(CRITERIA)}"
            )

    def limit(self, n: int, M: int) -> int:
        """Return the largest number of terms that n samples and M candidates allow."""
        return min(n, M, self.max_terms or n)

    def preferred(
        self,
        steps: list[Iteration],
        stop: str,
        errors: Callable[[], Array],
        unexplained: Array,
        shape: tuple[int, int],
    ) -> tuple[list[Iteration], str]:
        """Return the steps up to the number of terms that the criterion prefers, and the reason for
        this number. The reason is the criterion if it removes steps. Otherwise, it is `stop`, the
        reason why the selection ended.

        `errors` is a function that returns the PRESS after 1, 2, ... terms. `unexplained` is
        described in `fewest_terms`. `shape` is the shape (n, M) of the dictionary.
        """
        if self.criterion == "tolerance" or not steps:
            return steps, stop
        if self.criterion == "press":
            best = int(np.argmin(errors())) + 1
        else:
            best = fewest_terms(self.criterion, unexplained, *shape)
        return steps[:best], self.criterion if best < len(steps) else stop


class Iteration(NamedTuple):
    """One step of the selection. `pick` is the chosen candidate, and `g` and `err` hold g and ERR
    of all candidates, (M,). `runner_up` is the candidate with the next highest ERR (-1 if there is
    none). `tied` is the number of other candidates with the same ERR as the chosen one. `row` is
    the row of the triangular factor, (M+1,), and `sse` is the unexplained part of `y'y`.
    """

    pick: int
    g: Array
    err: Array
    runner_up: int
    tied: int
    row: Array
    sse: float


def greedy(
    remainders: Remainders, stopping: Stopping, limit: int, whole: Callable[[], float]
) -> tuple[list[Iteration], str]:
    """Choose the candidate of the highest ERR (M2 eq 5) until the error is within the tolerance (eq
    6) or `limit` terms are chosen (eq 7).

    The function `whole` returns the sum of squares to which the tolerance is relative, at most
    `y'y`. The function is called only if its value can change the result.

    Returns the steps and the reason why they ended: `tolerance`, `max_terms`, `no_gain` (no
    candidate explains anything), or `rank` (every candidate depends linearly on the chosen ones).
    If the residual consists of rounding errors only, the selection ends in any case. Raises
    DigitsLost if the remainders raise it.
    """
    steps: list[Iteration] = []
    by_tolerance = stopping.criterion == "tolerance"
    yy, tolerance = remainders.yy, stopping.tolerance * by_tolerance
    while len(steps) < limit:
        g, err = remainders.reductions()
        highest = _highest(err)
        if len(highest) == 0:
            return steps, "rank"
        if err[highest].max() <= NO_GAIN:
            return steps, "no_gain"
        pick, *tied = highest.tolist()
        rest = err.copy()
        rest[pick] = np.nan
        others = _highest(rest).tolist()
        row = remainders.choose(pick)
        steps.append(
            Iteration(pick, g, err, others[0] if others else -1, len(tied), row, remainders.sse)
        )
        left = remainders.sse
        if left <= NO_GAIN * yy or (left <= tolerance * yy and left <= tolerance * whole()):
            return steps, "tolerance" if by_tolerance else "no_gain"
    return steps, "max_terms" if limit == stopping.max_terms else "rank"


def _highest(err: Array) -> IntArray:
    """Return the indices of all candidates that have the highest ERR, apart from rounding errors;
    an empty array if every ERR is NaN.
    """
    # `fmax` ignores NaN
    return np.flatnonzero(err >= np.fmax.reduce(err, initial=-np.inf) * (1 - TIE_TOLERANCE))


def to_explain(blocks: Blocks, samples: int, yy: float, uncertainty: Array | None) -> float:
    """Return the sum of squares to which a tolerance is relative: `y'y` minus the part that a
    constant explains, if the constant is a candidate.

    If a target is far from zero, for example a length, a constant explains nearly all of `y'y`, but
    nothing of the variation. For a constant target, `y'y` itself is returned. The blocks are read
    once, or twice if they are weighted by an `uncertainty`, shape (n,).
    """
    known = standard(blocks if uncertainty is None else weighted(blocks, 1 / uncertainty))
    constant = np.isinf(known.spread) & (known.centre != 0)
    if constant[-1] or not constant.any():
        return yy
    if uncertainty is None:
        return samples * float(known.spread[-1]) ** 2
    y = np.concatenate([y for _, y in blocks()])
    return yy - float(y @ (1 / uncertainty)) ** 2 / float(np.sum(uncertainty**-2.0))


# smaller unexplained fractions are rounding errors, which no further term can explain
ROUNDING = 1e-30


def fewest_terms(criterion: str, unexplained: Array, n: int, candidates: int) -> int:
    """Return the number of terms for which a criterion in `PRICES` is smallest. If two numbers have
    the same value, the smaller number is returned. For several outputs, the criteria are summed.

    `unexplained`, (k,), or (m, k) for m outputs, holds `SSE / y'y` after 1, 2, ... terms, and n is
    the number of samples.
    """
    outputs = np.atleast_2d(unexplained)
    price = PRICES[criterion](np.arange(1, outputs.shape[1] + 1), n, candidates)
    left = np.sum(n * np.log(np.maximum(outputs, ROUNDING)), axis=0)
    return int(np.argmin(left + len(outputs) * price)) + 1


FULL_LEVERAGE = 1e-8
"""A sample with `1 - h` below this determines a coefficient alone, so that the prediction error in
a fit without this sample is unknown.
"""


def press(blocks: Blocks, chosen: IntArray, factor: Array, projections: Array) -> Array:
    """Return `PRESS_k = sum_i (r_ik / (1 - h_ik))^2` after 1, 2, ... terms (Allen 1974), shape
    (k,). PRESS_k is infinite if a sample has leverage one.

    `factor` is the upper triangular factor R of the `chosen` candidates (k,), shape (k, k).
    `projections` are `c = U'y`, (k,), with `U = P_chosen R^-1`. The first k columns of U give the
    leverages `h_ik = sum_j U_ij^2` and the residuals `r_ik = y_i - sum_j U_ij c_j`.
    """
    total = np.zeros(len(chosen))
    for P, y in blocks():
        U = np.linalg.solve(factor.T, P[:, chosen].T).T
        residual = y[:, None] - np.cumsum(U * projections, axis=1)
        left = 1 - np.cumsum(U**2, axis=1)
        total += np.square(residual / np.where(left > FULL_LEVERAGE, left, np.nan)).sum(axis=0)
    return np.where(np.isnan(total), np.inf, total)


def selected(
    remainders: Remainders,
    stopping: Stopping,
    limit: int,
    scale: Array,
    samples: int,
    blocks: Blocks,
    uncertainty: Array | None,
) -> Selection:
    """Choose terms with `greedy`, and return the selection with as many of them as the stopping
    rule prefers. Raises DigitsLost like `greedy`.

    The remainders belong to the columns of `Z = [P y]`, divided by `scale`, shape (M+1,). `blocks`
    are the rows of `Z`. They are read only for the criterion `press`, and if the tolerance may end
    the selection. If `uncertainty`, shape (n,), is not None, the rows are weighted by it.
    """
    whole = cache(lambda: to_explain(divided(blocks, scale), samples, remainders.yy, uncertainty))
    steps, stop = greedy(remainders, stopping, limit, whole)
    steps, stop = stopping.preferred(
        steps,
        stop,
        lambda: press(divided(blocks, scale), *factor_of(steps, len(scale))),
        remainders.relative(np.array([step.sse for step in steps])),
        (samples, len(scale) - 1),
    )
    return _selection_of_steps(steps, stop, remainders.yy, scale, samples)


def factor_of(steps: Sequence[Iteration], width: int) -> tuple[IntArray, Array, Array]:
    """Return the chosen candidates, (k,), their triangular factor R, (k, k), and the projections
    `c = U'y`, (k,), of the output on the columns of `U = P_chosen R^-1`.
    """
    chosen = np.array([step.pick for step in steps], dtype=np.int64)
    rows = np.array([step.row for step in steps]).reshape(len(steps), width)
    return chosen, np.triu(rows[:, chosen]), rows[:, -1]


def _selection_of_steps(
    steps: Sequence[Iteration], stop: str, yy: float, scale: Array, samples: int
) -> Selection:
    k, M = len(steps), len(scale) - 1
    chosen, R, projections = factor_of(steps, len(scale))
    lengths, sse = np.diag(R), steps[-1].sse if k else yy
    variance = sse / (samples - k) if samples > k else np.nan
    found = Selection(
        chosen=chosen,
        g=projections / lengths,
        err=projections**2 / yy,
        theta=np.asarray(np.linalg.solve(R, projections), dtype=np.float64),
        theta_error=np.sqrt(variance) * np.linalg.norm(np.linalg.inv(R), axis=1),
        a=R / lengths[:, None],
        g_all=np.array([step.g for step in steps]).reshape(k, M),
        err_all=np.array([step.err for step in steps]).reshape(k, M),
        runner_up=np.array([step.runner_up for step in steps], dtype=np.int64),
        tied=np.array([step.tied for step in steps], dtype=np.int64),
        condition=float(np.linalg.cond(R * scale[chosen])) if k else 1.0,
        sse=sse,
        yy=yy,
        samples=samples,
        stop=stop,
    )
    return in_units(found, scale)


def in_units(found: Selection, scale: Array) -> Selection:
    """Convert a selection from scaled columns into a selection from the columns of `Z = [P y]`.
    `scale`, shape (M+1,), holds the numbers by which these columns were divided.
    """
    y, columns = float(scale[-1]), scale[:-1]
    chosen = columns[found.chosen]
    return replace(
        found,
        g=found.g * y / chosen,
        theta=found.theta * y / chosen,
        theta_error=found.theta_error * y / chosen,
        a=found.a * chosen / chosen[:, None],
        g_all=found.g_all * y / columns,
        sse=found.sse * y * y,  # on overflow, `y * y` is infinite, but `y**2` would raise an error
        yy=found.yy * y * y,
    )


def widened(selection: Selection, among: IntArray, M: int) -> Selection:
    """Convert a selection from the candidates `among`, shape (m,), into a selection from all M
    candidates. In the tables, the values of candidates that are not in `among` are NaN.
    """
    tables = np.full((2, len(selection.chosen), M), np.nan)
    tables[:, :, among] = selection.g_all, selection.err_all
    runner_up = np.where(selection.runner_up >= 0, among[selection.runner_up], -1)
    return replace(
        selection,
        chosen=among[selection.chosen],
        g_all=tables[0],
        err_all=tables[1],
        runner_up=runner_up,
    )
