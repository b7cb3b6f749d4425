"""Which parameters of a fit the data do not show, and which measurement would show them.

The test is on the Jacobian at the solution, so it needs no new data: a measurement that somebody
might add is a set of rows with one input moved to where nothing was measured, and its worth is what
it takes from the standard error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.modelling.expressions import NotFinite
from mapmore_cli.modelling.literature import linear

ROWS = 2000
"""Rows that the search looks at, an even share of all."""

FURTHER = 0.5
"""How far beyond the measured range a further measurement is tried, as a share of that range."""

SHARE = 0.1
"""Part of a parameter in a direction that changes nothing, from which on it is called undetermined.
"""

Jacobian = Callable[[Columns], Array]
"""Derivatives for the p parameters on rows of inputs, `(n, p)`."""


def half_width(error: float, freedom: int, level: float = 0.95) -> float:
    """Half of the confidence interval of a parameter: `t_{(1 + level)/2, freedom} error`; NaN where
    the error is unknown.

    It holds for independent errors of equal size. The samples of a record over time are neighbours,
    and theirs are not: there it is too narrow.
    """
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 * (1.0 + level)) * error) if freedom > 0 else float("nan")


def hints(
    parameters: Mapping[str, float],
    errors: Mapping[str, float],
    jacobian: Jacobian,
    columns: Columns,
) -> Iterator[str]:
    """Yield a sentence for each measurement that would show parameters which these data do not.

    - `parameters`, `errors`: values and standard errors by name, in the order of the Jacobian's
      columns; errors are NaN where the rank is
      deficient.
    - `jacobian`, `columns`: the derivatives at the solution as a function of inputs, and the inputs
      of the fit, `(n,)` each.
    """
    n = len(next(iter(columns.values())))
    share = {
        name: column[np.linspace(0, n - 1, min(n, ROWS)).astype(int)]
        for name, column in columns.items()
    }
    weak = _weak(parameters, errors, jacobian(share), n - len(parameters))
    if not weak:
        return
    helped: dict[str, list[str]] = {}
    found = {
        where: spread
        for where, rows in _measurements(share)
        if (spread := _spread(jacobian, share, rows)) is not None
    }
    for i in weak:
        best = min(found, key=lambda where: found[where][i], default=None)
        if best is None or np.isinf(found[best][i]):
            best = "something else (no further value of one input tells it from the others)"
        helped.setdefault(best, []).append(list(parameters)[i])
    for where, names in helped.items():
        verb, width = ("is", "its value") if len(names) == 1 else ("are", "their values")
        yield (
            f"{', '.join(names)} {verb} not identified (95 % interval wider than {width}): "
            f"measure {where}"
        )


def _weak(
    parameters: Mapping[str, float], errors: Mapping[str, float], jacobian: Array, freedom: int
) -> list[int]:
    """Return indices of the parameters whose interval reaches beyond zero, or that share in a
    direction which changes nothing.
    """
    lengths = np.linalg.norm(jacobian, axis=0)
    _, s, vt = np.linalg.svd(jacobian / np.where(lengths > 0.0, lengths, 1.0), full_matrices=False)
    null = vt[s <= linear.RANK_TOLERANCE * s[:1]]
    if len(null) or np.isnan(list(errors.values())).all():
        return [
            i
            for i in range(len(parameters))
            if lengths[i] == 0.0 or (len(null) and np.abs(null[:, i]).max() > SHARE)
        ]
    return [
        i
        for i, name in enumerate(parameters)
        if half_width(errors[name], freedom) > abs(parameters[name])
    ]


def _measurements(columns: Columns) -> Iterator[tuple[str, Columns]]:
    """Yield the rows with one input moved: below its range (not through zero), above it, and
    between its levels where these are few.
    """
    for name, column in columns.items():
        low, high = float(column.min()), float(column.max())
        reach = FURTHER * (high - low or abs(high) or 1.0)
        below = max(low - reach, 0.0) if low >= 0.0 else low - reach
        if below < low:
            yield f"at {name} below {low:.3g}", {**columns, name: np.full_like(column, below)}
        yield f"at {name} above {high:.3g}", {**columns, name: np.full_like(column, high + reach)}
        levels = np.unique(column)
        if 1 < len(levels) <= 10:
            middles = 0.5 * (levels[:-1] + levels[1:])
            yield (
                f"at more values of {name} between {low:.3g} and {high:.3g}",
                {**columns, name: np.resize(middles, len(column))},
            )


def _spread(jacobian: Jacobian, columns: Columns, further: Columns) -> Array | None:
    """Relative standard errors, `(p,)`, with the further rows measured too; infinite for what they
    still do not show.
    """
    try:
        both = np.vstack([jacobian(columns), jacobian(further)])
    except NotFinite:
        return None
    lengths = np.linalg.norm(both, axis=0)
    lengths[lengths == 0.0] = 1.0
    _, s, vt = np.linalg.svd(both / lengths, full_matrices=False)
    shown = s > linear.RANK_TOLERANCE * s[:1]
    hidden = np.linalg.norm(vt[~shown], axis=0) > SHARE
    return np.where(hidden, np.inf, np.linalg.norm(vt[shown].T / s[shown], axis=1) / lengths)
