"""What a family of candidates is, and the sections of a spec that its candidates share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mapmore_cli.modelling.search.situation import Situation

Entries = Sequence[Mapping[str, Any]]
"""Families of terms, as the `dictionary` of a spec has them."""

RIDGE = 0.002
"""As a fraction of a candidate's variance (ALGORITHMS 1.10)."""

FEWEST_IN_A_SEGMENT = 20
"""Samples of a segment at least."""


@dataclass(frozen=True)
class Candidate:
    """A structure: what it is called, and the sections of a spec that make it (`segment`, `dictionary`, `model`, `fit`, `fuse.KEY`)."""

    words: str
    sections: Mapping[str, Any]


@dataclass(frozen=True)
class Family:
    """Candidates of one kind: when they apply, which they are, and how many of them do not bend between a few levels; None for all."""

    applies: Callable[[Situation], bool]
    candidates: Callable[[Situation], Iterable[Candidate]]
    of_few_levels: int | None = 0


def surface(words: str, of: Situation, dictionary: Entries, terms: int, count: int = 1, backbone: str | None = None) -> Candidate:
    """One function of all inputs on the measured value of the level, in `count` segments of the input that is swept."""
    swept = of.inputs[0]
    cut = {swept: {"method": "even", "count": count, "min_samples": FEWEST_IN_A_SEGMENT}} if count > 1 else {}
    model = {} if backbone is None else {"model": {"backbone": backbone}}
    return Candidate(
        words, {"segment": {**pooled(of), **cut}, "dictionary": dictionary, **model, "fit": {"max_terms": terms, "stop": "bic"}}
    )


def memory(words: str, of: Situation, dictionary: Entries, terms: int, **fit: Any) -> Candidate:
    """One model along whole recordings; its states are scaled, and its terms pruned with a ridge."""
    fit = {"scaling": "range", "ridge": RIDGE, "max_terms": terms, **fit}
    return Candidate(words, {"segment": pooled(of), "dictionary": dictionary, "fit": fit})


def pooled(of: Situation) -> dict[str, Any]:
    """Return the section that takes all levels together."""
    return {} if of.level is None else {of.level: "none"}


def monomials(of: Sequence[str], order: int) -> dict[str, Any]:
    """Every product of the inputs as they are now, for a model with memory."""
    return {"lags": {"of": [*of], "steps": [0], "order": order, "constant": False}}


def products(of: Sequence[Any], order: int = 2, partners: Sequence[str] | None = None) -> dict[str, Any]:
    """Every product of states, or of at most one besides the `partners`."""
    return {"products": {"of": [*of], "order": order, "constant": False, **({} if partners is None else {"with": [*partners]})}}
