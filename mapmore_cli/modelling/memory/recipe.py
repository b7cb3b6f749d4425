"""Everything that has to be told to turn recordings into a model with memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Stop = Literal["tolerance", "bic", "aicc", "press", "free_run"]
"""When fewer terms than `max_terms` are enough."""

Criterion = Literal["one_step", "free_run"]
"""Which error coefficients minimise, or terms are chosen by."""

FORWARD = 3
"""Terms chosen forward for each that is kept, where pruning follows and nothing else is said."""


@dataclass(frozen=True)
class MemoryRecipe:
    """The choices of a model with memory.

    Attributes
    ----------
    target
        The output.
    dictionary
        Candidate terms as text, products of names of states.
    step
        Time between samples, s.
    scale
        Whether states are scaled to [0, 1] on the training samples, and clipped `margin` beyond.
    ridge
        0, a number, or `auto`. With a ridge candidates are centred and divided by their standard deviations, and the model has a constant
        of its own; without, a constant is a candidate like any other.
    max_terms
        Terms that are kept at most.
    forward
        Terms chosen before they are pruned to `max_terms`, where there is a ridge; None for three times as many.
    tolerance, stop
        When fewer terms are enough: `tolerance` at that unexplained fraction of the output's square (of its variance with a ridge); `bic`,
        `aicc`, `press` at the least of the criterion; `free_run` at the least error of a free run over the last quarter of each piece's
        training samples, of models fitted to the others.
    criterion
        Which error the coefficients minimise: that of one step ahead, or of a free run, which starts from them.
    select
        Which error decides between the candidates of each step; that of free runs with `criterion` and `stop` of the same word only.
    """

    target: str
    dictionary: tuple[str, ...]
    step: float
    scale: bool
    margin: float
    ridge: float | Literal["auto"]
    max_terms: int
    forward: int | None
    tolerance: float
    stop: Stop
    criterion: Criterion
    select: Criterion

    @property
    def forward_terms(self) -> int:
        """Terms that are chosen before pruning."""
        return max(self.max_terms, FORWARD * self.max_terms if self.forward is None else self.forward)
