"""The page of a campaign: one table over all runs, and the way to the page of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from mapmore_cli.domain.scores import Score
from mapmore_cli.reporting.page import environment
from mapmore_cli.reporting.table import Cell, Column, Table


def nrmse_table(runs: Mapping[str, Sequence[Score]], relative_to: str | None = None) -> Table:
    """Validation NRMSE of every model (columns) in every run (rows); training rows where a run holds nothing out.

    With `relative_to`, closing rows give the geometric mean, the worst and the number of wins of each model's RMSE in ratio to that
    model's, over the runs that have both.
    """
    pooled = {name: _pooled(scores) for name, scores in runs.items()}
    models = tuple(dict.fromkeys(model for scores in pooled.values() for model in scores))
    rows: list[tuple[Cell, ...]] = [
        (name, *(100 * scores[model].nrmse if model in scores else None for model in models)) for name, scores in pooled.items()
    ]
    notes = ["NRMSE in per cent of the held-out rows, all curves pooled; normalised by max|measured| of these rows."]
    if relative_to in models:
        rows += _ratios(list(pooled.values()), models, relative_to)
        notes.append(f"Ratios are of RMSE to that of {relative_to}; a ratio below one is better.")
    return Table(
        "nrmse", "NRMSE of every run and model", (Column("run"), *(Column(m, "", ".3g") for m in models)), tuple(rows), tuple(notes)
    )


def _pooled(scores: Sequence[Score]) -> dict[str, Score]:
    rows = [score for score in scores if score.curve == "all"]
    split = "validate" if any(score.split == "validate" for score in rows) else "train"
    return {score.model: score for score in rows if score.split == split}


def _ratios(runs: Sequence[Mapping[str, Score]], models: Sequence[str], relative_to: str) -> list[tuple[Cell, ...]]:
    ratios = {m: [run[m].rmse / run[relative_to].rmse for run in runs if m in run and relative_to in run] for m in models}
    means = {m: math.exp(sum(map(math.log, r)) / len(r)) if r and min(r) > 0 else None for m, r in ratios.items()}
    return [
        ("ratio, geometric mean", *(means[m] for m in models)),
        ("ratio, worst", *(max(ratios[m], default=None) for m in models)),
        ("runs better", *(f"{sum(r < 1 for r in ratios[m])} of {len(ratios[m])}" for m in models)),
    ]


def render_campaign(title: str, tables: Sequence[Table], pages: Mapping[str, str], failed: Mapping[str, str]) -> str:
    """The page: `pages` are links by run, `failed` the messages of runs that did not end."""
    return environment().get_template("campaign.html").render(title=title, tables=tables, pages=pages, failed=failed)
