"""From the dictionary of a spec to the names of its candidate terms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.sections.dictionary import (
    Delays,
    DictionaryEntry,
    Lags,
    Polynomial,
    Products,
    Resonance,
    Saturate,
    Slow,
    Widths,
)


@dataclass(frozen=True)
class Clock:
    """What terms with memory go by, in s: the time between samples, and the duration of the longest piece that trains."""

    step: float
    longest: float


def terms_of(dictionary: Sequence[DictionaryEntry], clock: Clock | None = None) -> tuple[str, ...]:
    """Names of all candidate terms in the order of the dictionary, each once; terms with memory need a `clock`.

    Raises
    ------
    SpecError
        Where products are wanted with a term that is none of theirs.
    DataError
        Where there would be more of them than memory allows.
    """
    return tuple(dict.fromkeys(term for entry in dictionary for term in _terms(entry, clock, constant=True)))


def _terms(entry: DictionaryEntry, clock: Clock | None, *, constant: bool) -> Sequence[str]:
    """The terms of one family; within products, where `constant` is false, without the constant."""
    from mapmore_cli.modelling.terms import parse, to_text

    name, family = entry.family
    if isinstance(family, list):
        return [to_text(parse(text)) for text in family]
    if isinstance(family, Products):
        return _products(family, clock, constant=constant)
    of = list(dict.fromkeys(_canonical(text) for text in family.of))
    if isinstance(family, Polynomial):
        return _monomials(of, family, constant=constant)
    if isinstance(family, Lags):
        from mapmore_cli.modelling.memory.families import lags

        return _monomials(lags(of, list(dict.fromkeys(family.steps))), family, constant=constant)
    return _STATES[name](of, family, clock)


def _canonical(text: str) -> str:
    from mapmore_cli.modelling.terms import state

    return state(text).name


def _monomials(of: Sequence[str], family: Polynomial | Lags, *, constant: bool) -> list[str]:
    from mapmore_cli.modelling.memory.families import products
    from mapmore_cli.modelling.terms import to_text

    return [to_text(term) for term in products(of, family.order, constant=family.constant and constant)]


def _products(family: Products, clock: Clock | None, *, constant: bool) -> list[str]:
    from mapmore_cli.modelling.memory.families import products
    from mapmore_cli.modelling.terms import to_text

    parts = [[_canonical(part)] if isinstance(part, str) else _terms(part, clock, constant=False) for part in family.of]
    of = list(dict.fromkeys(term for part in parts for term in part))
    partners = None if family.partners is None else [_canonical(text) for text in family.partners]
    for partner in partners or ():
        if partner not in of:
            raise SpecError(f"products: `{partner}` of `with` is none of the terms `of` them", f"there are {', '.join(of)}")
    return [to_text(term) for term in products(of, family.order, partners, family.constant and constant)]


def _delayed(of: Sequence[str], family: Delays, clock: Clock | None) -> Sequence[str]:
    from mapmore_cli.modelling.memory.families import delays

    assert clock is not None
    return delays(of, family.times, clock.step)


def _slow(of: Sequence[str], family: Slow, clock: Clock | None) -> Sequence[str]:
    from mapmore_cli.modelling.memory.families import operated, spread_times

    assert clock is not None
    return operated("slow", of, family.tau or spread_times(family.count or 1, clock.step, clock.longest))


def _operated(operator: str) -> _States:
    def names(of: Sequence[str], family: Widths, _clock: Clock | None) -> Sequence[str]:
        from mapmore_cli.modelling.memory.families import operated, spread_widths

        return operated(operator, of, family.widths or spread_widths(family.count or 1))

    return names


def _resonance(of: Sequence[str], family: Resonance, _clock: Clock | None) -> Sequence[str]:
    from mapmore_cli.modelling.memory.families import resonances

    found = () if family.frequency is None or family.damping is None else (family.frequency, family.damping)
    return resonances(of, found)


def _saturated(of: Sequence[str], _family: Saturate, _clock: Clock | None) -> Sequence[str]:
    from mapmore_cli.modelling.memory.families import operated

    return operated("saturate", of)


_States = Callable[[Sequence[str], Any, Clock | None], Sequence[str]]
"""Names of states with memory, given what they work on and the settings of their family."""

_STATES: Mapping[str, _States] = MappingProxyType(
    {
        "delays": _delayed,
        "slow": _slow,
        "play": _operated("play"),
        "stop": _operated("stop"),
        "resonance": _resonance,
        "saturate": _saturated,
    }
)
