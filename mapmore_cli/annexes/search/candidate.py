"""Define candidates: parts of a spec with placeholders. A placeholder is a word in capitals, such
as `TARGET`, which is replaced by a name or a number of the study.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import chain, product
from math import ceil, comb, inf
from typing import Any

from mapmore_cli.annexes.search.situation import Situation
from mapmore_cli.domain.results import Tried
from mapmore_cli.modelling import literature

Named = Mapping[str, Any]
"""Values by name: sections of a spec, with or without placeholders, or the values of placeholders.
"""

MOST_PARAMETERS = 28
"""Largest number of parameters of a structure that a search may choose for a table. If a cubic
polynomial of all inputs has more parameters, its number is used instead. Larger structures are only
shown. In a later round, one parameter for every `SHARE` samples is allowed, if this is more.
"""

SHARE = 40
"""Smallest number of training samples for each parameter of a structure in a later round."""

SIZED = ("simple", "longer")
"""Kinds whose `max_terms` does not grow with the number of inputs."""

FORMULAS = ("sarosi", "sarosi_hinged", "kerscher")
FORCE = "force"
"""The quantity that the formulas of muscles predict."""

DECADES = (10, 30, 100, 300)
"""Time constants, as multiples of the time step. A time constant is used if the longest recording
is at least twice as long.
"""

BEYOND = "fuse.extrapolation"
"""Setting for the behaviour of pieces outside the range of each curve."""

WAYS = {
    "saturate": ", held",
    "continue": ", continued",
    "continue_linear": ", going on straight",
}
"""Ways in which pieces may behave outside the range of each curve. Each has words that are added to
the name of a structure, if the structure behaves in another way than its file of candidates says.
"""


def continuations(candidate: Tried) -> list[Tried]:
    """Return copies of a candidate, one for each behaviour in `WAYS` outside the range of a curve.
    The first copy has the behaviour that the candidate itself sets; if it sets none, it holds the
    value at the end of the curve.
    """
    own = candidate.sections.get(BEYOND, "saturate")
    others = {way: added for way, added in WAYS.items() if way != own}
    return [
        replace(
            candidate,
            words=candidate.words + added,
            sections={**candidate.sections, BEYOND: way},
        )
        for way, added in {own: "", **others}.items()
    ]


def offered_structures(family: Named, of: Situation) -> Iterator[Tried]:
    """Yield the candidates that a family offers for a study: the items of its `candidates`, with
    values in place of their placeholders. None of them has been tried yet. Candidates without their
    own settings in `fit` get those of the family.
    """
    if family.get("timed") and not of.timed:
        return
    pooled = {} if of.level is None else {of.level: "none"}
    for one in family["candidates"]:
        entry = {"kind": family["kind"], "when": {}, "for": {}, **one}
        when, loops = entry.pop("when"), entry.pop("for")
        if not _applies(when, of):
            continue
        for values in combinations(loops, vocabulary(of)):
            words = vocabulary(of, **values)
            parts = filled(entry, words)
            kind, name = parts.pop("kind"), parts.pop("words")
            if "dictionary" in parts:
                fit = filled(family["fit"], words) | parts.get("fit", {})
                if not of.timed and kind not in SIZED:
                    fit["max_terms"] = ceil(fit["max_terms"] * max(len(of.inputs) + 1, 3) / 3)
                parts |= {"segment": pooled | parts.get("segment", {}), "fit": fit}
            yield Tried(kind, name, parts)


def _applies(when: Named, of: Situation) -> bool:
    """Return True if the study fulfils the conditions in `when`, which holds a number for each key.
    For the keys in `most`, the property of the study must be at most this number: `inputs: 4`
    requires at most four inputs. For the keys in `least`, it must be at least this number: `steps:
    256` requires at least 256 steps.
    """
    most = {"inputs": len(of.inputs), "most_moving": len(of.moving), "samples": of.samples}
    least = {
        "least_inputs": len(of.inputs),
        "moving": len(of.moving),
        "steps": of.steps * of.timed,
        "tables": not of.timed,
        "ordered": of.ordered,
        "levels": of.curves if of.level in of.inputs else inf,
        "by_level": of.level is not None and len(of.inputs) == 2 and of.curves > 1,
    }
    return bool(of.inputs) and all(
        most[key] <= n if key in most else least[key] >= n for key, n in when.items()
    )


def vocabulary(of: Situation, **more: Any) -> dict[str, Any]:
    """Return the values of all placeholders; `more` holds the values of the placeholders of a loop
    (`for`).

    - `TARGET`, `LEVEL`, `INPUTS`: the target, the level quantity, and all inputs.
    - `MOVING`: the inputs that move within a recording. `SWEPT`: the input that moves most.
      `OTHERS`: all inputs except `SWEPT`.
    - `SPARE`: the inputs that can be left out, because another input moves.
    - `REST`: the inputs without the input of the loop. `FIRST_REST`: the first input of `REST` that
      moves. `MOVING_REST`: all inputs of `REST` that move.
    - `PLANE`, `QUADRATIC`, `CUBIC`: number of monomials in a polynomial of order 1, 2 and 3.
    - `MANY`: one term for every `SHARE` training samples, but at least `MOST_PARAMETERS` and at
      most 200.
    - `FORMULAS`: formulas of muscles whose quantities the study has and that have fewer parameters
      than there are training samples.
    - `AROUND_ZERO`: moving inputs that take both signs. `VELOCITIES`: inputs that take both signs
      and, if at most two inputs move, the rates of the other moving inputs.
    - `DECADES`: time constants, s. `MIDDLE_DECADES`: the second and the third of them.
    """
    inputs, moving, count = [*of.inputs], [*of.moving], len(of.inputs)
    without = more.get("OUT", more.get("VELOCITY"))
    rest = [name for name in moving if name != without]
    others = [name for name in moving if name not in of.around_zero]
    taus = [steps * of.step for steps in DECADES if of.step and 2 * steps <= of.steps]
    formulas = [
        name
        for name in FORMULAS
        if of.target == FORCE
        and {*literature.get(name).inputs} <= {*inputs}
        and len(literature.get(name).parameters) < of.samples
    ]
    return {
        "INPUTS": inputs,
        "MOVING": moving,
        "SWEPT": of.inputs[0],
        "OTHERS": inputs[1:],
        "LEVEL": of.level,
        "SPARE": [name for name in inputs if {*moving} - {name}],
        "TARGET": of.target,
        "REST": [name for name in inputs if name != without],
        "FIRST_REST": rest[:1],
        "MOVING_REST": rest,
        "PLANE": count + 1,
        "QUADRATIC": comb(count + 2, 2),
        "CUBIC": comb(count + 3, 3),
        "MANY": min(max(MOST_PARAMETERS, of.samples // SHARE), 200),
        "FORMULAS": formulas,
        "AROUND_ZERO": [name for name in moving if name in of.around_zero],
        "VELOCITIES": [*of.around_zero, *(f"rate({name})" for name in others if len(moving) <= 2)],
        "DECADES": taus,
        "MIDDLE_DECADES": taus[1:3],
        **more,
    }


WORD = re.compile(r"[A-Z][A-Z_]+|\bN\b")


def filled(part: Any, words: Named) -> Any:
    """Return a part of a spec with values in place of its placeholders.

    If an item of a list is replaced by several values, all of them become items of the list.
    `{every: TEXT, WORD: values, ...}` is replaced by a list that contains TEXT once for each of the
    values of WORD. A key whose value is an empty list or an empty mapping is left out. A mapping
    whose key `of` is an empty list is left out as a whole.
    """
    match part:
        case str():
            text = WORD.sub(lambda word: str(words.get(word[0], word[0])), part)
            return words.get(part, text)
        case {"every": text, **loops}:
            return [filled(text, {**words, **own}) for own in combinations(loops, words)]
        case Mapping():
            entries = {filled(key, words): filled(one, words) for key, one in part.items()}
            if entries.get("of") == []:
                return {}
            return {key: one for key, one in entries.items() if one not in ([], {})}
        case list():
            items = (filled(one, words) for one in part)
            lists = (item if isinstance(item, list) else [item] for item in items if item != {})
            return [*chain.from_iterable(lists)]
    return part


def combinations(loops: Mapping[Any, Any], words: Named) -> Iterator[Named]:
    """Yield each combination of the values of several placeholders, as a mapping from the
    placeholder to its value.
    """
    values = {name: filled(each, words) for name, each in loops.items()}
    for some in product(*values.values()):
        yield dict(zip(values, some, strict=True))
