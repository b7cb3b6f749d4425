"""From the spec to a model with memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.declared import taken
from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, counting_alike
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds import Given
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.fitting.kinds.dictionary import Clock, terms_of
from mapmore_cli.fitting.kinds.formula import fitted
from mapmore_cli.fitting.outliers import with_outliers
from mapmore_cli.modelling.literature.backbone import residual_of
from mapmore_cli.modelling.memory import model as memory
from mapmore_cli.modelling.memory.fitting import fit_with_memory, regressors_of
from mapmore_cli.modelling.memory.records import Record, records_of, time_step
from mapmore_cli.modelling.memory.states import with_ranges
from mapmore_cli.modelling.selection import MemoryRecipe


def fit(part: ModelChoices, given: Given) -> FitResult:
    """One model of all recordings, of what the backbone leaves where there is one.

    Raises DataError where recordings are not sampled alike, or too few samples have a history;
    FitError where the fit of the backbone failed.
    """
    dataset = given.dataset
    backbone = None if part.model.backbone is None else fitted(part.model.backbone, part, dataset)
    weighed = dataset.curves
    if part.fit.weight == "curve":
        weighed = counting_alike(weighed, dataset.target)
    curves = [residual_of(curve, dataset.target, backbone) for curve in weighed]
    step = time_step(curves)
    records = records_of(curves, step)
    clock = Clock(step, step * max(int(record.training.sum()) for record in records))
    asked = taken(
        MemoryRecipe,
        part.fit,
        target=dataset.target,
        dictionary=terms_of(part.dictionary, clock),
        step=step,
    )
    recipe = replace(asked, dictionary=with_ranges(records, asked))
    memory_fit = fit_with_memory(
        records, recipe, lambda done, total: given.progress("models", done, total)
    )
    notes = () if memory_fit.identified is None else memory_fit.identified.notes
    return with_outliers(
        FitResult(memory_fit, backbone, notes),
        part.fit,
        dataset,
        _one_step_residuals(records, memory_fit, dataset.curves),
    )


def _one_step_residuals(
    records: Sequence[Record], fit: MemoryFit, curves: Sequence[Curve]
) -> Iterator[tuple[IntArray, Array, Array, Array]]:
    """Yield the rows of the training samples, counted over all curves in a row, what is left of the
    output one step ahead, its uncertainty and the output, (n,) each.
    """
    data = regressors_of(records, fit)
    starts = np.cumsum([0, *(curve.size for curve in curves)])
    rows = [
        rows + start for curve, start in zip(curves, starts, strict=False) for rows in curve.logs
    ]
    sigma = np.ones(data.samples) if data.uncertainty is None else data.uncertainty
    P, y = data.in_uncertainties()
    theta = [*fit.model.theta, *([fit.model.constant] if fit.model.constant else [])]
    yield np.concatenate(rows)[data.known], (y - P @ theta) * sigma, sigma, data.y


def build(part: ModelChoices, given: Given, result: FitResult) -> Model:
    """Return the model, with the training range of its inputs."""
    assert result.memory is not None
    return memory.build(
        part.name,
        result.memory.model,
        result.backbone,
        given.segmentation,
        given.dataset.quantities,
        result.notes,
    )
