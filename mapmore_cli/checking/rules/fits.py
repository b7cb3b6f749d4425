"""Check the fit: enough samples for the terms of a segment and for formulas, and a shape that the
data support.
"""

from __future__ import annotations

import numpy as np

from mapmore_cli.checking.rules import Issue, Issues, Subject
from mapmore_cli.checking.rules.curves import inputs_of_model
from mapmore_cli.domain.errors import DataError, FitError
from mapmore_cli.fitting.kinds.choices import level_of
from mapmore_cli.fitting.kinds.dictionary import terms_of
from mapmore_cli.fitting.kinds.pieces import cuts_of
from mapmore_cli.modelling.pieces.recipe import Cuts
from mapmore_cli.modelling.pieces.segmentation import cut_by_course
from mapmore_cli.modelling.shape.support import refuse_unsupported
from mapmore_cli.study.checks.competitors import formula_called, rivals_of
from mapmore_cli.study.sections.dictionary import remembers

FEWER = "use fewer segments, lower `fit.max_terms`, or loosen `data.keep` to have more samples"


def short_segments(subject: Subject) -> Issues:
    """Require more training samples than terms in every segment."""
    spec, dataset = subject.spec, subject.dataset
    if spec.model.type != "mapmore":
        return
    least = _most_terms(subject)
    counts = [int(np.count_nonzero(curve.training)) for curve in dataset.curves]
    cuts = [cut for cut in spec.segment.values() if isinstance(cut, Cuts)]
    # with `method: optimal`, the segments are known only after the fit
    if any(cut.method == "optimal" for cut in cuts):
        yield from _too_many_to_place(subject, cuts, counts)
        return
    if not spec.segment and all(count > least for count in counts if count):
        return
    by_level = level_of(spec.data.levels, spec.segment) is not None
    try:
        cut = cut_by_course(dataset.curves, by_level, cuts_of(spec.segment), dataset.target)
    except DataError as error:
        yield Issue(
            "error",
            "empty-segment",
            subject.where("segment"),
            error.message,
            error.remedy or "use fewer segments",
            "data",
        )
        return
    for curve in cut:
        short = [piece for piece in curve.segments if len(piece.rows) <= least]
        if short:
            sizes = ", ".join(
                f"{segment.id} has {_samples(len(segment.rows))}" for segment in short
            )
            yield _short(subject, f"{sizes}: too few for {least} term{'s' * (least > 1)}")


def _most_terms(subject: Subject) -> int:
    """Return the largest number of terms that a segment can have: `fit.max_terms`, or the number of
    candidate terms if that is smaller and the dictionary has no memory.
    """
    most, dictionary = subject.spec.fit.max_terms, subject.spec.dictionary
    return most if remembers(dictionary) else min(most, len(terms_of(dictionary)) or most)


def _too_many_to_place(subject: Subject, cuts: list[Cuts], counts: list[int]) -> Issues:
    """Find curves with too few samples for `method: optimal`, which places the segment boundaries
    so that the error of the fit is as small as possible.
    """
    each = _most_terms(subject) + 1
    for curve, count in zip(subject.dataset.curves, counts, strict=True):
        for cut in cuts:
            needed = (cut.count or 1) * max(cut.least, each)
            if 0 < count < needed:
                of = f"{cut.count} segments of {max(cut.least, each)} need {needed}"
                yield _short(subject, f"{curve.id} has {_samples(count)}: {of}")


def _samples(count: int) -> str:
    return f"{count} training sample{'s' * (count != 1)}"


def _short(subject: Subject, message: str) -> Issue:
    place = subject.where("segment")
    return Issue("error", "short-segment", place, message, FEWER, "data")


def few_for_formula(subject: Subject) -> Issues:
    """Find formulas that have more parameters than there are training samples. The model, its
    backbone and the competitors are examined.
    """
    spec, dataset = subject.spec, subject.dataset
    count = sum(int(np.count_nonzero(curve.training)) for curve in dataset.curves)
    keys = ((("model", key), getattr(spec.model, key, None)) for key in ("name", "backbone"))
    for loc, name in (*keys, *((loc, rival.model) for loc, rival in rivals_of(spec))):
        formula = formula_called(spec, name)
        if formula is not None and 0 < count < len(formula.fitted):
            yield Issue(
                "error",
                "few-for-formula",
                subject.where(*loc),
                f"{name} has {len(formula.fitted)} parameters, but there are only "
                f"{_samples(count)}",
                "add training data, or remove this formula",
                "data",
            )


def contradicted_shape(subject: Subject) -> Issues:
    """Find a shape in `fit.shape` that the training data contradict. `mapmore run` makes the same
    test before it joins the pieces.
    """
    spec, dataset = subject.spec, subject.dataset
    if spec.fit.shape is None or spec.runs_over_time or spec.model.type != "mapmore":
        return
    level = level_of(spec.data.levels, spec.segment)
    inputs = tuple(dict.fromkeys((*([level] if level else ()), *inputs_of_model(subject))))
    try:
        refuse_unsupported(dataset.curves, dataset.target, inputs, level, spec.fit)
    except FitError as fault:
        where = subject.where("fit", "shape")
        yield Issue("error", "shape", where, fault.message, fault.remedy or "", "data")
