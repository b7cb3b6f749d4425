"""States of friction: Coulomb's sign of a velocity, now, before and followed slowly, and Dahl's of a position."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, products
from mapmore_cli.modelling.search.situation import Situation

BEFORE = (2, 4)
"""Steps by which force may follow the sign of a velocity."""

SHARP, SMOOTH = 0.001, 0.05
"""Widths of the sign, as parts of the range of the velocity."""

RATE = 40
"""Of Dahl's state: the inverse of the way in which it follows, as a part of the range."""

TIMES = 6
"""Time constants by which inputs and the sign are followed."""

RIDGE = 1e-5
MOST_RATES = 2
"""Inputs that move, up to which the sign of each one's rate is tried."""

MOST_INPUTS = 5


def candidates(of: Situation) -> Iterator[Candidate]:
    """With each input that takes both signs as the velocity: products of order 3 with its past, of order 2 with what follows slowly."""
    for velocity in (name for name in of.moving if name in of.around_zero):
        others = [name for name in of.inputs if name != velocity]
        delayed = [velocity, *(f"{velocity}[k-{steps}]" for steps in BEFORE)]
        states: list[Any] = [*delayed, {"coulomb": {"of": delayed, "v": [SMOOTH]}}, *others]
        moving = [name for name in of.moving if name != velocity]
        dahl = [{"dahl": {"of": moving[:1], "rate": [RATE]}}] if moving else []
        if len(of.inputs) <= 2:
            yield memory(f"sign of {velocity} and its past, order 3, 30 terms", of, [products([*states, *dahl], 3)], 30, ridge=RIDGE)
        yield memory(f"sign of {velocity} and its past, order 2, 20 terms", of, [products([*states, *dahl])], 20, ridge=RIDGE)
    for velocity in velocities(of):
        slow = {"slow": {"of": [*of.moving, f"coulomb({velocity}, {SHARP})"], "count": TIMES}}
        states = [*of.inputs, {"coulomb": {"of": [velocity], "v": [SHARP, SMOOTH]}}, slow]
        for order, terms in ((1, 12), (2, 12), (2, 20), (2, 30)):
            words = f"sign of {velocity} followed slowly, order {order}, {terms} terms"
            yield memory(words, of, [products(states, order)], terms, ridge=RIDGE)


def velocities(of: Situation) -> list[str]:
    """Return inputs that take both signs, and the rates of the others where there are at most two."""
    rates = [f"rate({name})" for name in of.moving]
    return [*(name for name in of.moving if name in of.around_zero), *(rates if len(rates) <= MOST_RATES else [])]


FAMILY = Family(lambda of: of.timed and len(of.moving) > 0 and len(of.inputs) <= MOST_INPUTS, candidates)
