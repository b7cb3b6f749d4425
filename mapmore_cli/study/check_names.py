"""Check names and terms: every quantity exists, a model with memory has a time, and no setting is
without effect.
"""

from __future__ import annotations

import graphlib
import re
from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from typing import get_args

from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.modelling.expressions import ExpressionError, Operated, parse, state
from mapmore_cli.modelling.expressions.states import Lagged, Measured, State
from mapmore_cli.study.diagnostics import Finding, applying, did_you_mean, refused
from mapmore_cli.study.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.study.fields import TargetKind
from mapmore_cli.study.sections.data import Rate
from mapmore_cli.study.sections.dictionary import (
    Family,
    Lags,
    OperatorFamily,
    Products,
    entries_of,
    feeds_back,
    names_in,
    remembers,
    texts_in,
)
from mapmore_cli.study.tree import Loc, values_at
from mapmore_cli.study.units import default_unit, is_quantity

NO_TIME = "add `time` to `columns`, or `sample_time` to `data`"
ONE = "a dictionary with memory makes one model of whole recordings, without segments"
OF_NOTHING = "a model must not use its target as an input"
DERIVED = ("damping", "hysteresis")
"""Targets that are computed and that no column holds, so that terms cannot use their past values.
"""


def unknown_quantity(
    name: str, have: Sequence[str], loc: Loc, offset: int = 0, on_key: bool = False
) -> Iterator[Finding]:
    """Yield a finding if `name` is no quantity of the study."""
    if name not in have:
        yield Finding(
            loc,
            f"there is no quantity `{name}` in this study",
            did_you_mean(name, have),
            offset,
            on_key,
        )


NAMED = (
    *("data.derive.*.rate_of", "data.derive.*.direction_of", "data.keep.*.quantity"),
    *("data.files.*.keep.*.quantity", "data.uncertainty.*", "data.cycles.over", "data.levels.of"),
    *("data.split.validate.of", "segment.*.of", "validate.as"),
)
"""Places of a spec at which a text is the name of a quantity of the study, unless it is a number
with a unit.
"""


def names_of_quantities(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that every quantity that the spec uses is a quantity of the study."""
    if isinstance(spec.target, TargetColumn) and spec.target.column not in spec.quantities:
        target, known = spec.target.column, (*spec.quantities, *get_args(TargetKind))
        fault = (
            f"there is no quantity `{target}` in this study, and no kind of target has this name"
        )
        yield Finding(("target", "column"), fault, did_you_mean(target, known))
    whole = spec.model_dump(by_alias=True)
    for place in NAMED:
        for loc, name in values_at(whole, place):
            if isinstance(name, str) and not is_quantity(name):
                yield from unknown_quantity(name, spec.quantities, loc)
    hold_out, beyond = spec.data.split.hold_out, spec.fuse.extrapolation
    # the word `none` cancels the segments of the spec that this spec extends
    cut = [name for name, how in spec.segment.items() if (name, how) != (DIRECTION, "none")]
    keys: list[tuple[Loc, Collection[str]]] = [
        (("data", "uncertainty"), spec.data.uncertainty),
        (("data", "split", "validate"), hold_out.quantities if hold_out is not None else ()),
        (("segment",), cut),
        (("fuse", "extrapolation"), beyond if isinstance(beyond, Mapping) else ()),
    ]
    for around, names in keys:
        for name in names:
            yield from unknown_quantity(name, spec.quantities, (*around, name), on_key=True)


def derivations(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that derived quantities have names of their own, can be computed, and do not depend on
    themselves.
    """
    needs: dict[str, set[str]] = {}
    for name, rule in spec.data.derive.items():
        loc, is_rate = ("data", "derive", name), isinstance(rule, Rate)
        yield from applying(
            (
                name in spec.data.measured,
                "data.derive.{name}:",
                "`{name}` is both a column and a derived quantity",
                "give one of the two another name",
            ),
            (
                is_rate and "time" not in spec.data.quantities,
                "data.derive.{name}:",
                "the rate `{name}` needs the time",
                NO_TIME,
            ),
            name=name,
        )
        if isinstance(rule, str):
            needs[name] = {*names_in(rule)}
            yield from expression_findings(rule, loc, spec.quantities)
        else:
            needs[name] = {rule.source}
    try:
        graphlib.TopologicalSorter(needs).prepare()
    except graphlib.CycleError as error:
        circle = [str(name) for name in error.args[1]]
        fault = f"these derived quantities depend on each other in a circle: {' <- '.join(circle)}"
        yield Finding(("data", "derive", circle[0]), fault, "break the circle", on_key=True)


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


# Terms
# --------------------------------------------------------------------------------------------------


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


def _term(text: str, states: Sequence[State], loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a state of the target stands in a term as a factor of its own and contains past
    values only.
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


# Memory
# --------------------------------------------------------------------------------------------------

OF_MEMORY = "remove it, or add terms with memory (`lags`, `slow`, `play`, ...) to the `dictionary`"


def along_recordings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that a model that runs along recordings has samples in the order of time, with the time
    in seconds and no sample missing in between.
    """
    if not spec.runs_over_time:
        return
    data, hold_out = spec.data, spec.data.split.hold_out
    who, where = "a state-space model", "model.type"
    if spec.has_memory:
        first = next(place for place, entry in enumerate(spec.dictionary) if remembers([entry]))
        who, where = "a model with memory", f"dictionary.{first}"
    has_time = "time" in data.quantities
    yield from applying(
        (not has_time, where, "{who} needs the time", NO_TIME),
        (
            has_time and default_unit("time", spec.units) != "s",
            "units.time:",
            "{who} needs the time in s",
            "remove this unit: mapmore converts the columns to s",
        ),
        (
            data.cycles is not None,
            "data.cycles:",
            "`cycles` reorders the samples, but {who} needs them in the order of time",
            "remove `cycles`",
        ),
        (
            hold_out is not None and hold_out.fraction is not None,
            "data.split.validate.fraction:",
            "{who} needs whole recordings, but `fraction` holds out single samples at random",
            "hold out the end of every recording (`last: 0.25`), or whole `recordings`",
        ),
        who=who,
    )


def idle(spec: ExperimentSpec) -> Iterator[Finding]:
    """Refuse settings that have no effect: settings for pieces if the model has none, and settings
    for memory if no term has memory.
    """
    if spec.has_memory:
        yield from _of_pieces(spec)
    elif spec.model.type == "mapmore":
        fit, fault = spec.fit, "applies only to terms with memory, and the dictionary has none"
        for key in ("margin", "ridge", "forward"):
            if key in fit.changed:
                yield Finding(f"fit.{key}:", f"`{key}` {fault}", OF_MEMORY)
        for key, word in (("scaling", "range"), ("stop", "free_run"), ("criterion", "free_run")):
            if getattr(fit, key) == word:
                yield Finding(f"fit.{key}", f"`{key}: {word}` {fault}", OF_MEMORY)


def _of_pieces(spec: ExperimentSpec) -> Iterator[Finding]:
    """Refuse settings that have no effect on a single model with memory."""
    fit, levels, target = spec.fit, spec.data.levels, spec.target_quantity
    for name, cut in spec.segment.items():
        remedy = "remove it and use `{name}` in the terms, or write `{name}: none`"
        fault = f"{ONE}, so that `{{name}}` cannot be cut"
        yield from applying((cut != "none", "segment.{name}:", fault, remedy), name=name)
    for key in spec.fuse.changed:
        yield Finding(f"fuse.{key}:", f"{ONE}: there are no segments to join", f"remove `{key}`")
    held, forward = levels.of if levels is not None else "", fit.forward or fit.max_terms
    free_run = "free_run" in (fit.stop, fit.criterion)
    yield from applying(
        (
            levels is not None and held not in spec.segment,
            "data.levels:",
            f"{ONE}, and does not interpolate between levels of `{{held}}`",
            (
                "add `segment: {{{held}: none}}`, and use `{held}` in the terms if the target "
                "depends on it"
            ),
        ),
        (
            fit.scaling not in ("none", "range"),
            "fit.scaling",
            f"`{{fit.scaling}}` scales segments, but {ONE}",
            "write `none` or `range`",
        ),
        (
            "margin" in fit.changed and fit.scaling != "range",
            "fit.margin:",
            "`margin` limits scaled states, and these states are not scaled",
            "add `scaling: range`, or remove it",
        ),
        (
            fit.train_level != "all",
            "fit.train_level:",
            f"{ONE}, which always uses all training levels",
            "remove it, or hold out the other levels with `split`",
        ),
        (
            fit.weight != "sample",
            "fit.weight",
            f"{ONE}, in which every sample has the same weight",
            "remove it",
        ),
        (
            fit.loss != "squares" and (fit.ridge != 0.0 or free_run),
            "fit.loss",
            "with memory, `loss: {fit.loss}` cannot be combined with `ridge` or `free_run`",
            "remove `loss`, or remove `ridge` and `free_run`",
        ),
        (
            fit.forward is not None and fit.ridge == 0.0,
            "fit.forward:",
            "terms are pruned only with a ridge",
            "add `ridge: auto`, or remove `forward`",
        ),
        (
            fit.ridge != 0.0 and forward < fit.max_terms,
            "fit.forward",
            "`forward` selects {fit.forward} terms, fewer than `max_terms: {fit.max_terms}`",
            "write {fit.max_terms} or more, or remove `forward`",
        ),
        (
            fit.criterion == "free_run" and not feeds_back(spec.dictionary, target),
            "fit.criterion:",
            (
                "the model does not feed the output {target} back, so its free run equals its "
                "prediction one step ahead"
            ),
            (
                "remove `criterion`, or add delayed outputs: `lags: "
                "{{of: [{target}], steps: [1, 2]}}`"
            ),
        ),
        fit=fit,
        held=held,
        target=target,
    )


CHECKS = (names_of_quantities, derivations, clocks, terms, along_recordings, idle)
"""The checks of this file. Each yields its findings for a spec."""
