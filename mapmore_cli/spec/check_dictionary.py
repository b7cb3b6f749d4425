"""Checks of candidate terms: texts that are terms, quantities of the study, and the target by its past alone."""

from __future__ import annotations

import re
from collections.abc import Iterator

from mapmore_cli.domain.errors import DataError
from mapmore_cli.modelling.expressions import ExpressionError, Operated, parse, state
from mapmore_cli.modelling.expressions.states import Lagged, Measured, State
from mapmore_cli.spec.diagnostics import Finding, did_you_mean
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.dictionary import Delays, Family, Lags, Polynomial, Products, entries_of, texts_in
from mapmore_cli.spec.tree import Loc

DERIVED = ("damping", "hysteresis")
"""Targets that no column holds: nothing of them can be fed back."""


def terms(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that every text of the dictionary is a term or the name of a state, of quantities of the study."""
    for loc, name, family in entries_of(spec.dictionary):
        for at, text, is_expression in texts_in(loc, family):
            yield from _expression(text, at, spec) if is_expression else _state(text, at, spec, name, family)
        yield from _lags_of_now(loc, family, spec.target_quantity)
        yield from _partners(loc, family)


def _expression(text: str, loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    try:
        term = parse(text)
    except ExpressionError as error:
        yield Finding(loc, f"not an expression: {error.message}", offset=error.position)
        return
    states = [state(name) for name in sorted(term.names)]
    found = [finding for one in states for finding in (*_quantity(one, text, loc, spec), *_target(one, text, loc, spec))]
    yield from found
    of_target = [one.name for one in states if one.quantity == spec.target_quantity]
    if of_target and not found:
        from mapmore_cli.modelling.memory.feedback import parted  # takes long to load, and few specs need it

        try:
            parted(term, of_target)
        except DataError as error:
            yield Finding(loc, error.message, error.remedy)


def _state(text: str, loc: Loc, spec: ExperimentSpec, name: str, family: Family) -> Iterator[Finding]:
    try:
        found = state(text)
    except ExpressionError as error:
        remedy = "name a quantity, or a state with memory, as `play(pressure, 0.16)`"
        yield Finding(loc, f"not the name of a quantity or a state: {error.message}", remedy, offset=error.position)
        return
    yield from _quantity(found, text, loc, spec)
    if isinstance(family, (Lags, Delays)):
        yield from _delayed_target(found, text, loc, spec)
    elif isinstance(family, (Polynomial, Products)):
        yield from _target(found, text, loc, spec)
    else:
        yield from _target(Operated(name, found), text, loc, spec)


def _quantity(found: State, text: str, loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield the quantity that a state is made of is one of the study."""
    have = spec.quantities
    if found.quantity not in have:
        what = f"there is no quantity `{found.quantity}` in this study"
        yield Finding(loc, what, did_you_mean(found.quantity, have), offset=word(found.quantity, text))


def _target(found: State, text: str, loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a state of the target is made of the target some samples ago."""
    target = spec.target_quantity
    if found.quantity != target:
        return
    from mapmore_cli.modelling.memory.feedback import looks_back  # takes long to load, and few specs need it

    if looks_back(found) and spec.target not in DERIVED:
        return
    if isinstance(found, Measured) or spec.target in DERIVED:
        yield _is_target(text, loc, spec)
        return
    remedy = f"let the operator look back: write `{target}[k-1]` in place of `{target}`"
    what = f"`{found.name.partition('(')[0]}` works on `{target}` as it is now, which is the target"
    yield Finding(loc, what, remedy, offset=word(target, text))


def _delayed_target(found: State, text: str, loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield what `lags` and `delays` delay is the target itself, where it is of the target."""
    if found.quantity != spec.target_quantity:
        return
    if spec.target in DERIVED:
        yield _is_target(text, loc, spec)
    elif isinstance(found, Lagged):
        target = spec.target_quantity
        yield Finding(
            loc, f"`{text}` is of the target, and no quantity", f"name `{target}` itself: here it is delayed", offset=word(target, text)
        )
    elif not isinstance(found, Measured):
        yield from _target(found, text, loc, spec)


def _lags_of_now(loc: Loc, family: Family, target: str) -> Iterator[Finding]:
    """Refuse a step of `lags` that is the target as it is now."""
    if isinstance(family, Lags) and target in family.of and 0 in family.steps:
        remedy = "a model cannot explain its target by itself: begin at 1, and give the inputs `lags` of their own"
        yield Finding((*loc, "steps", family.steps.index(0)), f"step 0 of the target `{target}` is the target itself", remedy)


def _partners(loc: Loc, family: Family) -> Iterator[Finding]:
    """Require partners of products to be among their terms; only the fit knows what families within products will be called."""
    if not isinstance(family, Products) or family.partners is None:
        return
    names = [text for text in family.of if isinstance(text, str)]
    for place, partner in enumerate(family.partners if len(names) == len(family.of) else ()):
        if _canonical(partner) not in map(_canonical, names):
            remedy = f"add it to `of`: there are {', '.join(names)}"
            yield Finding((*loc, "with", place), f"`{partner}` is none of the terms that are multiplied", remedy)


def _canonical(text: str) -> str:
    """Return the name of a state, however it is written; what is none is reported elsewhere."""
    try:
        return state(text).name
    except ExpressionError:
        return text


def _is_target(text: str, loc: Loc, spec: ExperimentSpec) -> Finding:
    target = spec.target_quantity
    back = "" if spec.target in DERIVED else f", or let it look back, as `{target}[k-1]`"
    return Finding(
        loc, f"`{target}` is the target", f"a model cannot explain its target by itself: take it out{back}", offset=word(target, text)
    )


def word(name: str, text: str) -> int:
    """Offset of a name in an expression, where it is not part of a longer one."""
    found = re.search(rf"(?<![A-Za-z0-9_]){re.escape(name)}(?![A-Za-z0-9_])", text)
    return found.start() if found else 0
