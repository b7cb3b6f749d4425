"""Inputs as they are and as they were, and their products."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, monomials
from mapmore_cli.modelling.search.situation import Situation

STEPS = ((0, 1, 2), (0, 2, 8, 32), (0, 1, 2, 4, 8, 16, 32), (0, 4, 16, 64, 128))

MOST_INPUTS = 6
MOST_CUBED = 4
"""Delayed inputs of which products of three are tried."""

SHORTEST = 8
"""Times the longest lag, that the longest recording lasts at least: else lags drop its start."""


def candidates(of: Situation) -> Iterator[Candidate]:
    """Yield a cubic without memory, for reference, and lags of several lengths."""
    yield memory("cubic without memory", of, [monomials(of.inputs, 3)], 12)
    assert of.step is not None
    for steps in STEPS:
        if SHORTEST * steps[-1] * of.step > of.longest:
            continue
        for order in (1, 2, 3):
            if order < 3 or len(of.inputs) * len(steps) <= MOST_CUBED:
                for terms in (12, 24) if order > 1 else (12,):
                    entry = {"lags": {"of": [*of.inputs], "steps": [*steps], "order": order, "constant": False}}
                    yield memory(f"lags {', '.join(map(str, steps))} of order {order}, {terms} terms", of, [entry], terms)


FAMILY = Family(lambda of: of.timed and 0 < len(of.inputs) <= MOST_INPUTS, candidates)
