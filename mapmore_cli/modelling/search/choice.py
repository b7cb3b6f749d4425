"""Which structure is taken: least error on left-out training data, the simplest within one standard error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.scores.simplest import Ranked, simplest_of


def chosen_of(sizes: Sequence[int], blocks: Array, parts: Array) -> Ranked:
    """Rank structures by their errors on left-out `blocks` (s, f).

    `parts` are those on left-out levels or recordings, (s, g), g = 0 where there are too few.
    """
    del parts
    finite = np.where(np.isfinite(blocks), blocks, 1e9)
    return simplest_of(sizes, finite)
