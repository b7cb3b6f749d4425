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

FOLLOWED, LONGER = (10, 30, 100, 300), 2
"""Steps by which inputs are followed, and times these that the longest recording lasts at least."""

MARGIN = 0.15
"""Of the range, by which states may leave it in a run."""

MOST_INPUTS = 3


def candidates(of: Situation) -> Iterator[Candidate]:
    """With time constants by decades, or evenly spread; with a resonance of what moves first, without, and a leaner one."""
    moving = [*of.moving]
    assert of.step is not None
    resonance = {"resonance": {"of": moving[:1]}}
    taus = [steps * of.step for steps in FOLLOWED if LONGER * steps * of.step <= of.longest]
    if len(taus) > 1:
        states = with_plays(of, {"tau": taus}, {"tau": taus[1:3]})
        for words, more in (("resonance and many plays", [resonance]), ("many plays", [])):
            dictionary = [products([*states, *more], partners=of.inputs)]
            yield memory(f"slow by decades, {words}, 12 terms", of, dictionary, 12, forward=36, margin=MARGIN)
    states = with_plays(of, {"count": 4}, {"count": 2})
    for terms in (12, 20):
        dictionary = [products([*states, resonance], partners=of.inputs)]
        yield memory(f"slow, resonance and many plays, {terms} terms", of, dictionary, terms, forward=36)
    yield memory("slow and many plays, 12 terms", of, [products(states, partners=of.inputs)], 12, forward=36)
    lean = [monomials(of.inputs, 3), {"play": {"of": moving, "count": 6}}, products([{"slow": {"of": moving, "count": 4}}])]
    yield memory("cubic, plays and products of slow states, 16 terms", of, lean, 16)


def with_plays(of: Situation, followed: dict[str, Any], behind: dict[str, Any]) -> list[Any]:
    """Return the inputs, what follows them, their plays, and what follows two of the plays."""
    moving = [*of.moving]
    plays = [f"play({name}, {width})" for name in moving for width in DELAYED]
    states = [{"slow": {"of": moving, **followed}}, {"play": {"of": moving, "widths": WIDTHS}}, {"slow": {"of": plays, **behind}}]
    return [*of.inputs, *states]


FAMILY = Family(lambda of: of.timed and len(of.moving) > 0 and len(of.inputs) <= MOST_INPUTS, candidates)
