"""Linear models of the next output (ARX), fitted one step ahead: quick, and what a reader tries first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory
from mapmore_cli.modelling.search.situation import Situation

TINY = 1e-6
"""The ridge where delays are near-copies, whose small differences count."""

ORDERS = (1, 2, 4, 8)
"""Samples that are looked back."""

MARGIN = 1.0
"""Of the range, by which the past may leave it: a straight line goes on there, and what diverges is held."""

MOST_INPUTS = 4


def candidates(of: Situation) -> Iterator[Candidate]:
    """Every order."""
    for order in ORDERS:
        yield linear(f"linear, {order} delays of the output, one step ahead", of, order)


def linear(words: str, of: Situation, order: int, **fit: Any) -> Candidate:
    """All terms: little is left one step ahead, so no tolerance ends them."""
    past = {"lags": {"of": [of.target], "steps": [*range(1, order + 1)], "constant": False}}
    driven = {"lags": {"of": [*of.inputs], "steps": [*range(order + 1)], "constant": False}}
    terms = order + (order + 1) * len(of.inputs)
    return memory(words, of, [past, driven], terms, margin=MARGIN, ridge=TINY, tolerance=0.0, **fit)


FAMILY = Family(lambda of: of.timed and 0 < len(of.inputs) <= MOST_INPUTS, candidates)
