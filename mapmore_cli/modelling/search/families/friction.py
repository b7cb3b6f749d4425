"""Friction and sharp loops: stops of what moves, smooth signs of velocities and of changes, and their products with the inputs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from mapmore_cli.modelling.search.candidate import Candidate, Family, memory, monomials, products
from mapmore_cli.modelling.search.situation import Situation

WIDTHS = [0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32]
"""Half the way until a stop slips, as parts of the range."""

SLOPES = (0.03, 0.2, 0.6)
"""Of a smooth sign, as parts of the root mean square of its argument."""

BEHIND = (1, 3, 8)
"""Steps by which a velocity is followed: force loops over it."""

SHORT, LONG = [1, 2, 4, 8], [2, 4, 8, 16, 32]
"""Lags of the inputs beside the signs."""

MOST_INPUTS = 5


def candidates(of: Situation) -> Iterator[Candidate]:
    """Yield stops alone, then signs of velocities and of differences, with products and lags."""
    moving, inputs = [*of.moving], [*of.inputs]
    stops = {"stop": {"of": moving, "widths": WIDTHS}}
    with_stops = products([*inputs, stops], partners=inputs)
    yield memory("order 2 and stops", of, [monomials(inputs, 2), stops], 16)
    yield memory("order 3, stops and their products with the inputs", of, [monomials(inputs, 3), with_stops], 16)
    rates = signs((f"({name} - {name}[k-{steps}])", size) for (name, steps), size in of.changes.items())
    signed = signs(list(velocities(of)))
    short, long = ({"lags": {"of": inputs, "steps": steps, "constant": False}} for steps in (SHORT, LONG))

    def build(words: str, terms: int, smooth: list[str], *more: dict[str, Any]) -> Candidate:
        times = {"terms": [*smooth, *(f"{name}*{sign}" for name in inputs for sign in smooth)]}
        return memory(f"{words}, {terms} terms", of, [monomials(inputs, 2), times, with_stops, *more], terms, scaling="none")

    lean: list[dict[str, Any]] = [short, {"terms": [*inputs, *signed, *rates]}]
    yield memory("lags and smooth signs, 8 terms", of, lean, 8, scaling="none")
    for terms in (12, 20):
        yield build("order 2, stops, lags and smooth signs of changes", terms, rates, short)
    if signed:
        yield build("order 2, stops and smooth signs", 20, signed)
        yield build("order 2, stops, long lags and smooth signs", 20, signed, long)
        yield build("order 2, stops, lags, smooth signs and signs of changes", 20, [*signed, *rates], short)


def velocities(of: Situation) -> Iterator[tuple[str, float]]:
    """Yield inputs that pass through zero, and what follows them closely, with their root mean square."""
    assert of.step is not None
    for name in (one for one in of.moving if one in of.around_zero):
        yield name, of.around_zero[name]
        for steps in BEHIND:
            yield f"slow({name}, {steps * of.step:.3g})", of.around_zero[name]


def signs(arguments: Iterable[tuple[str, float]]) -> list[str]:
    """Smooth signs of several slopes."""
    return [f"tanh({text}/{slope * size:.2g})" for text, size in arguments for slope in SLOPES]


FAMILY = Family(lambda of: of.timed and bool(of.changes) and len(of.inputs) <= MOST_INPUTS, candidates)
