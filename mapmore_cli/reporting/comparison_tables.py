"""Comparisons in words and numbers: is the model better than the formula used now, and has a muscle changed?"""

from __future__ import annotations

import math
from collections.abc import Sequence

from mapmore_cli.domain.recording import Quantity
from mapmore_cli.domain.scores import REPEATABILITY, Score, deciding
from mapmore_cli.modelling.comparison import Comparison
from mapmore_cli.reporting.table import Cell, Column, Table

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
    unit = "" if target.unit in ("", "1") else f" {target.unit}"
    first = f"{own} predicts {target.name} with an NRMSE of {_percent(ours.nrmse)} (RMSE {ours.rmse:.3g}{unit}) {where}"
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


def changes_table(found: Comparison) -> Table:
    """Every curve that both models have, by the size of the change: the factor between them, its weight, and the difference."""
    columns = (
        Column("curve"),
        Column("ratio", "", ".4f"),
        Column("weight", "%", ".1f"),
        Column("mean difference", found.unit, ".3g"),
        Column("RMS difference", found.unit, ".3g"),
        Column("largest difference", found.unit, ".3g"),
        Column("at"),
    )
    rows: list[tuple[Cell, ...]] = []
    for curve in found.by_effect:
        place = ", ".join(f"{name} {value:.4g}" for name, value in curve.place.items())
        rows.append((curve.curve, curve.ratio, 100 * curve.weight, curve.difference, curve.rms, curve.largest, place))
    rows.append(("all", found.ratio, 100.0, *[None] * 4))
    low, high = found.interval
    permuted = "" if found.p_permutation is None else f"; permutation of the curves' signs p = {found.p_permutation:.2g}"
    notes = (
        f"Ratio of all curves: 95 % interval {low:.4f} to {high:.4f} (Student's t, {len(found.curves) - 1} degrees of freedom; the unit is "
        f"the curve), p = {found.p:.2g}{permuted}. Weight: share of the sum of squares of the earlier output.",
    )
    return Table("changes", f"{found.after} against {found.before}", columns, tuple(rows), notes)


def drift_table(names: Sequence[str], results: Sequence[Comparison]) -> Table:
    """Every later model against the first."""
    columns = (Column("model"), Column("ratio", "", ".4f"), Column("from", "", ".4f"), Column("to", "", ".4f"), Column("answer"))
    rows = tuple((name, one.ratio, *one.interval, one.answer) for name, one in zip(names[1:], results, strict=True))
    return Table("drift", f"Every model against {names[0]}", columns, rows)
