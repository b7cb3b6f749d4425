"""Friction: stops of what moves, smooth signs of what passes through zero, and their products with the inputs."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, monomials, products
from mapmore_cli.modelling.search.situation import Situation

WIDTHS = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32]
"""Half the way until a stop slips, as parts of the range."""

SLOPES = (0.02, 0.1, 0.3, 1.0)
"""Of a smooth sign, as parts of the root mean square of its input."""

MOST_INPUTS = 5


def candidates(of: Situation) -> Iterator[Candidate]:
    """Stops, then smooth signs beside them, then slow states as well."""
    moving, inputs = [*of.moving], [*of.inputs]
    stops = {"stop": {"of": moving, "widths": WIDTHS}}
    yield memory("order 2 and stops", of, [monomials(inputs, 2), stops], 16)
    with_stops = products([*inputs, stops], partners=inputs)
    yield memory("order 3, stops and their products with the inputs", of, [monomials(inputs, 3), with_stops], 16)
    signs = [f"tanh({name}/{width:.2g})" for name, size in of.around_zero.items() if name in moving for width in (s * size for s in SLOPES)]
    if signs:
        smooth = {"terms": [*signs, *(f"{name}*{sign}" for name in inputs for sign in signs)]}
        for terms in (12, 20):
            words = f"order 2, smooth signs, stops and products, {terms} terms"
            yield memory(words, of, [monomials(inputs, 2), smooth, with_stops], terms, scaling="none")
        slow = products([*inputs, {"slow": {"of": moving, "count": 4}}, stops], partners=inputs)
        yield memory("order 2, smooth signs, slow and stops, 20 terms", of, [monomials(inputs, 2), smooth, slow], 20, scaling="none")


FAMILY = Family(lambda of: of.timed and len(of.moving) > 0 and len(of.inputs) <= MOST_INPUTS, candidates)
