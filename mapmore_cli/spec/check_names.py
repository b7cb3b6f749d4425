"""Checks of names and terms: they are of quantities of the study, and memory has the time it goes
by and settings that act on it.
"""

from __future__ import annotations

import graphlib
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import get_args

from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.modelling.expressions import ExpressionError, Operated, parse, state
from mapmore_cli.modelling.expressions.states import Lagged, Measured, State
from mapmore_cli.modelling.pieces.recipe import CutByDirection
from mapmore_cli.spec.diagnostics import Finding, did_you_mean, refused, told
from mapmore_cli.spec.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.spec.fields import TargetKind
from mapmore_cli.spec.sections.data import Direction, Rate
from mapmore_cli.spec.sections.dictionary import (
    AlongRange,
    Family,
    Lags,
    Polynomial,
    Products,
    entries_of,
    feeds_back,
    names_in,
    remembers,
    texts_in,
)
from mapmore_cli.spec.sections.logs import FileEntry
from mapmore_cli.spec.tree import Loc
from mapmore_cli.spec.units import default_unit, is_quantity

NO_TIME = "add `time` to `columns`, or `sample_time` to `data`"
ONE = "one model with memory stands in place of the segments"
OF_NOTHING = "a model cannot explain its target by itself"
DERIVED = ("damping", "hysteresis")
"""Targets that no column holds: nothing of them can be fed back."""


def unknown_quantity(
    name: str, have: Sequence[str], loc: Loc, offset: int = 0, on_key: bool = False
) -> Iterator[Finding]:
    """Yield that a name is no quantity of the study, where it is none."""
    if name not in have:
        yield Finding(
            loc,
            f"there is no quantity `{name}` in this study",
            did_you_mean(name, have),
            offset,
            on_key,
        )


def names_of_quantities(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that every quantity that is used is one of the study."""
    if isinstance(spec.target, TargetColumn) and spec.target.column not in spec.quantities:
        target, known = spec.target.column, (*spec.quantities, *get_args(TargetKind))
        what = f"there is no quantity `{target}` in this study, and no kind of target is called so"
        yield Finding(("target", "column"), what, did_you_mean(target, known))
    for loc, name in _uses(spec):
        if name is not None:
            yield from unknown_quantity(name, spec.quantities, loc, on_key=loc[-1] == name)


def _uses(spec: ExperimentSpec) -> Iterator[tuple[Loc, str | None]]:
    """Yield the places that may name a quantity, each with the name."""
    data, hold_out = spec.data, spec.data.split.hold_out
    for name, rule in data.derive.items():
        for key in ("rate_of", "direction_of"):
            yield ("data", "derive", name, key), getattr(rule, key, None)
    files = [
        (("data", "files", i, "keep"), file.keep)
        for i, file in enumerate(data.files)
        if isinstance(file, FileEntry)
    ]
    for loc, conditions in [(("data", "keep"), data.keep), *files]:
        for i, condition in enumerate(conditions):
            yield (*loc, i, "quantity"), condition.quantity
    for name, sigma in data.uncertainty.items():
        yield ("data", "uncertainty", name), name
        is_column = isinstance(sigma, str) and not is_quantity(sigma)
        yield ("data", "uncertainty", name), str(sigma) if is_column else None
    yield ("data", "cycles", "over"), data.cycles.over if data.cycles else None
    yield ("data", "levels", "of"), data.levels.of if data.levels else None
    if hold_out is not None:
        yield ("data", "split", "validate", "of"), hold_out.of
        for name in hold_out.quantities:
            yield ("data", "split", "validate", name), name
    for name, cut in spec.segment.items():
        if (name, cut) != (DIRECTION, "none"):  # takes back the cut of a spec that is extended
            yield ("segment", name), name
        if isinstance(cut, CutByDirection):
            yield ("segment", name, "of"), cut.of
    yield ("validate", "as"), spec.validation.as_
    for name in spec.fuse.extrapolation if isinstance(spec.fuse.extrapolation, Mapping) else ():
        yield ("fuse", "extrapolation", name), name


def derivations(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that derived quantities have names of their own, can be computed, and do not depend on
    themselves.
    """
    needs: dict[str, set[str]] = {}
    for name, rule in spec.data.derive.items():
        loc = ("data", "derive", name)
        if name in spec.data.measured:
            yield Finding(
                loc,
                f"`{name}` is a column and derived as well",
                "give the column another name",
                on_key=True,
            )
        match rule:
            case Rate():
                needs[name] = {rule.rate_of}
                if "time" not in spec.data.quantities:
                    yield Finding(loc, f"the rate `{name}` needs the time", NO_TIME, on_key=True)
            case Direction():
                needs[name] = {rule.direction_of}
            case _:
                needs[name] = {*names_in(rule)}
                yield from expression_findings(rule, loc, spec.quantities)
    try:
        graphlib.TopologicalSorter(needs).prepare()
    except graphlib.CycleError as error:
        circle = [str(name) for name in error.args[1]]
        yield Finding(
            ("data", "derive", circle[0]),
            f"derived in a circle: {' <- '.join(circle)}",
            "break the circle",
            on_key=True,
        )


def expression_findings(text: str, loc: Loc, have: Sequence[str]) -> Iterator[Finding]:
    """Yield what is wrong with an expression of the quantities of a study, as they are at the same
    moment.
    """
    try:
        names = parse(text).names
    except ExpressionError as error:
        yield Finding(loc, f"not an expression: {error.message}", offset=error.position)
        return
    for name in sorted(names):
        quantity = state(name).quantity
        at = _word(quantity, text)
        yield from unknown_quantity(quantity, have, loc, at)
        if name != quantity and quantity in have:
            remedy = "name the state in the `dictionary`, or derive rates by `rate_of`"
            yield Finding(
                loc, f"`{name}` has memory, which derived quantities have not", remedy, offset=at
            )


def clocks(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require the time for what goes by the clock, and names of their own for joined quantities."""
    data = spec.data
    has_time = "time" in data.measured
    for key in ("gaps", "resample"):
        if getattr(data, key) is not None and not has_time:
            yield Finding(f"data.{key}:", f"`{key}` needs the time", NO_TIME)
    taken = set(data.columns)
    for i, join in enumerate(data.join):
        loc = ("data", "join", i)
        if join.on == "time" and not has_time:
            yield Finding(loc, "a join on time needs the time of the first log", NO_TIME)
        if join.match is not None and join.match.first not in (have := sorted(taken - {"time"})):
            remedy = did_you_mean(join.match.first, have) or f"name one of {', '.join(have)}"
            yield Finding(
                (*loc, "match", "first"),
                f"there is no quantity `{join.match.first}` in the first log",
                remedy,
            )
        for name in join.quantities:
            if name in taken:
                yield Finding(
                    (*loc, "columns", name),
                    f"`{name}` is a column already",
                    "give one of both another name",
                    on_key=True,
                )
        taken.update(join.quantities)


# Terms
# --------------------------------------------------------------------------------------------------


def terms(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that every text of the dictionary is a term or the name of a state, of quantities of
    the study.
    """
    target = spec.target_quantity
    for loc, name, family in entries_of(spec.dictionary):
        for at, text, is_expression in texts_in(loc, family):
            yield from (
                _expression(text, at, spec)
                if is_expression
                else _state(text, at, spec, name, family)
            )
        if isinstance(family, Lags) and target in family.of and 0 in family.steps:
            remedy = f"{OF_NOTHING}: begin at 1, and give the inputs `lags` of their own"
            yield Finding(
                (*loc, "steps", family.steps.index(0)),
                f"step 0 of the target `{target}` is the target itself",
                remedy,
            )
        if isinstance(family, Products):
            yield from _partners(family, loc)


def _expression(text: str, loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    try:
        term = parse(text)
    except ExpressionError as error:
        yield Finding(loc, f"not an expression: {error.message}", offset=error.position)
        return
    found = []
    for one in map(state, sorted(term.names)):
        found += [
            *unknown_quantity(one.quantity, spec.quantities, loc, _word(one.quantity, text)),
            *_of_target(one, text, loc, spec),
        ]
    yield from found
    of_target = [name for name in term.names if state(name).quantity == spec.target_quantity]
    if of_target and not found:
        # takes long to load, and few specs need it
        from mapmore_cli.modelling.memory.feedback import (
            parted,
        )

        yield from refused(loc, parted, term, of_target)


def _state(
    text: str, loc: Loc, spec: ExperimentSpec, name: str, family: Family
) -> Iterator[Finding]:
    try:
        found = state(text)
    except ExpressionError as error:
        remedy = "name a quantity, or a state with memory, as `play(pressure, 0.16)`"
        yield Finding(
            loc,
            f"not the name of a quantity or a state: {error.message}",
            remedy,
            offset=error.position,
        )
        return
    yield from unknown_quantity(found.quantity, spec.quantities, loc, _word(found.quantity, text))
    target = spec.target_quantity
    if not isinstance(family, Lags):
        yield from _of_target(
            found
            if isinstance(family, Polynomial | Products | AlongRange)
            else Operated(name, found),
            text,
            loc,
            spec,
        )
    elif spec.target not in DERIVED and found.quantity == target and isinstance(found, Lagged):
        remedy = f"name `{target}` itself: here it is delayed"
        yield Finding(
            loc, f"`{text}` is of the target, and no quantity", remedy, offset=_word(target, text)
        )
    elif spec.target in DERIVED or not isinstance(found, Measured):
        yield from _of_target(found, text, loc, spec)


def _of_target(found: State, text: str, loc: Loc, spec: ExperimentSpec) -> Iterator[Finding]:
    """Require that a state of the target is made of the target some samples ago."""
    target, is_derived = spec.target_quantity, spec.target in DERIVED
    if found.quantity != target:
        return
    # takes long to load, and few specs need it
    from mapmore_cli.modelling.memory.feedback import (
        looks_back,
    )

    if is_derived or isinstance(found, Measured):
        back = "" if is_derived else f", or let it look back, as `{target}[k-1]`"
        yield Finding(
            loc,
            f"`{target}` is the target",
            f"{OF_NOTHING}: take it out{back}",
            offset=_word(target, text),
        )
    elif not looks_back(found):
        what = (
            f"`{found.name.partition('(')[0]}` works on `{target}` as it is now, which is the "
            "target"
        )
        remedy = f"let the operator look back: write `{target}[k-1]` in place of `{target}`"
        yield Finding(loc, what, remedy, offset=_word(target, text))


def _partners(family: Products, loc: Loc) -> Iterator[Finding]:
    """Require partners of products to be among their terms; only the fit knows what families within
    products will be called.
    """
    texts = [text for text in family.of if isinstance(text, str)]
    names = [_state_name(text) for text in texts]
    for place, partner in enumerate(family.partners or () if len(names) == len(family.of) else ()):
        if _state_name(partner) not in names:
            remedy = f"add it to `of`: there are {', '.join(texts)}"
            yield Finding(
                (*loc, "with", place),
                f"`{partner}` is none of the terms that are multiplied",
                remedy,
            )


def _state_name(text: str) -> str:
    """Return the name of a state, however it is written; what is none is reported elsewhere."""
    try:
        return state(text).name
    except ExpressionError:
        return text


def _word(name: str, text: str) -> int:
    """Offset of a name in an expression, where it is not part of a longer one."""
    found = re.search(rf"(?<![A-Za-z0-9_]){re.escape(name)}(?![A-Za-z0-9_])", text)
    return found.start() if found else 0


# Memory
# --------------------------------------------------------------------------------------------------

OF_MEMORY = "remove it, or add terms with memory to the `dictionary`, as `lags`, `slow` or `play`"


def along_recordings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require the time, in seconds, of samples in their order beside their neighbours, where a
    model runs along recordings.
    """
    if not spec.runs_over_time:
        return
    data, hold_out = spec.data, spec.data.split.hold_out
    who, where = "a state-space model", "model.type"
    if spec.has_memory:
        first = next(place for place, entry in enumerate(spec.dictionary) if remembers([entry]))
        who, where = "a model with memory", f"dictionary.{first}"
    has_time = "time" in data.quantities
    yield from told(
        (not has_time, where, f"{who} needs the time", NO_TIME),
        (
            has_time and default_unit("time", spec.units) != "s",
            "units.time:",
            f"{who} goes by the time in s",
            "remove it: columns are converted",
        ),
        (
            data.cycles is not None,
            "data.cycles:",
            f"`cycles` takes samples out of the order of time, and {who} goes by the time",
            "remove `cycles`",
        ),
        (
            hold_out is not None and hold_out.fraction is not None,
            "data.split.validate.fraction:",
            f"{who} runs along all samples, and those drawn at random lie between those that train",
            "hold out the end of every recording, as `last: 0.25`, or whole `recordings`",
        ),
    )


def idle(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require something for the settings of pieces, and for those of memory, to act on."""
    fit, levels, target = spec.fit, spec.data.levels, spec.target_quantity
    if not spec.has_memory:
        without = spec.model.type == "mapmore"
        for key in ("margin", "ridge", "forward") if without else ():
            what = f"`{key}` belongs to terms with memory, and there are none"
            yield from told((key in fit.changed, f"fit.{key}:", what, OF_MEMORY))
        words = (("scaling", "range"), ("stop", "free_run"), ("criterion", "free_run"))
        for key, word in words if without else ():
            what = f"`{key}: {word}` belongs to terms with memory, and there are none"
            yield from told((getattr(fit, key) == word, f"fit.{key}", what, OF_MEMORY))
        return
    for name, cut in spec.segment.items():
        remedy = f"remove it, and name `{name}` in the terms; or write `{name}: none`"
        what = f"{ONE}: `{name}` cannot be cut"
        yield from told((cut != "none", f"segment.{name}:", what, remedy))
    for key in spec.fuse.changed:
        yield Finding(f"fuse.{key}:", f"{ONE}: there is nothing to join", f"remove `{key}`")
    held, forward = levels.of if levels is not None else "", fit.forward or fit.max_terms
    yield from told(
        (
            levels is not None and held not in spec.segment,
            "data.levels:",
            f"{ONE}: it is not interpolated between levels of `{held}`",
            f"add `segment: {{{held}: none}}`, and name `{held}` in the terms where it matters",
        ),
        (
            fit.scaling not in ("none", "range"),
            "fit.scaling",
            f"`{fit.scaling}` scales segments, and {ONE}",
            "write `none`, or `range`",
        ),
        (
            "margin" in fit.changed and fit.scaling != "range",
            "fit.margin:",
            "`margin` clips states that are scaled",
            "add `scaling: range`, or remove it",
        ),
        (
            fit.train_level != "all",
            "fit.train_level:",
            f"{ONE}: it learns from all training levels",
            "remove it, or hold out the other levels by `split`",
        ),
        (
            fit.weight != "sample",
            "fit.weight",
            f"{ONE}: its recordings count by their samples",
            "remove it",
        ),
        (
            fit.loss != "squares" and (fit.ridge != 0.0 or "free_run" in (fit.stop, fit.criterion)),
            "fit.loss",
            f"with memory, `{fit.loss}` weighs errors one step ahead, without a ridge",
            "remove `loss`; or `ridge`, and `free_run`",
        ),
        (
            fit.forward is not None and fit.ridge == 0.0,
            "fit.forward:",
            "terms are pruned only where there is a ridge",
            "add `ridge: auto`, or remove `forward`",
        ),
        (
            fit.ridge != 0.0 and forward < fit.max_terms,
            "fit.forward",
            f"{forward} terms cannot be pruned to `max_terms: {fit.max_terms}`",
            f"write {fit.max_terms} or more, or remove it",
        ),
        (
            fit.criterion == "free_run" and not feeds_back(spec.dictionary, target),
            "fit.criterion:",
            f"nothing of the output {target} is fed back: its free run is its prediction one step "
            "ahead",
            f"remove `criterion`, or add delays, as `lags: {{of: [{target}], steps: [1, 2]}}`",
        ),
    )
