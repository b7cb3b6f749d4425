"""From the iterations to the numbers that are kept: coefficients, standard errors, tables, in the units of `P` and `y`."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.frols.blocks import Blocks, scaled
from mapmore_cli.modelling.frols.criteria import fewest, information_criterion, press
from mapmore_cli.modelling.frols.select import Path, Stopping


def finished(path: Path, scale: Array, samples: int, blocks: Blocks, stopping: Stopping) -> Selection:
    """The selection at the number of terms that the stop rule prefers.

    Parameters
    ----------
    path
        Iterations on columns of `Z = [P y]` divided by `scale`, (M+1,).
    blocks
        The rows of `Z` before scaling; read for `press` only.
    """
    k, criterion = len(path.steps), stopping.criterion
    if criterion == "tolerance" or k == 0:
        return _selection(path, k, path.stop, scale, samples)
    if criterion == "press":
        best = fewest(press(scaled(blocks, scale), *_factor(path, k, len(scale))))
    else:
        unexplained = np.array([step.sse for step in path.steps]) / path.yy
        best = fewest(information_criterion(criterion, unexplained, samples))
    return _selection(path, best, criterion if best < k else path.stop, scale, samples)


def _factor(path: Path, k: int, width: int) -> tuple[IntArray, Array, Array]:
    """The first k chosen indices, their triangular factor R (k, k), and the projections `c = U'y` (k,)."""
    chosen = np.array([step.pick for step in path.steps[:k]], dtype=np.int64)
    rows = np.array([step.row for step in path.steps[:k]]).reshape(k, width)
    return chosen, np.triu(rows[:, chosen]), rows[:, -1]


def _selection(path: Path, k: int, stop: str, scale: Array, samples: int) -> Selection:
    steps, M = path.steps[:k], len(scale) - 1
    chosen, R, projections = _factor(path, k, len(scale))
    column_scale, y_scale = scale[chosen], float(scale[-1])
    lengths = np.diag(R)
    g = projections / lengths
    sse = steps[-1].sse if k else path.yy
    inverse = np.linalg.inv(R)
    variance = sse / (samples - k) if samples > k else np.nan
    return Selection(
        chosen=chosen,
        g=g * y_scale / column_scale,
        err=projections**2 / path.yy,
        theta=np.linalg.solve(R, projections) * y_scale / column_scale,
        theta_error=np.sqrt(variance) * np.linalg.norm(inverse, axis=1) * y_scale / column_scale,
        a=R / lengths[:, None] * column_scale / column_scale[:, None],
        g_all=np.array([step.g for step in steps]).reshape(k, M) * y_scale / scale[:-1],
        err_all=np.array([step.err for step in steps]).reshape(k, M),
        runner_up=np.array([step.runner_up for step in steps], dtype=np.int64),
        tied=np.array([step.tied for step in steps], dtype=np.int64),
        condition=float(np.linalg.cond(R * column_scale)) if k else 1.0,
        sse=sse * y_scale**2,
        yy=path.yy * y_scale**2,
        samples=samples,
        stop=stop,
    )
