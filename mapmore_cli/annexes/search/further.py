"""The later rounds of a search: the list of candidates goes on where a black box errs clearly less
than the structure that was found.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from operator import attrgetter

from mapmore_cli.annexes.search.bench import Bench
from mapmore_cli.annexes.search.black_boxes import BLACK_BOX, Outcome
from mapmore_cli.domain.results import Search
from mapmore_cli.modelling.validation.significance import PRICE

ROUNDS = ("second", "third")
"""Files of candidates, one for each later round."""

LESS = 0.9
"""Times the error of the structure that was found, below which a black box errs clearly less."""

GAIN = 0.95
"""Times the error of the structure before it, below which that of a later round is taken; the ratio
of their parameters to the power `PRICE` counts as well.
"""


def lacking(result: Search, bench: Bench) -> tuple[str, float] | None:
    """Return the black box that errs clearly less than the structure that was found, on the kind of
    data that is held out, and how many times less; None where no black box does.
    """
    asked = attrgetter("parts" if bench.asks_parts else "error")
    boxes = [one for one in result.tried if one.family == BLACK_BOX]
    least = min(boxes, key=asked, default=result.found)
    error = asked(result.found)
    return (least.words, error / asked(least)) if asked(least) < LESS * error else None


def go_on(
    first: Search,
    bench: Bench,
    try_round: Callable[[str], list[Outcome]],
    choose: Callable[[list[Outcome]], Search],
) -> Search:
    """Return the choice after later rounds.

    A round begins where a black box errs clearly less than the structure found so far. The rounds
    end where the best structure of one gains less than `GAIN`.

    - `first`: what the first round found.
    - `try_round`: tries the candidates of a file.
    - `choose`: chooses among the first round and all outcomes of later rounds.
    """
    result, later = first, list[Outcome]()
    for name in ROUNDS:
        if lacking(result, bench) is None:
            break
        before, tried = result.chosen, try_round(name)
        if not tried:
            continue
        later += tried
        longer = choose(later)
        gained = gain(longer, longer.chosen, before) < GAIN
        result = replace(longer, chosen=longer.chosen if gained else before, short=first.chosen)
        if not gained:
            break
    return result


def gain(result: Search, long: int, short: int) -> float:
    """Return the error of a structure as a fraction of that of a shorter one, as the rule weighs
    the folds, times the ratio of their parameters to the power `PRICE`.
    """
    one, other = result.tried[long], result.tried[short]
    sizes = max(one.parameters, 1) / max(other.parameters, 1)
    return math.exp(one.excess - other.excess + PRICE * math.log(sizes))


def note_of(result: Search) -> str:
    """Return what the later rounds have brought, for the reader of the page."""
    assert result.short is not None
    long, short = result.found, result.tried[result.short]
    if long is short:
        return (
            "the search went on with longer structures, because a black box errs less; none of "
            f"them errs {1 - GAIN:.0%} less than {short.words}, which is taken"
        )
    return (
        f"{long.words} with {long.parameters} parameters errs "
        f"{math.exp(short.excess - long.excess):.2g} times less on left-out data than the best "
        f"short structure, {short.words} with {short.parameters}; `model: {{type: auto, prefer: "
        "short}` takes the short one"
    )
