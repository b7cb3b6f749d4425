"""The choice of terms that several outputs share, by the sum of their error reduction ratios."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.modelling.frols.moments import Blocks
from mapmore_cli.modelling.frols.select import (
    Iteration,
    Remainders,
    Stopping,
    factor_of,
    fewest_terms,
    greedy,
    press,
)


@dataclass(frozen=True)
class Output:
    """One of several outputs, in units of its own.

    - `remainders`: what terms leave of it and of its candidates, given how many may be chosen.
    - `blocks`: the rows of candidates and output.
    - `whole`: the sum of squares that a tolerance is a fraction of.
    """

    remainders: Callable[[int], Remainders]
    blocks: Blocks
    whole: float
    samples: int
    candidates: int


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


def chosen_together(outputs: Sequence[Output], stopping: Stopping) -> tuple[IntArray, str]:
    """Return the candidates that all outputs share, in their order, and why they are so many."""
    samples, M = outputs[0].samples, outputs[0].candidates
    limit = stopping.limit(samples, M)
    joint = Together([one.remainders(limit) for one in outputs], [one.whole for one in outputs])
    steps, stop = greedy(joint, stopping, limit, lambda: 1.0)
    best = k = len(steps)
    if k and stopping.criterion == "press":
        left = [
            press(one.blocks, *factor_of(_own(steps, j), M + 1)) / (joint.parts[j].yy or 1.0)
            for j, one in enumerate(outputs)
        ]
        best = int(np.argmin(np.sum(left, axis=0))) + 1
    elif k and stopping.criterion != "tolerance":
        best = fewest_terms(stopping.criterion, np.transpose(joint.unexplained), samples)
    chosen = np.array([step.pick for step in steps[:best]], dtype=np.int64)
    return chosen, stopping.criterion if best < k else stop


def _own(steps: Sequence[Iteration], output: int) -> list[Iteration]:
    return [step._replace(row=step.row[output]) for step in steps]
