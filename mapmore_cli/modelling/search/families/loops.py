"""Loops of any shape, butterflies too: squares, cubes and smooth steps of plays."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, monomials, products
from mapmore_cli.modelling.search.situation import Situation

MANY = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45]
FEW = [0.1, 0.2, 0.3, 0.4]
PLACES, SLOPES = (0.2, 0.35, 0.5, 0.65, 0.8), (0.05, 0.2)
"""Of smooth steps, as parts of the range of the play."""

MOST_INPUTS = 3


def candidates(of: Situation) -> Iterator[Candidate]:
    """Products of plays with each other, up to three, and switches."""
    swept = of.moving[0]
    for terms in (12, 24):
        squares = products([*of.inputs, {"play": {"of": [swept], "widths": MANY}}])
        yield memory(f"squares and products of plays, {terms} terms", of, [squares], terms)
        cubes = products([*of.inputs, {"play": {"of": [swept], "widths": FEW}}], 3)
        yield memory(f"cubes and products of plays, {terms} terms", of, [cubes], terms)
    steps = [f"tanh((play({swept}, {width}) - {place})/{slope})" for width in FEW for place in PLACES for slope in SLOPES]
    switches = {"terms": [*steps, *(f"{swept}*{step}" for step in steps)]}
    yield memory("cubic and smooth steps of plays", of, [monomials(of.inputs, 3), switches], 20)


FAMILY = Family(lambda of: of.timed and len(of.moving) > 0 and len(of.inputs) <= MOST_INPUTS, candidates)
