"""Continue a search in later rounds with further candidates, if a black box has a clearly smaller
error than the structure that was found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter

import numpy as np

from mapmore_cli.annexes.search.bench import Bench
from mapmore_cli.annexes.search.black_boxes import BLACK_BOX, SHOWN
from mapmore_cli.domain.results import Search
from mapmore_cli.modelling.validation.significance import NOTHING, PRICE

ROUNDS = ("second", "third")
"""Files of candidates, one for each later round."""

LESS = 0.9
"""A black box is clearly better if its error is below this multiple of the error of the structure
that was found.
"""

GAIN = 0.05
"""Smallest gain for which the search continues: the decrease of the logarithm of the error, minus
`PRICE` times the logarithm of the ratio of the numbers of parameters.
"""


def outdone_note(result: Search, bench: Bench) -> str:
    """Return a note if the error of a black box is clearly smaller than that of the structure that
    was found; otherwise an empty text. If the study mostly holds out whole parts of the data, the
    errors on left-out parts are compared; otherwise, the errors on left-out stretches.
    """
    asked = attrgetter("parts" if bench.asks_parts else "error")
    boxes = [one for one in result.tried if one.family == BLACK_BOX]
    least = min(boxes, key=asked, default=result.found)
    ratio = asked(result.found) / max(asked(least), NOTHING)
    note = (
        f"the error of {least.words} on left-out data is smaller by a factor of {ratio:.2g}, so "
        "that the chosen structure lacks something"
    )
    return note if ratio > 1 / LESS else ""


def go_on(first: Search, bench: Bench, with_round: Callable[[str], Search]) -> Search:
    """Return the choice after later rounds.

    A round begins if a black box is clearly better than the structure found so far. The rounds end
    if the best structure of a round gains less than `GAIN`. Then the structure found before is
    kept, unless a structure of the round has a smaller error and no more parameters.

    - `first`: result of the first round.
    - `with_round`: function that also tries the candidates of a file, and chooses among all
      structures that were tried so far.
    """
    result = first
    for name in ROUNDS:
        if not outdone_note(result, bench):
            break
        longer = replace(with_round(name), short=first.chosen)
        known = longer.tried[result.chosen]
        costs = [
            one.excess + PRICE * np.log(max(one.parameters, 1)) for one in (longer.found, known)
        ]
        if costs[1] - costs[0] < GAIN:
            rivals = [
                one
                for one in longer.tried
                if not one.failure and one.family not in SHOWN
                if one.parameters <= known.parameters
            ]
            least = min([known, *rivals], key=attrgetter("excess"))
            return replace(longer, chosen=longer.tried.index(least))
        result = longer
    return result


def longer_note(result: Search) -> str:
    """Return a note that compares the chosen structure with the choice of the first round; empty if
    there was no later round. The note recommends the choice of the first round only if the chosen
    structure has more parameters.
    """
    if result.short is None:
        return ""
    long, before = result.found, result.tried[result.short]
    if long is before:
        return (
            "the search went on with longer structures, because a black box has a smaller error, "
            f"but none of them gains {100 * GAIN:g} % over {before.words} if its additional "
            "parameters are taken into account"
        )
    compared = (
        f"the error of {long.words} with {long.parameters} parameters on left-out data is smaller "
        f"by a factor of {np.exp(before.excess - long.excess):.3g} than that of {before.words} "
        f"with {before.parameters}, the choice from the list of short structures"
    )
    advice = "; `model: {type: auto, prefer: short}` chooses the short one"
    return compared + advice * (long.parameters > before.parameters)
