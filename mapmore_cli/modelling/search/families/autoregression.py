"""The output fed back (NARX), fitted and sized in free run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory
from mapmore_cli.modelling.search.situation import Situation

TINY = 1e-6
"""The ridge where delays are near-copies, whose small differences count."""

MOST_INPUTS = 4
MOST_SELECTED = 3_000
"""Training samples, up to which terms are chosen in free run too."""


def candidates(of: Situation) -> Iterator[Candidate]:
    """Two delays: linear, with products, and with products chosen in free run."""
    output, inputs = {"of": [of.target], "steps": [1, 2], "constant": False}, [*of.inputs]
    free: dict[str, Any] = {"ridge": TINY, "criterion": "free_run"}
    now = [{"lags": output}, {"lags": {"of": inputs, "steps": [0, 1, 2], "constant": False}}]
    yield memory("two delays of the output, linear", of, now, 8, **free)
    both = [{"lags": {"of": [of.target, *inputs], "steps": [1, 2], "order": 2}}]
    yield memory("two delays of the output, order 2, one step ahead", of, both, 8, scaling="none", ridge=0.0, stop="bic")
    yield memory("two delays of the output, order 2", of, both, 8, margin=0.0, **free)
    if of.samples <= MOST_SELECTED and len(inputs) <= 2:
        yield memory("two delays of the output, order 2, sized in free run", of, both, 8, margin=0.0, stop="free_run", **free)
        chosen = {**free, "margin": 0.0, "stop": "free_run", "select": "free_run"}
        yield memory("two delays of the output, order 2, chosen in free run", of, both, 8, **chosen)


FAMILY = Family(lambda of: of.timed and 0 < len(of.inputs) <= MOST_INPUTS, candidates)
