"""Checks of what terms with memory ask of a study, and of settings that only they, or only segments, have a use for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields

from mapmore_cli.modelling.pieces.recipe import Fuse
from mapmore_cli.modelling.selection import AUTO, Fit
from mapmore_cli.spec.check_names import NO_TIME
from mapmore_cli.spec.diagnostics import Finding
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.sections.dictionary import feeds_back, remembers
from mapmore_cli.spec.tree import Loc
from mapmore_cli.spec.units import default_unit

ONE = "one model with memory stands in place of the segments"


def time(spec: ExperimentSpec) -> Iterator[Finding]:
    """Memory goes by the time, in seconds, and samples keep their order and their neighbours."""
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
