"""Refuse settings that have no effect on the kind of model that a spec defines."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.study.checks.remedies import NO_TIME
from mapmore_cli.study.diagnostics import Finding, applying
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.dictionary import feeds_back, remembers
from mapmore_cli.study.units import default_unit

ONE = "a dictionary with memory makes one model of whole recordings, without segments"

OF_MEMORY = "remove it, or add terms with memory (`lags`, `slow`, `play`, ...) to the `dictionary`"


def along_recordings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Check the data of a model that runs along recordings: the time must be known, in seconds, the
    samples must be in the order of time, and no single samples may be held out at random.
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
    """Refuse settings that have no effect. A model with memory is not divided into pieces, so that
    settings of pieces have no effect. Without terms with memory, settings of memory have no effect.
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
    """Refuse settings that have no effect because a model with memory is not divided into pieces,
    for example settings of segments and of their joining.
    """
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
            "`margin` limits states that are scaled to their range, and `fit.scaling` scales none",
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
            "`forward` selects more terms than are kept, and the surplus is pruned only with a "
            "ridge",
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
