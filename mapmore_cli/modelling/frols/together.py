"""Choose the terms that several outputs share, by the sum of their error reduction ratios."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.moments import Blocks
from mapmore_cli.modelling.frols.remainders import Remainders
from mapmore_cli.modelling.frols.select import (
    Stopping,
    factor_of,
    greedy,
    press,
)


class Together(Remainders):
    """Remainders of several outputs with common terms. For each output, `parts` holds the
    remainders, and `wholes` holds the sum of squares to which the unexplained fraction of this
    output is relative. `sse` is the largest unexplained fraction of all outputs.
    """

    def __init__(self, parts: Sequence[Remainders], wholes: Sequence[float]) -> None:
        self.parts, self.wholes, self.yy = parts, wholes, 1.0
        self.unexplained: list[list[float]] = []

    def reductions(self) -> tuple[Array, Array]:
        """Return the error reduction ratio of each candidate, summed over all outputs. The base
        class returns `g` and ERR. Here, each output has a different `g`, so that the summed ratio
        is returned in place of `g` too.
        """
        err = np.sum([part.reductions()[1] for part in self.parts], axis=0)
        return err, err

    def choose(self, pick: int) -> Array:
        """Choose a candidate (see `Remainders`), and return a row for each output, shape (m,
        M+1).
        """
        rows = np.stack([part.choose(pick) for part in self.parts])
        self.unexplained.append([part.sse / (part.yy or 1.0) for part in self.parts])
        left = zip(self.parts, self.wholes, strict=True)
        self.sse = max(part.sse / (whole or 1.0) for part, whole in left)
        return rows


def chosen_together(
    joint: Together, blocks: Sequence[Blocks], stopping: Stopping, limit: int, samples: int
) -> tuple[IntArray, str]:
    """Return up to `limit` candidates that all outputs share, in the order of their choice, and the
    reason why the selection ended. For each output, `blocks` holds the rows of candidates and
    output.
    """
    steps, stop = greedy(joint, stopping, limit, lambda: 1.0)
    width = len(joint.parts[0].pp) + 1

    def errors() -> Array:
        """Return the PRESS after 1, 2, ... terms, divided by the `y'y` of each output and summed
        over the outputs, shape (k,).
        """
        left = np.zeros(len(steps))
        for j, (own, part) in enumerate(zip(blocks, joint.parts, strict=True)):
            rows = [step._replace(row=step.row[j]) for step in steps]
            left += press(own, *factor_of(rows, width)) / (part.yy or 1.0)
        return left

    unexplained = np.transpose(joint.unexplained)
    kept, stop = stopping.preferred(steps, stop, errors, unexplained, (samples, width - 1))
    return np.array([step.pick for step in kept], dtype=np.int64), stop
