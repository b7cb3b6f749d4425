"""A time constant that training finds: each fold searches it, which takes long, so it is tried behind what is quick."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Entries, Family, memory
from mapmore_cli.modelling.search.situation import Situation

MOST_MOVING, MOST_SAMPLES = 2, 5_000
"""Inputs that move, and training samples, up to which it is searched."""

MOST_INPUTS = 5


def candidates(of: Situation) -> Iterator[Candidate]:
    """Yield such a lag with play, linear."""
    lag: Entries = [{"terms": ["1", *of.inputs]}, {"slow": {"of": [*of.moving]}}, {"play": {"of": [*of.moving], "count": 3}}]
    yield memory("a lag that training finds, and play, linear", of, lag, 8, ridge=0.0, stop="bic")


FAMILY = Family(
    lambda of: of.timed and 0 < len(of.moving) <= MOST_MOVING and len(of.inputs) <= MOST_INPUTS and of.samples <= MOST_SAMPLES, candidates
)
