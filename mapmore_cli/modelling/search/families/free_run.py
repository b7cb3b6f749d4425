"""The output fed back, with terms that free runs choose: it takes long, and is tried last."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory
from mapmore_cli.modelling.search.families.arx import TINY
from mapmore_cli.modelling.search.families.autoregression import squares
from mapmore_cli.modelling.search.situation import Situation

MOST_INPUTS, MOST_SAMPLES = 2, 1_500
MOST_CHOSEN = 1_000
"""Training samples, up to which each term is chosen in free run."""


def candidates(of: Situation) -> Iterator[Candidate]:
    """Yield the number of terms by free runs, and each term."""
    free: dict[str, Any] = {"ridge": TINY, "margin": 0.0, "criterion": "free_run", "stop": "free_run"}
    yield memory("two delays of the output, order 2, sized in free run", of, [squares(of)], 8, **free)
    if of.samples <= MOST_CHOSEN:
        yield memory("two delays of the output, order 2, chosen in free run", of, [squares(of)], 8, select="free_run", **free)


FAMILY = Family(lambda of: of.timed and 0 < len(of.inputs) <= MOST_INPUTS and of.samples <= MOST_SAMPLES, candidates)
