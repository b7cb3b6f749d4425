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
    """Yield the faults of an expression in which every quantity stands for its present value."""
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
    """Check that the quantities of states exist, yield findings, and return the states. The text is
    an expression that contains states, or the name of one state.
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
    """Check that the time is known if a setting depends on the clock, and that joined logs have
    quantities with distinct names.
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
    """Check that every text of the dictionary is a term or the name of a state, made of quantities
    of the study.
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
    """Return True for an expression without quantities, and False for a malformed text."""
    try:
        return not parse(text).names
    except ExpressionError:
        return False


def _term(text: str, states: Sequence[State], loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a state that is computed from the target is a separate factor of its term, and
    contains only past values.
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
    """Check that a state used by the operator `name`, or directly by a family, contains only past
    values if it is computed from the target.
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
    """Check that a state of the target is computed from the target some samples ago."""
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
    """Check that the names in `with` of products occur among their terms. If products contain
    families, the check is left to the fit, because the terms of families are not known earlier.
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
    """Return the offset at which a name stands in an expression as a whole word."""
    match = re.search(rf"(?<![A-Za-z0-9_]){re.escape(name)}(?![A-Za-z0-9_])", text)
    return match.start() if match else 0
