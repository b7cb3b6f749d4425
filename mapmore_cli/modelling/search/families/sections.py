"""P's linear sections of second order along the one input."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family
from mapmore_cli.modelling.search.situation import Situation


def candidates(of: Situation) -> Iterator[Candidate]:
    """One section."""
    yield Candidate("one linear section", {"model": {"type": "state_space", "input": of.inputs[0], "offset": True}})


FAMILY = Family(lambda of: of.timed and len(of.inputs) == 1 and of.level is None, candidates)
