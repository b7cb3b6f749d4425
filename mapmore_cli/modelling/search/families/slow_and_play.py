"""Products of the inputs, of what follows them slowly, and of what follows them with play: lag, creep and loops."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, products
from mapmore_cli.modelling.search.situation import Situation

FINE, MANY = 1e-5, 6
"""The ridge, and how many time constants, where neighbours among slow states differ little and their differences count: creep and drift."""

MOST_INPUTS = 5


def candidates(of: Situation) -> Iterator[Candidate]:
    """All products, products with the inputs alone, and none."""
    moving = [*of.moving]
    states = [*of.inputs, {"slow": {"of": moving, "count": 3}}, {"play": {"of": moving, "count": 3}}]
    yield memory("slow and play, linear", of, [products([*states], 1)], 12)
    for terms in (8, 12, 20):
        yield memory(f"slow and play with all products, {terms} terms", of, [products(states)], terms)
    yield memory("slow and play with products of the inputs, 12 terms", of, [products(states, partners=of.inputs)], 12)
    slow = products([*of.inputs, {"slow": {"of": moving, "count": 4}}], 3 if len(of.inputs) == 1 else 2)
    for terms in (8, 16):
        yield memory(f"slow with all products, {terms} terms", of, [slow], terms)
    finely = products([*of.inputs, {"slow": {"of": moving, "count": MANY}}])
    for terms in (12, 24):
        yield memory(f"slow by {MANY} time constants with all products, {terms} terms", of, [finely], terms, ridge=FINE)


FAMILY = Family(lambda of: of.timed and len(of.moving) > 0 and len(of.inputs) <= MOST_INPUTS, candidates)
