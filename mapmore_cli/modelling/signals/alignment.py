"""Two logs on different clocks."""

from __future__ import annotations

import numpy as np

from mapmore_cli.domain.arrays import Array


def align(stamps: Array, time: Array, values: Array, max_gap: float | None) -> Array:
    """Return `values` `(m,)`, logged at `time` `(m,)`, interpolated linearly at `stamps` `(n,)`.

    NaN where a stamp lies outside of the log, or between two of its samples more than `max_gap` apart (None: any distance will do),
    or is NaN itself. A stamp that is one of the log's own gets the value as logged.

    Parameters
    ----------
    stamps
        `(n,)` in any order, on the same clock as `time`.
    time
        `(m,)` strictly increasing, at least one.
    """
    after = np.searchsorted(time, stamps, side="left").clip(0, len(time) - 1)
    before = np.where(time[after] == stamps, after, (after - 1).clip(0))
    aligned: Array = np.interp(stamps, time, values)
    with np.errstate(invalid="ignore"):
        outside = ~((stamps >= time[0]) & (stamps <= time[-1]))
    too_far = np.zeros(len(stamps), dtype=np.bool_) if max_gap is None else time[after] - time[before] > max_gap * (1 + 1e-9)
    aligned[outside | too_far] = np.nan
    return aligned
