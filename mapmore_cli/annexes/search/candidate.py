"""Define candidates: parts of a spec with placeholders, which are words in capitals. The names and
numbers of a study are inserted for them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from math import ceil, comb
from typing import Any

from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.results import Tried
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature import TARGET
from mapmore_cli.modelling.literature.formula import Formula

MOST_PARAMETERS = 28
"""Largest number of parameters of a structure that a search may choose for a table, or that of a
cubic polynomial of all inputs if that is larger. Larger structures are only shown. In a later
round, one parameter for every `SHARE` samples is allowed.
"""

SHARE = 40
"""Smallest number of training samples for each parameter of a structure in a later round."""

SIZED = ("simple", "longer")
"""Kinds whose `max_terms` does not grow with the number of inputs."""

MOST = ("inputs", "most_moving", "samples")
"""Conditions of a candidate in which the given number is the largest that is allowed. In all
others, it is the smallest.
"""

FORMULAS = ("sarosi", "sarosi_hinged", "kerscher")
FORCE = "force"
"""The quantity that formulas of muscles predict."""

DECADES = (10, 30, 100, 300)
"""Time constants in steps, which are used if the longest recording has at least twice as many
steps.
"""


BEYOND = "fuse.extrapolation"
"""Setting for the behaviour of pieces outside the range of each curve."""

WAYS = {
    "saturate": ", held",
    "continue": ", continued",
    "continue_linear": ", going on straight",
}
"""Behaviours of pieces outside the range of each curve, and the words that are added to the name of
a structure that behaves differently from what its file of candidates says.
"""


def way_of(candidate: Tried) -> str:
    """Return the extrapolation of the pieces of a candidate. If the candidate sets none,
    the value at the end of a curve is held.
    """
    return str(candidate.sections.get(BEYOND, "saturate"))


def going_on(candidate: Tried, way: str | None) -> Tried:
    """Return the candidate with another extrapolation of its pieces, or the candidate itself if
    `way` is None.
    """
    if way is None:
        return candidate
    words = candidate.words + WAYS[way] * (way != way_of(candidate))
    return replace(candidate, words=words, sections={**candidate.sections, BEYOND: way})


def offered_structures(family: Mapping[str, Any], of: Situation) -> Iterator[Tried]:
    """Yield the candidates that a family offers for a study, not tried yet: the items of its
    `candidates`, with values in place of their placeholders. The family's settings in `fit` apply
    to candidates that have none of their own.
    """
    if family.get("timed") and not of.timed:
        return
    pooled = {} if of.level is None else {of.level: "none"}
    for one in family["candidates"]:
        if not _applies(one.get("when", {}), of):
            continue
        known = vocabulary(of)
        loops = {name: filled(values, known) for name, values in one.get("for", {}).items()}
        for values in product(*loops.values()):
            words = vocabulary(of, **dict(zip(loops, values, strict=True)))
            parts = {
                key: filled(part, words) for key, part in one.items() if key not in ("when", "for")
            }
            kind, name = parts.pop("kind", family["kind"]), parts.pop("words")
            if "dictionary" in parts:
                fit = {**filled(family["fit"], words), **parts.get("fit", {})}
                if not of.timed and kind not in SIZED:
                    fit["max_terms"] = ceil(fit["max_terms"] * max(len(of.inputs) + 1, 3) / 3)
                parts |= {"segment": {**pooled, **parts.get("segment", {})}, "fit": fit}
            yield Tried(kind, name, parts)


def _applies(when: Mapping[str, int], of: Situation) -> bool:
    """Return True if the study fulfils the requirements of a candidate: at most the given number
    for the keys in `MOST`, at least that number for all others.
    """
    has = {
        "inputs": len(of.inputs),
        "most_moving": len(of.moving),
        "samples": of.samples,
        "least_inputs": len(of.inputs),
        "moving": len(of.moving),
        "steps": of.steps * of.timed,
        "tables": not of.timed,
        "ordered": of.ordered,
        "levels": of.curves if of.level in of.inputs else when.get("levels", 0),
        "by_level": of.level is not None and len(of.inputs) == 2 and of.curves > 1,
    }
    return bool(of.inputs) and all(
        has[key] <= n if key in MOST else has[key] >= n for key, n in when.items()
    )


def vocabulary(of: Situation, **more: Any) -> dict[str, Any]:
    """Return the values of all placeholders; `more` holds the values of the placeholders of a loop
    (`for`).

    - `TARGET`, `LEVEL`, `INPUTS`: the target, the level quantity, and all inputs.
    - `MOVING`: the inputs that move within a recording. `SWEPT`: the input that moves most.
      `OTHERS`: all inputs but `SWEPT`.
    - `SPARE`: each input without which another input still moves.
    - `REST`: the inputs without the input of the loop. `FIRST_REST`: the first input of `REST` that
      moves. `MOVING_REST`: all inputs of `REST` that move.
    - `PLANE`, `QUADRATIC`, `CUBIC`: number of monomials of these polynomials.
    - `SLOW_ORDER`: order of products of slow states.
    - `MANY`: number of terms that the samples support, between `MOST_PARAMETERS` and 200.
    - `FORMULAS`: formulas whose quantities the study has.
    - `AROUND_ZERO`: moving inputs that take both signs. `VELOCITIES`: inputs that take both signs
      and, if at most two inputs move, the rates of the other moving inputs.
    - `DECADES`, `MIDDLE_DECADES`: time constants, s.
    - `BACK`: the lags from 1 to `ORDER`. `NOW_AND_BACK`: the lags from 0 to `ORDER`.
    """
    inputs, moving = [*of.inputs], [*of.moving]
    without = more.get("OUT", more.get("VELOCITY"))
    rest = [name for name in moving if name != without]
    zero = [name for name in moving if name in of.around_zero]
    rates = [name for name in moving if name not in of.around_zero and len(moving) <= 2]
    taus = [steps * of.step for steps in DECADES if 2 * steps <= of.steps] if of.step else []
    monomials = {
        word: comb(len(inputs) + order, order)
        for order, word in enumerate(("PLANE", "QUADRATIC", "CUBIC"), 1)
    }
    return {
        "INPUTS": inputs,
        "MOVING": moving,
        "SWEPT": of.swept,
        "OTHERS": [name for name in inputs if name != of.swept],
        "LEVEL": of.level,
        "SPARE": [name for name in inputs if {*moving} - {name}],
        "TARGET": of.target,
        "REST": [name for name in inputs if name != without],
        "FIRST_REST": rest[:1],
        "MOVING_REST": rest,
        **monomials,
        "MANY": min(max(MOST_PARAMETERS, of.samples // SHARE), 200),
        "SLOW_ORDER": 3 if len(inputs) == 1 else 2,
        "FORMULAS": [name for name in FORMULAS if _is_known(literature.get(name), of)],
        "AROUND_ZERO": zero,
        "VELOCITIES": [*of.around_zero, *(f"rate({name})" for name in rates)],
        "DECADES": taus,
        "MIDDLE_DECADES": taus[1:3],
        "BACK": [*range(1, more.get("ORDER", 0) + 1)],
        "NOW_AND_BACK": [*range(more.get("ORDER", 0) + 1)],
        **more,
    }


def _is_known(formula: Formula, of: Situation) -> bool:
    """Return True if the quantities of a formula are among the inputs, and it has no dimensions and
    fewer parameters than there are samples.
    """
    return (
        of.target == FORCE
        and formula.fitted_to == TARGET
        and {*formula.inputs} <= {*of.inputs}
        and not formula.dimensions
        and len(formula.parameters) < of.samples
    )


WORD = re.compile(r"[A-Z][A-Z_]+|\bN\b")


def filled(part: Any, words: Mapping[str, Any]) -> Any:
    """Return a part of a spec with values in place of its placeholders.

    A placeholder with several values is replaced by a list of them. `{every: TEXT, WORD: values,
    ...}` is replaced by a list with one copy of the text for each of the values.
    """
    match part:
        case str():
            return (
                words[part]
                if part in words
                else WORD.sub(lambda word: str(words.get(word[0], word[0])), part)
            )
        case {"every": text}:
            loops = {name: filled(each, words) for name, each in part.items() if name != "every"}
            return [
                filled(text, {**words, **dict(zip(loops, some, strict=True))})
                for some in product(*loops.values())
            ]
        case Mapping():
            entries = {filled(key, words): filled(one, words) for key, one in part.items()}
            return {key: one for key, one in entries.items() if key == "of" or one != []}
        case list():
            return [each for one in part for each in _spliced(one, filled(one, words))]
    return part


def _spliced(one: object, value: object) -> list[Any]:
    """Return the items by which one item of a list is replaced: all items of `value` if the item is
    a placeholder for several values, and no item if the item describes states whose `of` is empty.
    """
    if isinstance(value, Mapping) and any(
        isinstance(each, Mapping) and each.get("of") == [] for each in value.values()
    ):
        return []
    return value if isinstance(value, list) and not isinstance(one, list) else [value]
