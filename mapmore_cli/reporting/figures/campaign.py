"""Errors of all models in all runs of a campaign, at a glance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes

from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.reporting.campaign import CampaignScores
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.figures.style import (
    DOUBLE,
    GREY,
    LIGHT,
    ModelStyle,
    best_of,
    key,
    label_rows,
    model_styles,
    plain_logarithm,
    shortened,
)
from mapmore_cli.reporting.inputs import MOST_LINES

FEWEST_RUNS = 2
ROUNDING = 1e-10
"""NRMSE below which an error is that of rounding; on a logarithmic axis it would leave no room for the others."""
BEST_OTHER = "best of the others"
FLOOR: dict[str, Any] = {"linestyle": "none", "marker": "|", "markersize": 9, "markeredgewidth": 1.2, "color": GREY}


def campaign_figures(scores: CampaignScores) -> list[Drawing]:
    """Return a line of dots for each run, a dot for each model, on a logarithmic axis; none for a single run.

    Where most models are those of a few runs, a run's own model stands beside the best of its others.
    """
    runs = {name: {model: 100 * row.nrmse for model, row in run.items() if row.nrmse > ROUNDING} for name, run in scores.pooled.items()}
    shown = [scores.own, BEST_OTHER] if scores.sparse else _shown(scores)
    if scores.sparse:
        runs = {name: _own_and_best(run, scores.own) for name, run in runs.items()}
    if len(runs) < FEWEST_RUNS or not any(model in run for run in runs.values() for model in shown):
        return []
    styles = model_styles(shown)
    handles = [key(model, **_look(style)) for model, style in styles.items()]
    if any(REPEATABILITY in run for run in runs.values()):
        handles.append(key(REPEATABILITY, **FLOOR))
    models = [model for model in scores.models if model != REPEATABILITY]
    which = f" {BEST_OTHER.capitalize()}: known afterwards only." if scores.sparse else best_of(len(shown), len(models))
    exact = [name for name, run in scores.pooled.items() if scores.own in run and run[scores.own].nrmse <= ROUNDING]
    left_out = f" Without a dot, since its error is but rounding: {scores.own} in {', '.join(exact)}." if exact else ""
    caption = f"NRMSE of every run, further left is better.{which}{left_out}"
    alt = "NRMSE of every run and model; the numbers are in the table below."
    rows = [(name, model, error) for name, run in runs.items() for model, error in run.items()]
    data: dict[str, Values] = dict(zip(("run", "model", "NRMSE [%]"), zip(*rows, strict=True), strict=True))
    panel = Panel("", lambda axes: _draw_runs(axes[0], runs, styles), "NRMSE (%)", ("",), data)
    return [Drawing("nrmse", caption, alt, (panel,), Grid(width=DOUBLE, height=0.45 + 0.21 * len(runs)), tuple(handles))]


def _own_and_best(run: Mapping[str, float], own: str) -> dict[str, float]:
    """Return the errors of a run's own model, of the best of its others, and of repeated measurements."""
    others = [error for model, error in run.items() if model not in (own, REPEATABILITY) and math.isfinite(error)]
    best = {BEST_OTHER: min(others)} if others else {}
    return {model: error for model, error in run.items() if model in (own, REPEATABILITY)} | best


def _draw_runs(ax: Axes, runs: Mapping[str, dict[str, float]], styles: dict[str, ModelStyle]) -> None:
    ax.hlines(range(len(runs)), 0.0, 1.0, transform=ax.get_yaxis_transform(), colors=LIGHT, linewidth=0.4, zorder=0)
    looks = {model: _look(style) for model, style in reversed(styles.items())} | {REPEATABILITY: FLOOR}  # the own dots over the others
    for model, look in looks.items():
        found = [(run[model], place) for place, run in enumerate(runs.values()) if math.isfinite(run.get(model, math.nan))]
        if found:
            ax.plot(*zip(*found, strict=True), **look)
    label_rows(ax, [shortened(name, 40) for name in runs])
    plain_logarithm(ax.xaxis, (1.0, 2.0, 5.0))


def _shown(scores: CampaignScores) -> list[str]:
    """Return the runs' own model first, and those of the others that are the nearest to the best, in the order of the table."""
    others = [model for model in scores.models if model not in (scores.own, REPEATABILITY)]
    best = sorted(others, key=lambda model: _mean_logarithm(scores, model))[: MOST_LINES - 1]
    return [scores.own, *(model for model in others if model in best)]


def _mean_logarithm(scores: CampaignScores, model: str) -> float:
    """Of its NRMSE over the runs that have it, as the geometric mean has it; infinite where a run diverged."""
    found = [run[model].nrmse for run in scores.pooled.values() if model in run]
    return sum(math.log(value) if 0 < value < math.inf else math.inf for value in found) / len(found)


def _look(style: ModelStyle) -> dict[str, Any]:
    return {"linestyle": "none", "marker": style.marker, "markersize": 4.0 + style.width, "color": style.colour, "markeredgewidth": 0}
