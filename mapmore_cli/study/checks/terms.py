"""Check the terms of a dictionary: each can be read, and its states exist."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator, Sequence

from mapmore_cli.modelling.expressions import ExpressionError, Operated, parse, state
from mapmore_cli.modelling.expressions.states import Lagged, Measured, State
from mapmore_cli.study.checks.remedies import DERIVED, NO_TIME, OF_NOTHING, unknown_quantity
from mapmore_cli.study.diagnostics import Finding, applying, did_you_mean, refused
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.dictionary import (
    Family,
    Lags,
    OperatorFamily,
    Products,
    entries_of,
    texts_in,
)
from mapmore_cli.study.tree import Loc


def expression_findings(text: str, loc: Loc, have: Sequence[str]) -> Iterator[Finding]:
    """Check an expression that may only use the present values of quantities: it can be read, its
    quantities exist, and it contains no state with memory such as `slow(pressure, 0.3)`.
    """
    for part in (yield from _states_in(text, loc, have)):
        if part.name != part.quantity and part.quantity in have:
            remedy = "use the state in the `dictionary` instead, or derive rates by `rate_of`"
            fault = (
                f"`{part.name}` has memory, and derived quantities must depend on the present "
                "sample only"
            )
            yield Finding(loc, fault, remedy, _word(part.quantity, text))


def _states_in(
    text: str, loc: Loc, have: Sequence[str], is_expression: bool = True
) -> Generator[Finding, None, list[State]]:
    """Return the states in a text, and yield a finding for each that is made of an unknown
    quantity. The text is an expression, or the name of one state if `is_expression` is False. If
    the text cannot be read, yield a finding and return an empty list.
    """
    fault, remedy = "an expression", None
    if not is_expression:
        fault = "the name of a quantity or a state"
        remedy = "name a quantity, or a state with memory, for example `play(pressure, 0.16)`"
    try:
        states = [state(name) for name in (sorted(parse(text).names) if is_expression else [text])]
    except ExpressionError as error:
        yield Finding(loc, f"not {fault}: {error.message}", remedy, error.position)
        return []
    for part in states:
        yield from unknown_quantity(part.quantity, have, loc, _word(part.quantity, text))
    return states


def clocks(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that the time is known if `gaps`, `resample` or a join needs it, and that the
    quantities of joined logs have distinct names.
    """
    data = spec.data
    no_time = "time" not in data.measured
    for key in ("gaps", "resample"):
        asked = getattr(data, key) is not None and no_time
        yield from applying((asked, "data.{key}:", "`{key}` needs the time", NO_TIME), key=key)
    names = set(data.columns)
    for i, join in enumerate(data.join):
        have, first = sorted(names - {"time"}), join.match.first if join.match else None
        fault = "a join on time needs the time of the first log"
        yield from applying((join.on == "time" and no_time, f"data.join.{i}", fault, NO_TIME))
        if first is not None and first not in have:
            fault = f"there is no quantity `{first}` in the first log"
            loc: Loc = ("data", "join", i, "match", "first")
            yield Finding(loc, fault, did_you_mean(first, have))
        for name in names & {*join.quantities}:
            yield Finding(
                ("data", "join", i, "columns", name),
                f"`{name}` is already the name of a column",
                "give one of the two another name",
                on_key=True,
            )
        names.update(join.quantities)


def terms(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check every text of the dictionary: it must be a term or the name of a state, and its
    quantities must be quantities of the study.
    """
    target = spec.target_quantity
    for loc, name, family in entries_of(spec.dictionary):
        for at, text, is_expression in texts_in(loc, family):
            states = yield from _states_in(text, at, spec.quantities, is_expression)
            if is_expression:
                yield from _term(text, states, at, spec)
            for part in () if is_expression else states:
                yield from _state(part, text, at, spec, name, family)
        if isinstance(family, Lags) and target in family.of and 0 in family.steps:
            yield Finding(
                (*loc, "steps", family.steps.index(0)),
                f"step 0 of the target `{target}` is the target itself",
                f"{OF_NOTHING}: begin with step 1, and give the inputs `lags` of their own",
            )
        if isinstance(family, Products):
            yield from _partners(family, loc)
    texts = [
        text for at, _, family in entries_of(spec.dictionary) for _, text, _ in texts_in(at, family)
    ]
    is_alone = not (spec.segment or spec.data.levels or spec.model.backbone)
    if is_alone and texts and all(map(_is_constant, texts)):
        fault = "no term contains a quantity, so that the model has no inputs"
        yield Finding(
            "dictionary", fault, "add terms, for example `polynomial: {of: [...], order: 2}`"
        )


def _is_constant(text: str) -> bool:
    """Return True if the text is an expression without quantities. Return False if it contains
    quantities or cannot be read.
    """
    try:
        return not parse(text).names
    except ExpressionError:
        return False


def _term(text: str, states: Sequence[State], loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Check the states of a term that are computed from the target: they must be separate factors
    of the term, and contain only past values.
    """
    wrong = [fault for part in states for fault in _of_target(part, text, loc, spec)]
    yield from wrong
    fed_back = [part.name for part in states if part.quantity == spec.target_quantity]
    if fed_back and not wrong:
        # imported here because it loads slowly, and few specs need it
        from mapmore_cli.modelling.memory.feedback import parted

        yield from refused(loc, parted, parse(text), fed_back)


def _state(
    used: State, text: str, loc: Loc, spec: ExperimentSpec, name: str, family: Family
) -> Iterator[Finding]:
    """Check a state that is listed under the key `of` of a term, for example of an operator. If
    the state is computed from the target, it must contain only past values.
    """
    target = spec.target_quantity
    if isinstance(family, OperatorFamily):
        used = Operated(name, used)
    elif isinstance(family, Lags) and spec.target not in DERIVED:
        if isinstance(used, Lagged) and used.quantity == target:
            fault, remedy = (
                "is a past value of the target, but `lags` needs the name of a quantity",
                "itself, because `lags` delays it",
            )
            at = _word(target, text)
            yield Finding(loc, f"`{text}` {fault}", f"name `{target}` {remedy}", at)
        if not isinstance(used, Operated):
            return
    yield from _of_target(used, text, loc, spec)


def _of_target(used: State, text: str, loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a state uses only past values of the target, if it uses the target."""
    target, is_derived = spec.target_quantity, spec.target in DERIVED
    if used.quantity != target:
        return
    # imported here because it loads slowly, and few specs need it
    from mapmore_cli.modelling.memory.feedback import looks_back

    back = "" if is_derived else f", or use a past value, for example `{target}[k-1]`"
    fault, remedy = f"`{target}` is the target itself", f"{OF_NOTHING}: remove it{back}"
    if not (is_derived or isinstance(used, Measured)):
        if looks_back(used):
            return
        operator = used.name.partition("(")[0]
        fault = f"`{operator}` uses the present value of `{target}`, which is the target"
        remedy = f"use the value one sample before: write `{target}[k-1]` instead of `{target}`"
    yield Finding(loc, fault, remedy, _word(target, text))


def _partners(family: Products, loc: Loc) -> Iterator[Finding]:
    """Check that each name in `with` of `products` is also one of the terms in `of`. If `of`
    contains other kinds of terms, this is checked in the fit, because their terms are not known
    earlier.
    """
    texts = [text for text in family.of if isinstance(text, str)]
    names = [_state_name(text) for text in texts]
    for place, partner in enumerate(family.partners or () if len(names) == len(family.of) else ()):
        if _state_name(partner) not in names:
            fault = f"`{partner}` of `with` is not one of the terms in `of`"
            remedy = f"add it to `of`, which contains: {', '.join(texts)}"
            yield Finding((*loc, "with", place), fault, remedy)


def _state_name(text: str) -> str:
    """Return the canonical name of a state. A malformed text is returned unchanged; another check
    reports it.
    """
    try:
        return state(text).name
    except ExpressionError:
        return text


def _word(name: str, text: str) -> int:
    """Return the index at which a name occurs in an expression as a whole word; 0 if it does not
    occur.
    """
    match = re.search(rf"(?<![A-Za-z0-9_]){re.escape(name)}(?![A-Za-z0-9_])", text)
    return match.start() if match else 0
