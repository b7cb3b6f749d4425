"""Draw the figure of a campaign: the error of every run."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.annexes.campaigns.tables import CampaignScores
from mapmore_cli.domain.scores import OWN, REPEATABILITY
from mapmore_cli.reporting.figures import panels, style
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel

ROUNDING = 1e-10
"""Smallest NRMSE that is drawn. A smaller error is due to rounding, and on a logarithmic axis it
would leave no space for the others.
"""
MOST_RUNS = 100
"""Largest number of evenly spaced runs that the figure of a campaign shows. If there are more runs,
the others are left out, except for the run with the smallest error.
"""

BEST_OTHER = "best of the others"
FLOOR: dict[str, Any] = {
    "marker": "|",
    "markersize": 9,
    "markeredgewidth": 1.2,
    "color": style.GREY,
}


def campaign_figures(scores: CampaignScores) -> list[Drawing]:
    """Return a list with the figure of the errors, or an empty list if fewer than two runs have
    scores, or if no error of a model is known.

    In the figure, each run is a line of dots along a logarithmic axis. The dots are the errors of
    the run's own model, of the model `relative_to`, of the best of the other models, and of
    repeated measurements. If there are very many runs, only some are drawn, including the run with
    the smallest error.
    """
    pooled = scores.pooled
    every = [*pooled]
    if len(every) < 2:
        return []
    nrmse_of_run = {run: by_model[OWN].nrmse for run, by_model in pooled.items() if OWN in by_model}
    best = min(
        (run for run in nrmse_of_run if np.isfinite(nrmse_of_run[run])),
        key=nrmse_of_run.__getitem__,
        default="",
    )
    shown = {best, *(every[place] for place in panels.evenly(len(every), MOST_RUNS))}
    runs = [run for run in every if run in shown]
    exact = [run for run in runs if nrmse_of_run.get(run, np.nan) <= ROUNDING]
    models = [*filter(None, dict.fromkeys([OWN, scores.relative_to, BEST_OTHER, REPEATABILITY]))]
    rows = []
    for run in runs:
        known = {name: row.nrmse for name, row in pooled[run].items() if row.nrmse > ROUNDING}
        others = [known[name] for name in known.keys() - {OWN, REPEATABILITY}]
        known[BEST_OTHER] = min(filter(np.isfinite, others), default=np.nan)
        rows.append([100 * known.get(name, np.nan) for name in models])
    errors = dict(zip(models, np.transpose(rows), strict=True))
    drawn = [model for model, dots in errors.items() if np.isfinite(dots).any()]
    if not {*drawn} - {REPEATABILITY}:
        return []
    looks = style.model_styles(drawn)

    def on(ax: Axes) -> None:
        rows, across = np.arange(len(runs)), ax.get_yaxis_transform()
        ax.hlines(rows, 0.0, 1.0, transform=across, colors=style.LIGHT, linewidth=0.4, zorder=0)
        for place, model in enumerate(drawn):
            look, known = looks[model], np.isfinite(errors[model])
            dots: dict[str, Any] = {"marker": look.marker, "markersize": 4.0 + look.width}
            dots |= {"color": look.colour, "markeredgewidth": 0}
            # dots of the run's own model are drawn on top
            dots = (FLOOR if model == REPEATABILITY else dots) | {"zorder": 3 - 0.1 * place}
            ax.plot(errors[model][known], rows[known], linestyle="none", label=model, **dots)
        panels.label_rows(ax, panels.told_apart(runs, 40))
        panels.plain_logarithm(ax, "x", (1.0, 2.0, 5.0))

    caption = (
        f"NRMSE of every run, further left is better. The {BEST_OTHER} is known only after the run."
    )
    if exact:
        caption += f" Not drawn, because its error is rounding only: {OWN} in {', '.join(exact)}."
    if len(runs) < len(every):
        caption += (
            f" {len(runs)} of {len(every)} runs are drawn, among them the one with the least error."
        )
    grid = Layout(0.45 + 0.21 * len(runs), width=DOUBLE)
    return [Drawing("nrmse", caption, (Panel("", on, "NRMSE (%)", ("",)),), grid)]
