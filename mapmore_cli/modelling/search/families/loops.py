"""Loops of any shape, butterflies too: products of plays, and of smooth switches that plays drive."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, monomials, products
from mapmore_cli.modelling.search.situation import Situation

MANY = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45]
FEW = [0.1, 0.2, 0.3, 0.4]
PLACES, STEEP = (0.2, 0.35, 0.5, 0.65, 0.8), (0.05, 0.2)
SLOPES = (0.04, 0.12, 0.3)
"""Of smooth switches, as parts of the range of the play; those in the middle are multiplied with each other: even functions of a state."""

SMALL = 1e-4
"""The ridge where neighbours among plays differ little, and their differences count."""

MOST_INPUTS = 3


def candidates(of: Situation) -> Iterator[Candidate]:
    """Products of plays with each other, up to three; switches, and their products."""
    swept = of.moving[0]
    squares = products([*of.inputs, {"play": {"of": [swept], "widths": MANY}}])
    yield memory("products of two plays, 12 terms", of, [squares], 12)
    yield memory("products of two plays, 24 terms", of, [squares], 24, ridge=SMALL)
    cubes = products([*of.inputs, {"play": {"of": [swept], "widths": FEW}}], 3)
    yield memory("products of three plays, 24 terms", of, [cubes], 24)
    anywhere = [switch(swept, width, place, slope) for width in FEW for place in PLACES for slope in STEEP]
    yield memory("cubic and switches, 20 terms", of, [monomials(of.inputs, 3), {"terms": driven(swept, anywhere)}], 20)
    middle = [switch(swept, width, 0.5, slope) for width in MANY[1:] for slope in SLOPES]
    pairs = [f"{one}*{other}" for one, other in combinations_with_replacement(middle, 2)]
    yield memory(
        "cubic, switches and their products, 24 terms", of, [monomials(of.inputs, 3), {"terms": driven(swept, middle) + pairs}], 24
    )


def switch(name: str, width: float, place: float, slope: float) -> str:
    """Return a smooth step of a play."""
    return f"tanh((play({name}, {width}) - {place})/{slope})"


def driven(name: str, switches: list[str]) -> list[str]:
    """Switches, and each times the input."""
    return [*switches, *(f"{name}*{one}" for one in switches)]


FAMILY = Family(lambda of: of.timed and len(of.moving) > 0 and len(of.inputs) <= MOST_INPUTS, candidates)
