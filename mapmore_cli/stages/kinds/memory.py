"""From the spec to a model with memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mapmore_cli.stages.kinds.dictionary import Clock, terms_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from mapmore_cli.domain.fits import FormulaFit
    from mapmore_cli.domain.memory import MemoryFit
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.spec.sections.dictionary import DictionaryEntry
    from mapmore_cli.spec.sections.method import Fit


def fit_memory(dataset: Dataset, dictionary: Sequence[DictionaryEntry], fit: Fit, backbone: FormulaFit | None) -> MemoryFit:
    """One model of all recordings, of what the backbone leaves where there is one.

    Raises
    ------
    DataError
        Where recordings are not sampled alike, or too few samples have a history.
    """
    from mapmore_cli.modelling.literature.backbone import residual_of
    from mapmore_cli.modelling.memory import MemoryRecipe, fit_with_memory, records_of, time_step

    curves = [residual_of(curve, dataset.target, backbone) for curve in dataset.curves]
    step = time_step(curves)
    records = records_of(curves, step)
    clock = Clock(step, step * max(int(record.training.sum()) for record in records))
    recipe = MemoryRecipe(
        target=dataset.target,
        dictionary=terms_of(dictionary, clock),
        step=step,
        scale=fit.scaling == "range",
        margin=fit.margin,
        ridge=fit.ridge,
        max_terms=fit.max_terms,
        forward=fit.forward,
        tolerance=fit.tolerance,
        stop=fit.stop,
    )
    return fit_with_memory(records, recipe)
