"""Surfaces that differ between rise and fall: products with a stop so narrow that it tells the direction."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, products
from mapmore_cli.modelling.search.situation import Situation

WIDTHS = (0.01, 0.05)
"""Half the way until the direction has turned, as parts of the range."""

MOST_INPUTS = 4


def candidates(of: Situation) -> Iterator[Candidate]:
    """Yield a cubic times the direction of each input that moves."""
    for moving in of.moving[:2]:
        for width in WIDTHS:
            direction = f"stop({moving}, {width})"
            words = f"surface for rise and fall of {moving} (within {width:.0%} of its range)"
            yield memory(words, of, [products([*of.inputs, direction], 3, partners=of.inputs)], 12)


FAMILY = Family(lambda of: of.timed and 0 < len(of.inputs) <= MOST_INPUTS, candidates)
