"""A model made in one go, its number of terms included where left-out training data choose it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.errors import FitError, MapmoreError
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.kinds import added_up, refit
from mapmore_cli.fitting.kinds.choices import FitChoices, ModelChoices, with_terms
from mapmore_cli.fitting.kinds.dictionary import terms_of
from mapmore_cli.fitting.kinds.pieces import backbone_name
from mapmore_cli.fitting.trials import bench_of, errors_of, training_only
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.modelling.validation.significance import simplest_of

IN_A_SEGMENT = (1, 2, 3, 4, 6, 8)
IN_A_RECORD = (1, 2, 4, 8, 12, 16)
"""Numbers of terms that are tried: of a segment, and of a model with memory."""


@dataclass(frozen=True)
class Size:
    """How many terms, and on what grounds; 0 where the spec says it."""

    terms: int = 0
    notes: tuple[str, ...] = ()


def size_of(part: FitChoices, dataset: Dataset, progress: Callable[[int, int], None] = lambda _done, _total: None) -> Size:
    """Choose the number of terms where the spec leaves it to left-out training data.

    Raises FitError where no number of terms can be fitted without some of the data.
    """
    if part.fit.max_terms != AUTO or part.kind not in ("pieces", "memory"):
        return Size()
    trial = _trial(part, dataset)
    bench = bench_of(training_only(dataset), trial, "max")
    known, failure = dict[int, list[float]](), ""
    sizes = _sizes(part)
    for number, terms in enumerate(sizes):
        try:
            known[terms] = errors_of(with_terms(trial, terms), bench, refit)
        except MapmoreError as fault:
            failure = fault.message
        progress(number + 1, len(sizes))
    finite = {terms: errors for terms, errors in known.items() if np.isfinite(errors).all()}
    if not finite:
        raise FitError(f"fit.max_terms: auto: no number of terms can be fitted without some of the data: {failure}", "give a number")
    tried = list(finite)
    rank = simplest_of(tried, np.array([finite[terms] for terms in tried]))
    chosen, best = tried[rank.chosen], tried[rank.best]
    errors = ", ".join(f"{terms}: {100 * np.mean(finite[terms]):.3g}" for terms in tried)
    within = "the best" if chosen == best else f"within one standard error of the best, {best}"
    note = f"at most {chosen} term(s): {within}; left out in turn: {bench.left_out}; NRMSE in % by number of terms: {errors}"
    return Size(chosen, (note,))


def _trial(part: FitChoices, dataset: Dataset) -> ModelChoices:
    """Return the choices of a whole model; a backbone that is to be chosen as well is chosen once, with the usual number of terms."""
    model = part.model
    if model.backbone == AUTO:
        model = replace(model, backbone=backbone_name(part, dataset))
    return ModelChoices(part.levels, part.segment, part.dictionary, model, part.fit, part.lengths, None, "trial", part.joined, (), ())


def _sizes(part: FitChoices) -> list[int]:
    """Up to the number of candidates, where that is known without the recordings."""
    if part.over_time:
        return list(IN_A_RECORD)
    candidates = len(terms_of(part.dictionary))
    return [terms for terms in IN_A_SEGMENT if terms <= candidates] or [1]


def refitted(choices: ModelChoices, dataset: Dataset, model_of: Callable[[str], Model] = added_up) -> Model:
    """Return the model of the training samples of a dataset, made in one go, its number of terms included where left-out data choose it.

    `model_of` gives the models that a sum adds up, by the path of their spec; raises SpecError where it is needed and not given.
    """
    return refit(with_terms(choices, size_of(choices, dataset).terms), dataset, model_of)
