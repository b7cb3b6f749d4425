"""The output fed back, with as many terms as free runs choose: it takes long, and is tried last."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory
from mapmore_cli.modelling.search.families.arx import TINY
from mapmore_cli.modelling.search.families.autoregression import squares
from mapmore_cli.modelling.search.situation import Situation

MOST_INPUTS, MOST_SAMPLES = 2, 1_500


def candidates(of: Situation) -> Iterator[Candidate]:
    """Yield two delays; choosing each term in free run takes ten times as long and was never taken."""
    free: dict[str, Any] = {"ridge": TINY, "margin": 0.0, "criterion": "free_run", "stop": "free_run"}
    yield memory("two delays of the output, order 2, sized in free run", of, [squares(of)], 8, **free)


FAMILY = Family(lambda of: of.timed and 0 < len(of.inputs) <= MOST_INPUTS and of.samples <= MOST_SAMPLES, candidates)
