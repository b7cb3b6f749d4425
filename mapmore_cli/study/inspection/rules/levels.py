"""Rules about curves and segments: enough samples to fit, and validation data within reach."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.kinds.choices import level_of
from mapmore_cli.fitting.kinds.pieces import cuts_of
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.segmentation import cut_by_course
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.spec.check_study import formula_called
from mapmore_cli.spec.sections.dictionary import entries_of, texts_in
from mapmore_cli.study.inspection.rules import Issue, Subject

FEWEST = 5  # samples that show the shape of a curve
SOME = 0.05  # of the validation samples, that may lie beyond a range that the split does not go by
BEYOND = 0.01  # of the training range, that held-out samples may lie outside


def few_samples(subject: Subject) -> Iterator[Issue]:
    """Find curves of a few samples, which have no shape."""
    for curve in subject.dataset.curves:
        if curve.size < FEWEST:
            message = f"{curve.id} has {curve.size} sample{'s' if curve.size > 1 else ''}"
            remedy = "leave the level out, widen `levels.within`, or loosen `keep`"
            yield Issue("warning", "few-samples", subject.where("data", "levels"), message, remedy, "data")


def segments(subject: Subject) -> Iterator[Issue]:
    """Every segment needs more training samples than terms."""
    spec, dataset = subject.spec, subject.dataset
    fits_decide = any(isinstance(cut, Cuts) and cut.method == "optimal" for cut in spec.segment.values())
    if spec.model.type != "mapmore" or fits_decide:
        return
    by_level = level_of(spec.data.levels, spec.segment) is not None
    try:
        cut = cut_by_course(dataset.curves, by_level, cuts_of(spec.segment), dataset.target)
    except DataError as error:
        yield Issue("error", "empty-segment", subject.where("segment"), error.message, error.remedy or "use fewer segments", "data")
        return
    least = 1 if spec.fit.max_terms == AUTO else spec.fit.most_terms
    for curve in cut:
        short = [piece for piece in curve.segments if len(piece.rows) <= least]
        if short:
            told = ", ".join(f"{piece.id} ({len(piece.rows)})" for piece in short)
            message = f"too few training samples for {least} term(s) in {told}"
            remedy = "use fewer segments, lower `fit.max_terms`, or keep more samples of this curve"
            yield Issue("error", "short-segment", subject.where("segment"), message, remedy, "data")


def beyond_training(subject: Subject) -> Iterator[Issue]:
    """Held-out samples outside of the training range test extrapolation, which is rarely meant."""
    hold_out, dataset = subject.spec.data.split.hold_out, subject.dataset
    if hold_out is None:
        return
    chosen = {*([dataset.level] if dataset.level else ()), *hold_out.quantities}
    for name in dict.fromkeys((*sorted(chosen), *_inputs(subject))):
        training, validation = _values(dataset, name, held_out=False), _values(dataset, name, held_out=True)
        if not training.size:
            continue
        margin = BEYOND * float(np.ptp(training))
        outside = validation[(validation < training.min() - margin) | (validation > training.max() + margin)]
        if outside.size > (0 if name in chosen else SOME * validation.size):
            share = "" if name in chosen else f"{outside.size / validation.size:.0%} of the "
            beyond = f"{outside.min():.6g}" + (f" to {outside.max():.6g}" if np.ptp(outside) else "")
            within = f"the training range {training.min():.6g} to {training.max():.6g}"
            message = f"{share}validation samples have {name} {beyond}, outside of {within}"
            place = subject.where("data", "split", "validate", name)
            yield Issue("warning", "validation-outside", place, message, "hold out an inner value, unless extrapolation is what you test")


def _inputs(subject: Subject) -> list[str]:
    """Return the measured quantities that the model is a function of, but the time; the target has its own past in a free run."""
    spec = subject.spec
    texts = [text for loc, _, family in entries_of(spec.dictionary) for _, text, _ in texts_in(loc, family)]
    formula = formula_called(spec, spec.model.backbone or spec.model.name)
    used = {*spec.segment, *(formula.inputs if formula is not None else ())}
    used |= {name for text in texts for name in re.findall(r"[A-Za-z_]\w*", text)}
    measured = {*spec.data.measured} - {"time", spec.target_quantity}
    return [name for name in subject.dataset.quantities if name in used & measured]


def _values(dataset: Dataset, name: str, held_out: bool) -> Array:
    """Return a quantity's samples on one side of the split; of the level quantity, the levels themselves."""
    parts = []
    for curve in dataset.curves:
        values = curve.columns[name] if name != dataset.level or curve.level is None else np.full(curve.size, curve.level)
        parts.append(values[curve.held_out == held_out])
    return np.concatenate(parts)
