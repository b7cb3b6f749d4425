"""The output fed back (NARX), fitted and sized in free run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory
from mapmore_cli.modelling.search.families.arx import MOST_INPUTS, TINY, linear
from mapmore_cli.modelling.search.situation import Situation

ORDERS = (1, 2, 4)
"""Samples that a linear model looks back (ARX)."""


def candidates(of: Situation) -> Iterator[Candidate]:
    """Linear models with all their terms; two delays with products. Little is left one step ahead, so no tolerance ends them."""
    free: dict[str, Any] = {"ridge": TINY, "criterion": "free_run", "tolerance": 0.0}
    for order in ORDERS:
        yield linear(f"linear, {order} delays of the output", of, order, criterion="free_run")
    both = [squares(of)]
    yield memory("two delays of the output, order 2, one step ahead", of, both, 8, scaling="none", ridge=0.0, stop="bic")
    yield memory("two delays of the output, order 2", of, both, 8, margin=0.0, **free)


def squares(of: Situation) -> dict[str, Any]:
    """Two delays of the output and of every input, and their products."""
    return {"lags": {"of": [of.target, *of.inputs], "steps": [1, 2], "order": 2}}


FAMILY = Family(lambda of: of.timed and 0 < len(of.inputs) <= MOST_INPUTS, candidates)
