"""Make models with memory from a spec."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mapmore_cli.domain.declared import from_fields
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds import Given, Maker
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.fitting.kinds.dictionary import Clock, terms_of
from mapmore_cli.fitting.kinds.formula import fitted
from mapmore_cli.modelling.expressions.parsing import candidate
from mapmore_cli.modelling.expressions.states import state
from mapmore_cli.modelling.literature.backbone import residual_of
from mapmore_cli.modelling.memory import model as memory
from mapmore_cli.modelling.memory.fitting import fit_outputs, fit_with_memory
from mapmore_cli.modelling.memory.records import Record, begun, records_of, sampled
from mapmore_cli.modelling.memory.states import with_ranges
from mapmore_cli.modelling.selection import MemoryRecipe
from mapmore_cli.study.sections.dictionary import timed_terms


def _unseen(curve: Curve, outputs: Sequence[str], lag: int, step: float) -> Curve:
    """Return the curve with its held-out outputs replaced by NaN. If outputs are fed back, the
    first `lag` outputs of each uninterrupted piece are kept, because a free run begins with them.
    """
    if not curve.held_out.any():
        return curve
    blank = {name: np.where(curve.held_out, np.nan, curve.columns[name]) for name in outputs}
    curve = replace(curve, columns={**curve.columns, **blank})
    return curve if lag == 0 or not curve.training.any() else begun(curve, lag, step)


def _asked(
    part: ModelChoices, dataset: Dataset, backbone: FormulaFit | None
) -> tuple[Sequence[Record], MemoryRecipe]:
    """Return the recordings, with the residual of the backbone as output, and all settings of the
    fit.

    Held-out outputs are replaced by NaN, because a model that feeds its output back would otherwise
    use them as past outputs of training samples.
    """
    step, uneven, pieces = sampled(dataset.curves, ordered=not timed_terms(part.dictionary))
    longest = max(int(record.training.sum()) for record in pieces)
    terms = terms_of(part.dictionary, Clock(step, step * longest))
    outputs = [output.target for output in dataset.each]
    names = {name for text in terms for name in candidate(text).names}
    lag = max((state(name).lag for name in names if state(name).quantity in outputs), default=0)
    longest_step = math.inf if uneven else step
    unseen = (_unseen(curve, outputs, lag, longest_step) for curve in dataset.curves)
    records = records_of(
        [residual_of(curve, dataset.target, backbone) for curve in unseen], longest_step
    )
    asked = from_fields(
        MemoryRecipe,
        part.fit,
        target=dataset.target,
        dictionary=terms,
        step=step,
        ordered=uneven,
    )
    return records, replace(asked, dictionary=with_ranges(records, asked))


class MemoryMaker(Maker):
    """Maker of models with memory."""

    def fit(self, part: ModelChoices, given: Given) -> FitResult:
        """Fit one model to all recordings, or to the residual of the backbone if there is a
        backbone, and return the fit.

        Raises DataError if recordings have different time steps, or if too few samples have as many
        earlier samples as the terms need; FitError if the fit of the backbone failed.
        """
        dataset = given.dataset
        backbone = (
            None if part.model.backbone is None else fitted(part.model.backbone, part, dataset)
        )
        records, recipe = _asked(part, dataset, backbone)
        memory_fit = fit_with_memory(
            records,
            recipe,
            lambda done, total: given.progress("models", done, total),
            None if given.near is None else given.near.memory,
        )
        return FitResult(
            memory_fit,
            backbone,
            () if memory_fit.identified is None else memory_fit.identified.notes,
        )

    def fit_together(self, part: ModelChoices, given: Given) -> tuple[FitResult, ...]:
        """Fit each output to all recordings, with the same terms for all outputs, and return one
        fit for each output. Raises the same errors as `fit`.
        """
        records, recipe = _asked(part, given.dataset, None)
        recipes = [replace(recipe, target=output.target) for output in given.dataset.each]
        return tuple(FitResult(fit) for fit in fit_outputs(records, recipes))

    def build(self, part: ModelChoices, given: Given, result: FitResult) -> Model:
        """Return the model, with the training range of its inputs. If `fit.shape` requires that the
        static gain is positive or negative, the coefficients are fitted again with this condition.
        """
        assert result.memory is not None
        model = memory.memory_model(
            part.name,
            result.memory.model,
            result.backbone,
            given.segmentation,
            given.dataset.quantities,
            result.notes,
        )
        doubts = memory.outliers_fed_back(model, part.fit.loss)
        model = replace(model, notes=(*model.notes, *doubts))
        if part.fit.shape is None:
            return model
        from mapmore_cli.modelling.memory.shaped import with_signed_gain

        records, recipe = _asked(part, given.dataset, result.backbone)
        return with_signed_gain(model, result.memory, given.dataset.curves, records, recipe)
