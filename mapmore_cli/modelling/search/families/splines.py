"""Cubic splines of the input that is swept, straight along all others."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family, surface
from mapmore_cli.modelling.search.situation import Situation

KNOTS = tuple(round(0.1 * place, 1) for place in range(1, 10))
"""Where two cubics meet, as parts of the range of the input."""

MOST_INPUTS = 3


def candidates(of: Situation) -> Iterator[Candidate]:
    """Powers of the input and of its distance from each knot, each of them also times every other input."""
    swept, *others = of.inputs
    along = ["1", swept, f"{swept}^2", f"{swept}^3", *(f"abs({swept}-{knot})^3" for knot in KNOTS)]
    dictionary = [{"terms": [*along, *(f"{other}*{text}" if text != "1" else other for other in others for text in along)]}]
    yield surface(f"cubic splines of {swept}, 12 terms", of, dictionary, 12)


FAMILY = Family(lambda of: 0 < len(of.inputs) <= MOST_INPUTS, candidates, of_few_levels=None)
