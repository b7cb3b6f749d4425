"""Checks an experiment's names: quantities that are used must be quantities of the study, and memory has the time it goes by."""

from __future__ import annotations

import graphlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields

from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.modelling.expressions import ExpressionError, parse, state
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Fuse
from mapmore_cli.modelling.selection import AUTO, Fit
from mapmore_cli.spec.check_dictionary import word
from mapmore_cli.spec.diagnostics import Finding, did_you_mean
from mapmore_cli.spec.experiment import ExperimentSpec, TargetColumn
from mapmore_cli.spec.sections.data import Direction, Rate
from mapmore_cli.spec.sections.dictionary import feeds_back, remembers
from mapmore_cli.spec.sections.logs import FileEntry, Keep
from mapmore_cli.spec.tree import Loc
from mapmore_cli.spec.units import default_unit

NO_TIME = "add `time` to `columns`, or `sample_time` to `data`"


def names(spec: ExperimentSpec) -> Iterator[Finding]:
    """Every quantity that is used must be one of the study."""
    have = spec.quantities
    for use in _uses(spec):
        if use.name not in have:
            yield Finding(use.loc, f"there is no quantity `{use.name}` in this study", did_you_mean(use.name, have), on_key=use.on_key)


@dataclass(frozen=True)
class _Use:
    """A place that names a quantity; a key where `on_key`."""

    name: str
    loc: Loc
    on_key: bool = False


def _uses(spec: ExperimentSpec) -> Iterator[_Use]:
    data = spec.data
    for name, rule in data.derive.items():
        if isinstance(rule, Rate):
            yield _Use(rule.rate_of, ("data", "derive", name, "rate_of"))
        elif isinstance(rule, Direction):
            yield _Use(rule.direction_of, ("data", "derive", name, "direction_of"))
    yield from _kept(data.keep, ("data", "keep"))
    for i, file in enumerate(data.files):
        if isinstance(file, FileEntry):
            yield from _kept(file.keep, ("data", "files", i, "keep"))
    if data.cycles is not None:
        yield _Use(data.cycles.over, ("data", "cycles", "over"))
    if data.levels is not None:
        yield _Use(data.levels.of, ("data", "levels", "of"))
    if data.split.hold_out is not None:
        for name in data.split.hold_out.quantities:
            yield _Use(name, ("data", "split", "validate", name), on_key=True)
        if data.split.hold_out.of is not None:
            yield _Use(data.split.hold_out.of, ("data", "split", "validate", "of"))
    if isinstance(spec.target, TargetColumn):
        yield _Use(spec.target.column, ("target", "column"))
    for name, cut in spec.segment.items():
        if (name, cut) != (DIRECTION, "none"):  # takes back the cut of a spec that is extended
            yield _Use(name, ("segment", name), on_key=True)
        if isinstance(cut, CutByDirection):
            yield _Use(cut.of, ("segment", name, "of"))
    if spec.validation.as_ is not None:
        yield _Use(spec.validation.as_, ("validate", "as"))
    if isinstance(spec.fuse.extrapolation, Mapping):
        for name in spec.fuse.extrapolation:
            yield _Use(name, ("fuse", "extrapolation", name), on_key=True)


def _kept(conditions: Sequence[Keep], loc: Loc) -> Iterator[_Use]:
    for i, keep in enumerate(conditions):
        yield _Use(keep.quantity, (*loc, i, "quantity"))


def derived(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check that derived quantities have names of their own and do not depend on themselves, and that rates have a time."""
    needs: dict[str, set[str]] = {}
    for name, rule in spec.data.derive.items():
        loc = ("data", "derive", name)
        if name in spec.data.measured:
            yield Finding(loc, f"`{name}` is a column and derived as well", "give the column another name", on_key=True)
        if isinstance(rule, Rate):
            needs[name] = {rule.rate_of}
            if "time" not in spec.data.quantities:
                yield Finding(loc, f"the rate `{name}` needs the time", NO_TIME, on_key=True)
            continue
        if isinstance(rule, Direction):
            needs[name] = {rule.direction_of}
            continue
        try:
            needs[name] = set(parse(rule).names)
        except ExpressionError:
            continue  # found by `expressions`
    try:
        graphlib.TopologicalSorter(needs).prepare()
    except graphlib.CycleError as error:
        circle = [str(name) for name in error.args[1]]
        yield Finding(("data", "derive", circle[0]), f"derived in a circle: {' <- '.join(circle)}", "break the circle", on_key=True)


def clocks(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield what goes by the clock needs a time; joined quantities have names of their own."""
    data = spec.data
    has_time = "time" in data.measured
    needing = {"gaps": data.gaps is not None, "resample": data.resample is not None}
    for key in [key for key, given in needing.items() if given and not has_time]:
        yield Finding(("data", key), f"`{key}` needs the time", NO_TIME, on_key=True)
    taken = set(data.columns)
    for i, join in enumerate(data.join):
        if join.on == "time" and not has_time:
            yield Finding(("data", "join", i), "a join on time needs the time of the first log", NO_TIME)
        if join.match is not None and (join.match.first not in taken or join.match.first == "time"):
            have = sorted(taken - {"time"})
            said = f"there is no quantity `{join.match.first}` in the first log"
            yield Finding(
                ("data", "join", i, "match", "first"), said, did_you_mean(join.match.first, have) or f"name one of {', '.join(have)}"
            )
        for name in join.quantities:
            if name in taken:
                loc = ("data", "join", i, "columns", name)
                yield Finding(loc, f"`{name}` is a column already", "give one of both another name", on_key=True)
        taken.update(join.quantities)


def expressions(spec: ExperimentSpec) -> Iterator[Finding]:
    """Expressions of derived quantities must parse, and use quantities of the study as they are at the same moment."""
    for name, rule in spec.data.derive.items():
        if isinstance(rule, str):
            yield from expression_findings(rule, ("data", "derive", name), spec.quantities)


def expression_findings(text: str, loc: Loc, have: Sequence[str]) -> Iterator[Finding]:
    """Yield what is wrong with an expression of the quantities of a study."""
    try:
        names = parse(text).names
    except ExpressionError as error:
        yield Finding(loc, f"not an expression: {error.message}", offset=error.position)
        return
    for name in sorted(names):
        quantity = state(name).quantity
        at = word(quantity, text)
        if quantity not in have:
            yield Finding(loc, f"there is no quantity `{quantity}` in this study", did_you_mean(quantity, have), offset=at)
        elif name != quantity:
            remedy = "name the state in the `dictionary`, or derive rates by `rate_of`"
            yield Finding(loc, f"`{name}` has memory, which derived quantities have not", remedy, offset=at)


ONE = "one model with memory stands in place of the segments"


def time_of_memory(spec: ExperimentSpec) -> Iterator[Finding]:
    """Require the time, in seconds, of samples in their order beside their neighbours: memory goes by it."""
    if not spec.has_memory:
        return
    data = spec.data
    if "time" not in data.quantities:
        yield Finding(_first(spec), "terms with memory need the time", NO_TIME)
    elif default_unit("time", spec.units) != "s":
        yield Finding(("units", "time"), "terms with memory go by the time in s", "remove it: columns are converted", on_key=True)
    if data.cycles is not None:
        what = f"`cycles` puts samples in the order of `{data.cycles.over}`, and memory goes by the time"
        yield Finding(("data", "cycles"), what, "remove `cycles`", on_key=True)
    if data.split.hold_out is not None and data.split.hold_out.fraction is not None:
        remedy = "hold out the end of every recording, as `last: 0.25`, or whole `recordings`"
        what = "samples drawn at random are held out from between those that train, and memory tells them"
        yield Finding(("data", "split", "validate", "fraction"), what, remedy, on_key=True)


def segments(spec: ExperimentSpec) -> Iterator[Finding]:
    """One model with memory has nothing to cut and to join."""
    if not spec.has_memory:
        return
    for name, cut in spec.segment.items():
        if cut != "none":
            remedy = f"remove it, and name `{name}` in the terms; or write `{name}: none`"
            yield Finding(("segment", name), f"{ONE}: `{name}` cannot be cut", remedy, on_key=True)
    levels = spec.data.levels
    if levels is not None and levels.of not in spec.segment:
        remedy = f"add `segment: {{{levels.of}: none}}`, and name `{levels.of}` in the terms where it matters"
        yield Finding(("data", "levels"), f"{ONE}: it is not interpolated between levels of `{levels.of}`", remedy, on_key=True)
    defaults = Fuse()
    for key in (field.name for field in fields(Fuse)):
        if getattr(spec.fuse, key) != getattr(defaults, key):
            yield Finding(("fuse", key), f"{ONE}: there is nothing to join", f"remove `{key}`", on_key=True)


def settings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield settings of the fit have something to act on."""
    fit, defaults = spec.fit, Fit()
    if spec.has_memory:
        yield from _with_memory(fit)
        yield from _in_free_run(spec)
    elif spec.model.type == "mapmore" and not remembers(spec.dictionary):
        remedy = "remove it, or add a family with memory to the `dictionary`, as `lags`, `slow` or `play`"
        for key in ("margin", "ridge", "forward"):
            if getattr(fit, key) != getattr(defaults, key):
                yield Finding(("fit", key), f"`{key}` belongs to terms with memory, and there are none", remedy, on_key=True)
        for key, word in (("scaling", "range"), ("stop", "free_run"), ("criterion", "free_run"), ("select", "free_run")):
            if getattr(fit, key) == word:
                yield Finding(("fit", key), f"`{key}: {word}` belongs to terms with memory, and there are none", remedy)


def _with_memory(fit: Fit) -> Iterator[Finding]:
    defaults = Fit()
    if fit.scaling not in ("none", "range"):
        yield Finding(("fit", "scaling"), f"`{fit.scaling}` scales segments, and {ONE}", "write `none`, or `range`")
    if fit.margin != defaults.margin and fit.scaling != "range":
        yield Finding(("fit", "margin"), "`margin` clips states that are scaled", "add `scaling: range`, or remove it", on_key=True)
    if fit.train_level != "all":
        remedy = "remove it, or hold out the other levels by `split`"
        yield Finding(("fit", "train_level"), f"{ONE}: it learns from all training levels", remedy, on_key=True)
    if fit.forward is None:
        return
    if fit.ridge == 0.0:
        remedy = "add `ridge: auto`, or remove `forward`"
        yield Finding(("fit", "forward"), "terms are pruned only where there is a ridge", remedy, on_key=True)
    elif fit.max_terms != AUTO and fit.forward < fit.most_terms:
        remedy = f"write {fit.max_terms} or more, or remove it: three times `max_terms` are chosen then"
        yield Finding(("fit", "forward"), f"{fit.forward} terms cannot be pruned to `max_terms: {fit.max_terms}`", remedy)


def _in_free_run(spec: ExperimentSpec) -> Iterator[Finding]:
    """Yield a free run differs from one step ahead only where the output is fed back; what chooses by it has to be of one mind."""
    fit, target = spec.fit, spec.target_quantity
    for key in ("criterion", "select", "start"):
        if getattr(fit, key) not in ("one_step", "measured") and not feeds_back(spec.dictionary, target):
            what = f"nothing of the output {target} is fed back: its free run is its prediction one step ahead"
            yield Finding(("fit", key), what, f"remove `{key}`, or add delays, as `lags: {{of: [{target}], steps: [1, 2]}}`", on_key=True)
            return
    for key in ("criterion", "stop"):
        if fit.select == "free_run" and getattr(fit, key) != "free_run":
            what = f"terms that are chosen in free run need `{key}: free_run`"
            yield Finding(("fit", "select"), what, f"add `{key}: free_run`, or remove `select`", on_key=True)


def _first(spec: ExperimentSpec) -> Loc:
    """Where the first family with memory stands."""
    return "dictionary", next(place for place, entry in enumerate(spec.dictionary) if remembers([entry]))
