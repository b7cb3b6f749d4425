"""The one-line answer to "is the model better than the formula that I use now?"."""

from __future__ import annotations

import math
from collections.abc import Sequence

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.scores import REPEATABILITY, Score, deciding

EQUAL_WITHIN = 0.01
"""Relative difference of two errors below which neither model is called better."""


def verdict(scores: Sequence[Score], own: str, target: Quantity, failed: Sequence[str] = ()) -> str:
    """Compare the pooled error of the model `own` with the best of the others, on held-out data where there are any.

    `failed` names the competitors that have no scores, because their fit failed.
    """
    compared = deciding(scores)
    ours = next((s for s in compared if s.model == own), None)
    if ours is None or not math.isfinite(ours.nrmse):
        return f"{own} gave no prediction."
    where = {
        "validate": "on the held-out data",
        "train": "on its own training data (nothing was held out, so this says little about new data)",
    }[ours.split]
    first = f"{own} predicts {target.name} with an NRMSE of {_percent(ours.nrmse)} (RMSE {ours.rmse:.3g} {target.unit}) {where}"
    return f"{first}; {_comparison(ours, [s for s in compared if s.model not in (own, REPEATABILITY)], failed)}{_floor(compared)}."


def _comparison(ours: Score, others: Sequence[Score], failed: Sequence[str]) -> str:
    usable = [s for s in others if math.isfinite(s.nrmse)]
    if not usable:
        return "no competitor gave a prediction to compare with" if others or failed else "it was compared with no other model"
    best = min(usable, key=lambda s: s.nrmse)
    claim = f"the best competitor, {best.model}, reaches {_percent(best.nrmse)}"
    if ours.rmse == best.rmse:
        return f"{claim}: an exact tie"
    if abs(ours.rmse - best.rmse) <= EQUAL_WITHIN * max(ours.rmse, best.rmse):
        return f"{claim}: no difference to speak of"
    ratio = f" ({ours.rmse / best.rmse:.3g} times the RMSE)" if best.rmse > 0 else ""
    return f"{claim}: {ours.model} is {'better' if ours.rmse < best.rmse else 'worse'}{ratio}"


def _floor(compared: Sequence[Score]) -> str:
    """What repeated measurements differ by, where there are any."""
    return "".join(f"; repeated measurements differ by {_percent(s.nrmse)}" for s in compared if s.model == REPEATABILITY)


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.3g} %"
