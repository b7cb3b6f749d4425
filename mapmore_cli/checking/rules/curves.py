"""Check that curves have enough samples, that held-out data lie in the training range, that the
time steps are equal if terms with memory need this, and that equal inputs have one target value.
"""

from __future__ import annotations

import re

import numpy as np

from mapmore_cli.checking.evidence import LITTLE, SOME
from mapmore_cli.checking.names import POSITIONS
from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.domain.arrays import Array, extremes, picked
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.refitting import folds_by_value
from mapmore_cli.modelling.memory.records import sampled
from mapmore_cli.modelling.signals.sampling import MANY, even_share
from mapmore_cli.modelling.validation.repeatability import WORTH, floors
from mapmore_cli.study.checks.competitors import formula_called
from mapmore_cli.study.sections.dictionary import entries_of, texts_in, timed_terms

FEWEST = 5  # smallest number of samples that show the shape of a curve


def few_samples(subject: Subject) -> Issues:
    """Find curves with fewer than five samples, which do not show the shape of the curve."""
    for curve in subject.dataset.curves:
        if curve.size < FEWEST:
            yield Issue(
                "warning",
                "few-samples",
                subject.where("data", "levels"),
                f"{curve.id} has {curve.size} sample{'s' if curve.size > 1 else ''}",
                "leave the level out, widen `levels.within`, or loosen `keep`",
                "data",
            )


def one_fold(subject: Subject) -> Issues:
    """Find a cross-validation over levels or groups if there is only one level or group."""
    data = subject.spec.data
    if not data.split.leaves_out:
        return
    group = data.groups.of if data.groups and data.split.leave_one_group_out else None
    try:
        folds_by_value(subject.dataset, group)
    except DataError as fault:
        place = subject.where("data", "split")
        yield Issue("error", "one-fold", place, fault.message, fault.remedy or "", "data")


def beyond_training(subject: Subject) -> Issues:
    """Find held-out samples outside the training range. They test extrapolation, which is rarely
    intended.
    """
    hold_out, dataset = subject.spec.data.split.hold_out, subject.dataset
    if hold_out is None:
        return
    chosen = dict.fromkeys(filter(None, (dataset.level, *hold_out.quantities)))
    measured = {*subject.spec.data.measured}
    inputs = (name for name in inputs_of_model(subject) if name in measured)
    for name in dict.fromkeys((*chosen, *inputs)):
        training = _split_values(dataset, name, held_out=False)
        validation = _split_values(dataset, name, held_out=True)
        if not training.size:
            continue
        margin = LITTLE * float(np.ptp(training))
        is_inside = (validation >= training.min() - margin) & (
            validation <= training.max() + margin
        )
        outside = validation[~is_inside]
        # if the split does not name the quantity, a few values may lie outside the range by chance
        if outside.size > (0 if name in chosen else SOME * validation.size):
            share = "" if name in chosen else f"{outside.size / validation.size:.0%} of the "
            reached = f"{outside.min():.6g}" + (
                f" to {outside.max():.6g}" if np.ptp(outside) else ""
            )
            within = f"the training range {training.min():.6g} to {training.max():.6g}"
            place = subject.where("data", "split", "validate", name)
            yield Issue(
                "warning",
                "validation-outside",
                place,
                f"{share}validation samples have {name} {reached}, outside {within}",
                "hold out a value inside the training range, unless you want to test extrapolation",
            )


def inputs_of_model(subject: Subject) -> list[str]:
    """Return the inputs of the model, except the time and the targets. Targets are left out even if
    the model uses their past values, because a free run predicts these values.
    """
    spec = subject.spec
    texts = [
        text
        for loc, _, family in entries_of(spec.dictionary)
        for _, text, _ in texts_in(loc, family)
    ]
    formula = formula_called(spec, spec.model.backbone or spec.model.name)
    used = {*spec.segment, *(formula.inputs if formula is not None else ())}
    used |= {name for text in texts for name in re.findall(r"[A-Za-z_]\w*", text)}
    others = {"time", *spec.targets}
    return [name for name in subject.dataset.quantities if name in used - others]


def _split_values(dataset: Dataset, name: str, held_out: bool) -> Array:
    """Return the values of a quantity in the training samples, or in the held-out samples if
    `held_out` is True. From a long curve, only evenly spaced values and the extremes are returned.
    For the level quantity, the value of each sample is the level of its curve.
    """
    parts = []
    for curve in dataset.curves:
        values = (
            curve.columns[name]
            if name != dataset.level or curve.level is None
            else np.full(curve.size, curve.level)
        )
        part = picked(values, curve.held_out == held_out)
        is_long = len(part) > MANY
        parts.append(np.append(even_share(part), extremes(part)) if is_long else part)
    return np.concatenate(parts)


def even_steps(subject: Subject) -> Issues:
    """Require equal time steps in all recordings, unless the model needs only the order of the
    samples. Gaps that the spec does not declare in `gaps`, so that they lie within recordings, give
    a warning, because a model with memory forgets its past at a gap.
    """
    if not subject.spec.runs_over_time:
        return
    curves, spec = subject.dataset.curves, subject.spec
    timed = timed_terms(spec.dictionary) if spec.has_memory else ()
    try:
        step, _, records = sampled(curves, ordered=spec.has_memory and not timed)
    except DataError as fault:
        why = (
            f"; terms of the dictionary count samples or use the time between them: "
            f"{', '.join(timed)}"
            if timed
            else ""
        )
        yield Issue(
            "error",
            "uneven-steps",
            subject.where("data"),
            f"{fault.message}{why}",
            fault.remedy or "",
            "data",
        )
        return
    breaks = len(records) - sum(len(curve.stretches) for curve in curves)
    if breaks > 0:
        middle = int(np.median([record.size for record in records]))
        gaps = f"{breaks} gap{'s' if breaks > 1 else ''}"
        yield Issue(
            "warning",
            "memory-breaks",
            subject.where("data"),
            f"the model forgets its past after {gaps} within recordings; half of the parts "
            f"between gaps have {middle} samples or fewer",
            f"add `resample: {step:.6g} s` to `data`, and `gaps: "
            f"{{longer_than: ..., action: split}}` for gaps that are too long to fill",
        )


def single_valued(subject: Subject) -> Issues:
    """Find loops: the target has two values at the same inputs. A model without memory predicts a
    single value there, so its error is at least half the width of the loop.
    """
    spec, dataset = subject.spec, subject.dataset
    moving = spec.runs_over_time or spec.target in ("hysteresis", "damping", "dynamic")
    if moving or spec.data.cycles is not None or dataset.level is None:
        return
    others = [name for name in spec.data.measured if name != "time"]
    swept = (
        name
        for name in dict.fromkeys(("pressure", *POSITIONS, *others))
        if name in {*dataset.quantities} - {dataset.level, *spec.targets}
        and any(np.ptp(curve.columns[name]) for curve in dataset.curves)
    )
    over = next(swept, None)
    if over is None:
        return
    lowest = floors(
        *([curve.columns[name] for curve in dataset.curves] for name in (over, dataset.target))
    )
    levels = [
        f"{100 * floor:.2g} % at {dataset.curves[number].id}"
        for number, floor in enumerate(lowest)
        if floor > WORTH
    ]
    if levels:
        best = (
            f"no model without memory can reach an error below {', '.join(levels)} of the "
            f"largest {dataset.target}"
        )
        yield Issue(
            "hint",
            "not-single-valued",
            subject.where("target"),
            f"curves over {over} have several values at one place: {best}",
            "if the muscle was loaded and unloaded, separate the branches with `cycles: "
            f"{{over: {over}}}`; otherwise accept this error as the smallest possible",
        )
