"""Make the names of candidate terms from the dictionary of a spec. Also define how derived
quantities, for example rates, are computed, so that a model can compute them from its inputs.
"""

from __future__ import annotations

import graphlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.recording import Signal
from mapmore_cli.modelling.expressions import candidate, parse, state, to_text
from mapmore_cli.modelling.expressions.families import lags, operated, products
from mapmore_cli.modelling.pieces.recipe import CutByDirection
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.data import Direction, Rate
from mapmore_cli.study.sections.dictionary import (
    AlongRange,
    DictionaryEntry,
    Lags,
    Polynomial,
    Products,
    numbers_of,
)
from mapmore_cli.study.units import convert, default_unit


def signal_of(name: str, rule: Rate | Direction, units: Mapping[str, str]) -> Signal:
    """Return the rule by which a derived quantity (a rate or a direction) is computed. `units`
    holds the model's unit of each quantity.
    """
    if isinstance(rule, Direction):
        return Signal(name, "direction", rule.direction_of, dead_band=rule.dead_band)
    return Signal(
        name,
        "rate",
        rule.rate_of,
        window=rule.window,
        order=rule.order,
        factor=convert(1.0, f"{units[rule.rate_of]}/s", units[name]),
        seconds=convert(1.0, units["time"], "s"),
    )


def derivations_of(spec: ExperimentSpec) -> dict[str, str | Rate | Direction]:
    """Return the rules of the derived quantities of a spec, by name. If segments are cut by a
    direction, this direction is included.
    """
    cuts = {name: cut for name, cut in spec.segment.items() if isinstance(cut, CutByDirection)}
    return {
        **spec.data.derive,
        **{
            name: Direction(direction_of=cut.of, dead_band=cut.dead_band)
            for name, cut in cuts.items()
        },
    }


def units_of(spec: ExperimentSpec) -> dict[str, str]:
    """Return the model's unit of every quantity. A rate has the unit of its quantity per unit of
    time, whatever its name.
    """
    rates = {
        name: rule.rate_of for name, rule in spec.data.derive.items() if isinstance(rule, Rate)
    }
    return {name: default_unit(name, spec.units, rates) for name in spec.quantities}


def signals_of(spec: ExperimentSpec) -> tuple[Signal, ...]:
    """Return the rules of all rates and directions of a study. If a quantity is computed from
    another rate or direction, its rule comes after the rule of that other quantity.
    """
    units = units_of(spec)
    signals = {
        name: signal_of(name, rule, units)
        for name, rule in derivations_of(spec).items()
        if not isinstance(rule, str)
    }
    order = graphlib.TopologicalSorter(
        {name: {signal.of} for name, signal in signals.items()}
    ).static_order()
    return tuple(signals[name] for name in order if name in signals)


@dataclass(frozen=True)
class Clock:
    """Two times in s on which terms with memory depend: the time between samples (`step`), and the
    duration of the longest piece of training data (`longest`).
    """

    step: float
    longest: float


def terms_of(dictionary: Sequence[DictionaryEntry], clock: Clock | None = None) -> tuple[str, ...]:
    """Return all candidate terms as texts, in the order of the dictionary and without repetitions.
    Terms with memory need a `clock`.

    Raises SpecError if `with` of `products` contains a term that is not among their factors;
    DataError if the matrices for all products do not fit into memory.
    """
    return tuple(
        dict.fromkeys(term for entry in dictionary for term in _terms(entry, clock, constant=True))
    )


def bounds_of(dictionary: Sequence[DictionaryEntry]) -> dict[str, tuple[float, float]]:
    """Return the smallest and the largest allowed coefficient of each term that has limits, in the
    unit of the target. If several entries contain a term, the limits of the first entry apply.
    """
    return {
        term: entry.limits
        for entry in reversed(dictionary)
        if entry.bounded
        for term in _terms(entry, None, constant=True)
    }


def _terms(entry: DictionaryEntry, clock: Clock | None, *, constant: bool) -> Sequence[str]:
    """Return the terms of one entry of the dictionary. If the entry is a factor of `products`,
    `constant` is False, and the constant term is left out.
    """
    name, family = entry.family
    if isinstance(family, list):
        return [_term_text(text) for text in family]
    if isinstance(family, Products):
        return _products(family, clock, constant=constant)
    if isinstance(family, AlongRange):
        return _along_range(family, constant=constant)
    of = list(dict.fromkeys(_state_name(text) for text in family.of))
    if isinstance(family, Polynomial):
        return _monomial_texts(of, family, constant=constant)
    if isinstance(family, Lags):
        return _monomial_texts(
            lags(of, list(dict.fromkeys(family.steps))), family, constant=constant
        )
    assert clock is not None
    return operated(name, of, numbers_of(name, family, clock.step, clock.longest))


def _along_range(family: AlongRange, *, constant: bool) -> list[str]:
    window = getattr(family, "window", None)
    windows = window if isinstance(window, list) else [window]
    changes = [
        f"({family.of} - {family.of}[k-{steps}]){power}"
        for steps in windows
        for power in ("", "^2")
    ]
    factors = [
        text
        for name in family.partners
        for text in (changes if window and name == "change" else [name])
    ]
    texts = [
        to_text(candidate(f"({factor})*{function}"))
        for factor in ["1", *factors]
        for function in family.functions
    ]
    return texts if constant else [text for text in texts if text != "1"]


@lru_cache(maxsize=4096)  # cached, because a search reads the same terms in every fold
def _term_text(text: str) -> str:
    return to_text(parse(text))


def _state_name(text: str) -> str:
    return state(text).name


def _monomial_texts(of: Sequence[str], family: Polynomial | Lags, *, constant: bool) -> list[str]:
    return [
        to_text(term) for term in products(of, family.order, constant=family.constant and constant)
    ]


def _products(family: Products, clock: Clock | None, *, constant: bool) -> list[str]:
    parts = [
        [_state_name(part)] if isinstance(part, str) else _terms(part, clock, constant=False)
        for part in family.of
    ]
    of = list(dict.fromkeys(term for part in parts for term in part))
    partners = None if family.partners is None else [_state_name(text) for text in family.partners]
    for partner in partners or ():
        if partner not in of:
            raise SpecError(
                f"products: `{partner}` of `with` is not one of the terms in `of`",
                f"add it to `of`, or use one of its terms: {', '.join(of)}",
            )
    return [
        to_text(term) for term in products(of, family.order, partners, family.constant and constant)
    ]
