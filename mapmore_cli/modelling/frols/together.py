"""The choice of terms that several outputs share, by the sum of their error reduction ratios."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.moments import Blocks
from mapmore_cli.modelling.frols.select import (
    Remainders,
    Stopping,
    factor_of,
    fewest_terms,
    greedy,
    press,
)


class Together(Remainders):
    """What the chosen terms leave of several outputs; `sse` is the largest share that is left of
    any.
    """

    def __init__(self, parts: Sequence[Remainders], wholes: Sequence[float]) -> None:
        self.parts, self.wholes, self.yy = parts, wholes, 1.0
        self.unexplained: list[list[float]] = []

    def reductions(self) -> tuple[Array, Array]:
        """See `Remainders`; ERR is the sum over outputs, and stands in the place of g as well."""
        err = np.sum([part.reductions()[1] for part in self.parts], axis=0)
        return err, err

    def choose(self, pick: int) -> Array:
        """See `Remainders`; a row for each output, (m, M+1)."""
        rows = np.stack([part.choose(pick) for part in self.parts])
        self.unexplained.append([part.sse / (part.yy or 1.0) for part in self.parts])
        left = zip(self.parts, self.wholes, strict=True)
        self.sse = max(part.sse / (whole or 1.0) for part, whole in left)
        return rows


def chosen_together(
    joint: Together, blocks: Sequence[Blocks], stopping: Stopping, limit: int, samples: int
) -> tuple[IntArray, str]:
    """Return up to `limit` candidates that all outputs share, in their order, and why they are so
    many; `blocks` are the rows of candidates and output, for each.
    """
    steps, stop = greedy(joint, stopping, limit, lambda: 1.0)
    best = k = len(steps)
    if k and stopping.criterion == "press":
        left = np.zeros(k)
        for j, (own, part) in enumerate(zip(blocks, joint.parts, strict=True)):
            rows = [step._replace(row=step.row[j]) for step in steps]
            left += press(own, *factor_of(rows, len(part.pp) + 1)) / (part.yy or 1.0)
        best = int(np.argmin(left)) + 1
    elif k and stopping.criterion != "tolerance":
        best = fewest_terms(stopping.criterion, np.transpose(joint.unexplained), samples)
    chosen = np.array([step.pick for step in steps[:best]], dtype=np.int64)
    return chosen, stopping.criterion if best < k else stop
