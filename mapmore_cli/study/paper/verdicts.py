"""Verdicts by declared rules. Values, sizes, orders, bounds, words and sentences are counted apart, and each says how closely it agrees."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from scipy.stats import kendalltau

from mapmore_cli.domain.arrays import Array
from mapmore_cli.reporting.table import Cell
from mapmore_cli.spec.campaign import Verdict

VALUE, SIZE, ORDER, BOUND, WORDS, SENTENCE = "value", "size", "order", "bound", "word", "sentence"


@dataclass(frozen=True)
class Compared:
    """One comparison: what kind, of what, whether it holds, and how closely.

    `closeness` is the distance of a value, ours to the printed one of a size and a bound, and Kendall's tau of an order.
    """

    kind: str
    what: str
    holds: bool
    closeness: float = math.nan
    rule: float = math.nan


def judged(rule: Verdict, what: str, printed: Cell, ours: Cell) -> Compared:
    """Compare two cells by a rule that needs no others; a number that is missing agrees with nothing."""
    if rule.same:
        return Compared(WORDS, what, str(printed) == str(ours))
    theirs, mine = (float(cell) if isinstance(cell, int | float) else math.nan for cell in (printed, ours))
    ratio = mine / theirs if theirs else math.nan
    if rule.within is not None:
        return Compared(VALUE, what, abs(mine - theirs) <= rule.within, abs(mine - theirs), rule.within)
    if rule.factor is not None:
        return Compared(SIZE, what, 1 / rule.factor <= ratio <= rule.factor, ratio, rule.factor)
    return Compared(BOUND, what, mine >= theirs if rule.bound == "at_least" else mine <= theirs, ratio)


def order(what: str, printed: Array, ours: Array) -> Compared:
    """Compare the ranks of two rows of numbers, (n,) each; an order of one is none."""
    tau = float(kendalltau(printed, ours).statistic)
    return Compared(ORDER, what, bool(tau > 1 - 1e-9), tau)


def summary(found: Sequence[Compared]) -> tuple[str, ...]:
    """Say of each kind how many agree, what was compared, and how closely."""
    groups: dict[tuple[str, str, float], list[Compared]] = {}
    for one in found:
        groups.setdefault((one.kind, one.what, -1.0 if math.isnan(one.rule) else one.rule), []).append(one)
    return tuple(_told(kind, what, rule, group) for (kind, what, rule), group in groups.items())


def _told(kind: str, what: str, rule: float, group: Sequence[Compared]) -> str:
    count = f"{sum(one.holds for one in group)} of {len(group)}"
    close = [one.closeness for one in group if math.isfinite(one.closeness)]
    if kind == SENTENCE:
        return f"sentences of the text: {count} hold"
    if kind == WORDS:
        return f"{what}: {count} are the same"
    if not close:
        return f"{what}: {count} agree"
    low, high = f"{min(close):.3g}", f"{max(close):.3g}"
    span = low if low == high else f"{low} to {high}"
    match kind:
        case "value":
            return f"{what}: {count} values within {rule:g} (off by {span})"
        case "size":
            return f"{what}: {count} sizes within a factor of {rule:g} (ours are {span} of the printed)"
        case "order":
            return f"order by {what}: {count} as printed (mean tau {sum(close) / len(close):.2f})"
        case _:
            return f"{what}: {count} beyond the printed bound (ours are {span} of it)"


def counts(found: Sequence[Compared]) -> dict[str, tuple[int, int]]:
    """How many agree, and how many were compared, by kind."""
    kinds = dict.fromkeys(one.kind for one in found)
    return {kind: (sum(o.holds for o in found if o.kind == kind), sum(o.kind == kind for o in found)) for kind in kinds}
