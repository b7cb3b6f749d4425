"""Records on even time steps."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.modelling.signals.gaps import typical_step

DECIMATION = 1.5  # samples per step from which they are averaged
ROUNDING = 1e-6  # of a step: a stamp this close to the edge of a block lies on it


def resample(time: Array, columns: Columns, step: float) -> tuple[Array, dict[str, Array]]:
    """Return a record without gaps at stamps `step` apart.

    Where a step holds several samples, it becomes their mean, stamped at their middle: a moving average, which neither lags nor lets
    frequencies above the new sampling rate pass unweakened. Sample i belongs to block `floor((t_i - t_0)/step)`; with `dt` the median
    step of the record, block k is stamped `t_0 + k step + (step - dt)/2`, the mean of the stamps of an evenly sampled block. The block
    means are interpolated linearly to these stamps, so that stamps which jitter do no harm and straight lines stay straight. The last
    block is left out where the record does not fill it. Where a step holds one sample or less, the record is interpolated linearly at
    `t_0 + k step`.

    Parameters
    ----------
    time
        `(n,)`, increasing.
    columns
        Quantities, each `(n,)`; a `time` among them is left out.
    step
        In the unit of `time`.

    Returns
    -------
    tuple
        Stamps `(m,)` and quantities `(m,)`; m is 0 where the record is shorter than one step.
    """
    dt = typical_step(time)
    span = time[-1] - time[0]
    values = {name: column for name, column in columns.items() if name != "time"}
    if step < DECIMATION * dt or dt == 0:
        stamps = time[0] + step * np.arange(int(span / step + ROUNDING) + 1)
        return stamps, {name: np.interp(stamps, time, column) for name, column in values.items()}
    blocks = int((span + dt) / step + ROUNDING)
    stamps = time[0] + step * np.arange(blocks) + (step - dt) / 2
    if blocks == 0:
        return stamps, {name: np.zeros(0) for name in values}
    block = np.floor((time - time[0]) / step + ROUNDING).astype(np.int64)
    first = np.flatnonzero(np.diff(block, prepend=-1))
    counts = np.diff(first, append=len(time))
    middle = np.add.reduceat(time, first) / counts
    return stamps, {name: np.interp(stamps, middle, np.add.reduceat(column, first) / counts) for name, column in values.items()}
