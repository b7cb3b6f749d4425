"""One smooth surface of all inputs, on the measured value of the level."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, surface
from mapmore_cli.modelling.search.situation import Situation

SIZES = ((1, 4), (2, 6), (3, 8), (4, 12), (5, 16), (5, 24), (6, 30))
"""Orders of the polynomial, and terms at most."""

STEADY = 2
"""The order up to which a polynomial goes on beyond its range; higher ones are held there."""

MOST = 84
"""Terms of a dictionary at most: with many inputs, high orders are left out."""


def candidates(of: Situation) -> Iterator[Candidate]:
    """Polynomials of several orders, and of order 3 in segments."""
    for order, terms in SIZES:
        if count(len(of.inputs), order) <= MOST:
            candidate = surface(f"surface of order {order}, {terms} terms", of, polynomial(of, order), terms)
            yield candidate if order > STEADY else Candidate(candidate.words, {**candidate.sections, "fuse.extrapolation": "continue"})
    for segments in (2, 4, 8) if len(of.inputs) == 1 else (2, 4):
        yield surface(f"surface of order 3 in {segments} segments of {of.inputs[0]}", of, polynomial(of, 3), 6, segments)


def polynomial(of: Situation, order: int) -> list[dict[str, Any]]:
    """Return a dictionary of every monomial of the inputs."""
    return [{"polynomial": {"of": [*of.inputs], "order": order}}]


def count(inputs: int, order: int) -> int:
    """How many monomials there are."""
    return comb(inputs + order, order)


FAMILY = Family(lambda of: bool(of.inputs), candidates, of_few_levels=1)
