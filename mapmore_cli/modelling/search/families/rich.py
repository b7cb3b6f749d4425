"""The states of a coiled muscle: slow, resonance, seven plays and slow plays, times the inputs (ALGORITHMS 1.10)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, monomials, products
from mapmore_cli.modelling.search.situation import Situation

WIDTHS = [0.04, 0.08, 0.16, 0.24, 0.32, 0.40, 0.46]
"""Of plays."""

DELAYED = (0.16, 0.32)
"""Widths of the plays that are followed slowly."""

MOST_INPUTS = 3


def candidates(of: Situation) -> Iterator[Candidate]:
    """With a resonance of what moves first, without, and a leaner one."""
    moving = [*of.moving]
    states: list[Any] = [*of.inputs, {"slow": {"of": moving, "count": 4}}, {"play": {"of": moving, "widths": WIDTHS}}]
    states.append({"slow": {"of": [f"play({name}, {width})" for name in moving for width in DELAYED], "count": 2}})
    for terms in (12, 20):
        dictionary = [products([*states, {"resonance": {"of": moving[:1]}}], partners=of.inputs)]
        yield memory(f"slow, resonance and many plays, {terms} terms", of, dictionary, terms, forward=36)
    yield memory("slow and many plays, 12 terms", of, [products(states, partners=of.inputs)], 12, forward=36)
    lean = [monomials(of.inputs, 3), {"play": {"of": moving, "count": 6}}, products([{"slow": {"of": moving, "count": 4}}])]
    yield memory("cubic, plays and products of slow states, 16 terms", of, lean, 16)


FAMILY = Family(lambda of: of.timed and len(of.moving) > 0 and len(of.inputs) <= MOST_INPUTS, candidates)
