"""Time stamps that repeat because the logger rounds them."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns


def average_repeated(time: Array, columns: Columns) -> tuple[Array, dict[str, Array]]:
    """Return one sample for each different stamp, every quantity being the mean over the samples that share it.

    `time` is `(n,)` and never decreases; the results are `(m,)`, m the number of different stamps.
    """
    stamps, first, counts = np.unique(time, return_index=True, return_counts=True)
    return stamps, {name: np.add.reduceat(values, first) / counts for name, values in columns.items()}


def spread_repeated(time: Array) -> Array:
    """Return stamps `(n,)` in which equal ones are spread evenly up to the next one.

    Samples that share the last stamp are spread over a step as long as the one before; a single stamp is left as it is.
    """
    stamps, place, counts = np.unique(time, return_inverse=True, return_counts=True)
    if len(stamps) == 1:
        return time.copy()
    steps = np.diff(stamps, append=2 * stamps[-1] - stamps[-2])
    first = np.cumsum(counts) - counts
    spread: Array = time + steps[place] * (np.arange(len(time)) - first[place]) / counts[place]
    return spread
