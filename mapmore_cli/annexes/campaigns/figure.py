"""Draw the figure of a campaign: the error of every run."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.annexes.campaigns.tables import CampaignScores
from mapmore_cli.domain.scores import REPEATABILITY
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel

ROUNDING = 1e-10
"""NRMSE below which an error is that of rounding; on a logarithmic axis it would leave no room for
the others.
"""
MOST_RUNS = 100
"""Runs of a campaign in its figure; of more, some stand for all."""

BEST_OTHER = "best of the others"
FLOOR: dict[str, Any] = {
    "marker": "|",
    "markersize": 9,
    "markeredgewidth": 1.2,
    "color": style.GREY,
}


def campaign_figures(scores: CampaignScores) -> list[Drawing]:
    """Return a line of dots for each run on a logarithmic axis: the runs' own model, the one that
    ratios are taken to, the best of a run's others, and repeated measurements; none for a single
    run. Of very many some are drawn, the run with the least error among them.
    """
    pooled, own, exact = scores.pooled, scores.own, list[str]()
    every = list(pooled)
    known = {run: pooled[run][own].nrmse for run in every if own in pooled[run]}
    best = min(
        filter(lambda run: np.isfinite(known[run]), known), key=known.__getitem__, default=""
    )
    shown = {best, *(every[i] for i in panels.evenly(len(every), MOST_RUNS))}
    runs = [run for run in every if run in shown]
    names = dict.fromkeys([own, scores.relative_to, BEST_OTHER, REPEATABILITY])
    errors = {name: np.full(len(runs), np.nan) for name in names if name}
    for place, run in enumerate(runs):
        by_model = pooled[run]
        known = {model: row.nrmse for model, row in by_model.items() if row.nrmse > ROUNDING}
        others = [known[model] for model in known.keys() - {own, REPEATABILITY}]
        known[BEST_OTHER] = min(filter(np.isfinite, others), default=np.nan)
        for model, dots in errors.items():
            dots[place] = 100 * known.get(model, np.nan)
        exact += [run] if own in by_model and by_model[own].nrmse <= ROUNDING else []
    drawn = [model for model, dots in errors.items() if np.isfinite(dots).any()]
    if len(runs) < 2 or not {*drawn} - {REPEATABILITY}:
        return []
    looks = style.model_styles(drawn)

    def on(ax: Axes) -> None:
        rows, across = np.arange(len(runs)), ax.get_yaxis_transform()
        ax.hlines(rows, 0.0, 1.0, transform=across, colors=style.LIGHT, linewidth=0.4, zorder=0)
        for place, model in enumerate(drawn):
            look, known = looks[model], np.isfinite(errors[model])
            dots: dict[str, Any] = {"marker": look.marker, "markersize": 4.0 + look.width}
            dots |= {"color": look.colour, "markeredgewidth": 0}
            # the own dots over the others
            dots = (FLOOR if model == REPEATABILITY else dots) | {"zorder": 3 - 0.1 * place}
            ax.plot(errors[model][known], rows[known], linestyle="none", label=model, **dots)
        panels.label_rows(ax, panels.told_apart(runs, 40))
        panels.plain_logarithm(ax.xaxis, (1.0, 2.0, 5.0))

    caption = f"NRMSE of every run, further left is better. The {BEST_OTHER}: known afterwards."
    if exact:
        caption += f" Without a dot, since its error is but rounding: {own} in {', '.join(exact)}."
    if len(runs) < len(every):
        caption += (
            f" {len(runs)} of {len(every)} runs are drawn, the one that errs least among them."
        )
    grid = Layout(0.45 + 0.21 * len(runs), width=DOUBLE)
    return [Drawing("nrmse", caption, (Panel("", on, "NRMSE (%)", ("",)),), grid)]
