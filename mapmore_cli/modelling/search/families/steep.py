"""A surface with hinges, or with steep functions at the ends of an input or anywhere along it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, surface
from mapmore_cli.modelling.search.families.surface import polynomial
from mapmore_cli.modelling.search.situation import Situation

WIDTHS = (0.03, 0.1, 0.3)
"""Of an exponential, as parts of the range of its input."""

PLACES, SLOPES = (0, 0.25, 0.5, 0.75, 1), (0.05, 0.15, 0.4)
"""Of a smooth step, as parts of the range of its input."""

FINER, SHARPER = tuple(round(0.1 * place, 1) for place in range(11)), (0.03, 0.08, 0.2)
"""The same where there are at most two inputs, each for the one that is swept."""

MOST_INPUTS = 3

ASIDE = 2
"""Levels beyond the hinge on either side of one along the level."""


def candidates(of: Situation) -> Iterator[Candidate]:
    """Exponentials and smooth steps of each input, times every input; hinges."""
    hinges = [f"abs({name}-{place})" for name in of.inputs for place in PLACES[1:-1] if _told(of, name, min(place, 1 - place) / ASIDE)]
    yield surface("surface of order 2 with hinges, 8 terms", of, [*polynomial(of, 2), {"terms": hinges}], 8)
    widths = {name: [w for w in WIDTHS if _told(of, name, w)] for name in of.inputs}
    at_ends = [text for name in of.inputs for w in widths[name] for text in (f"exp(-{name}/{w})", f"exp(({name}-1)/{w})")]
    anywhere = [f"tanh(({name}-{place})/{slope})" for name in of.inputs for place in PLACES for slope in SLOPES if _told(of, name, slope)]
    for order, terms in ((2, 8), (3, 12)):
        dictionary: list[Any] = [*polynomial(of, order), {"terms": times_inputs(of, at_ends, 2)}]
        yield surface(f"surface of order {order} with exponentials, {terms} terms", of, dictionary, terms)
    for terms in (12, 20):
        dictionary = [*polynomial(of, 3), {"terms": times_inputs(of, anywhere)}]
        yield surface(f"surface of order 3 with smooth steps, {terms} terms", of, dictionary, terms)
    if len(of.inputs) <= 2:
        finer = [f"tanh(({of.inputs[0]}-{place})/{slope})" for place in FINER for slope in SHARPER]
        dictionary = [*polynomial(of, 3), {"terms": times_inputs(of, finer)}]
        yield surface("surface of order 3 with sharp steps, 16 terms", of, dictionary, 16)


def _told(of: Situation, name: str, width: float) -> bool:
    """Whether samples tell what happens over a part of the range of an input: of the level, no less than from one to the next."""
    return name != of.level or width * (of.curves - 1) >= 1


def times_inputs(of: Situation, functions: list[str], powers: int = 1) -> list[str]:
    """Functions, and each of them times powers of every input."""
    factors = [name if power == 1 else f"{name}^{power}" for power in range(1, powers + 1) for name in of.inputs]
    return [text for function in functions for text in (function, *(f"{factor}*{function}" for factor in factors))]


FAMILY = Family(lambda of: 0 < len(of.inputs) <= MOST_INPUTS, candidates)
