"""What must be said loudly of a model that was scored: signs that it is of no use, or not what it seems to be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import Model, Pieces
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.domain.scores import OWN, Score
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import outside_range

SAME = 1e-9
"""Relative difference of two predictions, below which they say the same."""

MOSTLY = 0.5
"""Share of the held-out samples outside of the training range, above which scores are of extrapolation."""

ROWS = {"train": "training data", "validate": "held-out data"}


def alarms(model: Model, dataset: Dataset, predictions: Sequence[Array], scores: Sequence[Score]) -> tuple[str, ...]:
    """Everything that a reader of the scores of the run's own model has to know first, one sentence each.

    Parameters
    ----------
    predictions
        Of the model, for every curve of the dataset.
    """
    own = [row for row in scores if row.model == OWN and row.curve == "all"]
    found = [told for row in own for told in _of_scores(row)]
    return (*found, *_bare(model, dataset.curves, predictions), *_beyond(model, dataset.curves))


def _of_scores(row: Score) -> Iterator[str]:
    where = ROWS[row.split]
    if not np.isfinite(row.rmse):
        yield f"the model has no finite error on the {where}: it is of no use"
        return
    if row.r2 <= 0:
        what = "no better than" if row.r2 == 0 else "worse than"
        yield f"R² on the {where} is {row.r2:.3g}: the model is {what} the mean of what was measured"
    if row.max_abs_error_fs > 1:
        yield f"the largest error on the {where} is {row.max_abs_error_fs:.3g} times the full scale ({row.normaliser_name})"


def _bare(model: Model, curves: Sequence[Curve], predictions: Sequence[Array]) -> Iterator[str]:
    """Pieces that add nothing to their backbone."""
    body = model.body
    if not isinstance(body, Pieces) or body.backbone is None:
        return
    formula = literature.of(body.backbone)
    if not body.segments:
        why = "because its pieces were dropped: left-out training data were predicted worse with them"
    elif all(_equal(said, formula.predict(body.backbone.parameters, c.columns)) for c, said in zip(curves, predictions, strict=True)):
        why = "on every sample: its pieces add nothing"
    else:
        return
    yield f"the model says the same as its backbone {formula.name}, {why}"


def _equal(a: Array, b: Array) -> bool:
    return bool(np.allclose(a, b, rtol=SAME, atol=SAME * float(np.abs(b).max(initial=0.0)), equal_nan=True))


def _beyond(model: Model, curves: Sequence[Curve]) -> Iterator[str]:
    """Held-out samples that no training sample surrounds."""
    held_out = [curve for curve in curves if curve.held_out.any()]
    every = sum(int(curve.held_out.sum()) for curve in held_out)
    outside = sum(int(outside_range(model, curve.columns)[curve.held_out].sum()) for curve in held_out)
    if outside == every > 0:
        yield "all held-out samples lie outside of the training range: every score of theirs is of extrapolation"
    elif outside > MOSTLY * every:
        yield f"{outside} of {every} held-out samples lie outside of the training range: their scores are mostly of extrapolation"
