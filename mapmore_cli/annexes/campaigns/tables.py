"""Make the tables over all runs of a campaign."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from statistics import median

from mapmore_cli.domain.scores import (
    OWN,
    REPEATABILITY,
    Published,
    Score,
    deciding,
)
from mapmore_cli.reporting.table import MODEL, Cell, Cells, Column, Columns, Table

Pooled = Mapping[str, Score]
"""Scores of a run by which models are compared, by model: over all curves pooled, on the held-out
data if there are any.
"""

SPARSE = 0.5
"""A table with a row for every run and a column for every model is used if at least this fraction
of its cells have a value.
"""


@dataclass(frozen=True)
class CampaignScores:
    """Scores of the runs of a campaign, from which its tables are made.

    - `runs`: the scores of every run, by its name.
    - `units`: the unit of the modelled quantity, by run.
    - `published`: errors that are printed in a publication, by run.
    - `relative_to`: the model by whose error other errors are divided.
    - `best_of`: names of models. In each run, the model of this list with the smallest error is
      used as a competitor. Which model that is, is known only after the run.
    - `groups`: group of each run; the runs of a group are summarised together.
    - `failed`: the runs that have no scores, because they failed.
    """

    runs: Mapping[str, Sequence[Score]]
    units: Mapping[str, str] = field(default_factory=dict)
    published: Mapping[str, Published] = field(default_factory=dict)
    relative_to: str | None = None
    best_of: Sequence[str] = ()
    groups: Mapping[str, str] = field(default_factory=dict)
    failed: Sequence[str] = ()

    @cached_property
    def pooled(self) -> dict[str, Pooled]:
        """Score of each model in each run, over all curves pooled: on the held-out data if there
        are any, otherwise on the training data. Models are compared by these scores.
        """
        return {
            name: {score.model: score for score in deciding(scores)}
            for name, scores in self.runs.items()
        }

    @property
    def models(self) -> tuple[str, ...]:
        """Names of the models that occur in at least one run. The repeatability of measurements,
        which is no model, comes last.
        """
        names = dict.fromkeys(model for scores in self.pooled.values() for model in scores)
        return tuple(sorted(names, key=lambda name: name == REPEATABILITY))

    @property
    def sparse(self) -> bool:
        """Return True if fewer than half of the pairs of a run and a model have a score."""
        return sum(map(len, self.pooled.values())) < SPARSE * len(self.runs) * len(self.models)

    @property
    def normalisers(self) -> str:
        """Names of the quantities by which errors are divided to make the NRMSE, as one text."""
        rows = [score for run in self.pooled.values() for score in run.values()]
        return " and ".join(dict.fromkeys(score.normaliser_name for score in rows))


def campaign_tables(scores: CampaignScores) -> tuple[Table, ...]:
    """Return the tables of the page that have at least one row. If runs have few models in common,
    each pair of a run and a model gets a row; otherwise, each run gets a row, and each model a
    column.
    """
    first = models_table if scores.sparse else nrmse_table
    return tuple(table for table in (first(scores), published_table(scores)) if table.rows)


def nrmse_table(scores: CampaignScores) -> Table:
    """Return the table of the NRMSE on held-out data, with a column for every model and a row for
    every run. For a run without held-out data, the row shows the NRMSE on training data.

    Rows with summaries follow:

    - for each group, the median and the largest NRMSE over the runs that have the model;
    - the ratio of the model's RMSE to the RMSE of `relative_to`, over the runs that have both
      models: its geometric mean, its largest value, and the number of runs in which it is below
      one;
    - the number of runs in which the model has a smaller RMSE than the best model of `best_of`.
    """
    models, runs = scores.models, scores.pooled
    rows: list[Cells] = [
        (name, *(100 * run[model].nrmse if model in run else None for model in models))
        for name, run in runs.items()
    ]
    rows += [(name, *["failed", *[None] * len(models)][: len(models)]) for name in scores.failed]
    pooled = f"NRMSE in per cent, all curves pooled; normalised by {scores.normalisers}."
    notes = [pooled] if models else []
    for group in dict.fromkeys(scores.groups.values()):
        group_runs = [run for name, run in runs.items() if scores.groups.get(name) == group]
        errors = [
            [100 * _known(run[model].nrmse) for run in group_runs if model in run]
            for model in models
        ]
        for word, of in (("median", median), ("worst", max)):
            rows.append((f"{group}: {word}", *(of(known) if known else None for known in errors)))
    if scores.relative_to in models:
        titles = ("ratio, geometric mean", "ratio, worst", "runs better")
        ratios = [_ratios(scores, model, scores.relative_to) for model in models]
        rows += zip(titles, *ratios, strict=True)
        notes.append(
            f"Ratios are of RMSE to that of {scores.relative_to}; a ratio below one is better."
        )
    if {*scores.best_of} & {*models}:
        rows.append(("below the best formula", *(_wins(scores, model) for model in models)))
        notes.append(
            f"The best formula is the one of {', '.join(scores.best_of)} with the smallest "
            "held-out error in each run. It is known only after the run."
        )
    columns: Columns = ("run", *(Column(model, "", ".3g") for model in models))
    return Table.of("nrmse", "NRMSE of every run and model", columns, rows, *notes)


def models_table(scores: CampaignScores) -> Table:
    """Return the table of the NRMSE on held-out data, with a row for every model of every run. For
    a run without held-out data, the rows show the NRMSE on training data. Within a run, its own
    model comes first; the others follow in the order of increasing error.
    """

    def place(score: Score) -> tuple[bool, bool, float]:
        return score.model != OWN, score.model == REPEATABILITY, _known(score.nrmse)

    rows: list[Cells] = []
    for name, run in scores.pooled.items():
        own_rmse = run[OWN].rmse if OWN in run else math.nan
        for score in sorted(run.values(), key=place):
            beside = own_rmse > 0 and score.model != OWN
            ratio = _known(score.rmse) / own_rmse if beside else None
            rows.append((name, score.model, 100 * score.nrmse, ratio))
    rows += [(name, OWN, "failed", None) for name in scores.failed]
    columns = ("run", MODEL, "NRMSE [%] .3g", Column(f"RMSE in ratio to {OWN}", "", ".3g"))
    note = f"All curves pooled; normalised by {scores.normalisers}."
    return Table.of("models", "NRMSE of every run and model", columns, rows, note)


def _known(error: float) -> float:
    """Return the error, or infinity if it is NaN. An error of NaN means that the model diverged,
    which is worse than any finite error.
    """
    return math.inf if math.isnan(error) else error


def _ratios(scores: CampaignScores, model: str, relative_to: str) -> tuple[Cell, Cell, Cell]:
    """Return a summary of the ratio of one model's RMSE to another model's RMSE, over the runs that
    have both models: the geometric mean, the largest value, and a text with the number of runs in
    which the first model is better. All three are None if `model` is the repeatability of
    measurements, which is no model.
    """
    both = [run for run in scores.pooled.values() if {model, relative_to} <= run.keys()]
    pairs = [(_known(run[model].rmse), run[relative_to].rmse) for run in both]
    ratios = [error / other for error, other in pairs if other > 0]
    if model == REPEATABILITY or not ratios:
        return None, None, None
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios)) if min(ratios) > 0 else None
    ties = ratios.count(1.0) if model != relative_to else 0
    return mean, max(ratios), _won(sum(ratio < 1 for ratio in ratios), len(ratios), ties)


def _won(won: int, count: int, tied: int) -> str:
    """Return a text such as `3 of 5, 1 tied`: the number of runs in which a model is strictly
    better than another, and the number of runs in which both are exactly equal.
    """
    return f"{won} of {count}{f', {tied} tied' if tied else ''}"


def _wins(scores: CampaignScores, model: str) -> Cell:
    """Return a text such as `3 of 5, 1 tied`: the number of runs in which the RMSE of a model is
    below the smallest RMSE of the other models in `best_of`, and the number of runs in which both
    are exactly equal. Return None for the repeatability of measurements, which is no model.
    """
    if model == REPEATABILITY:
        return None
    won = tied = 0
    runs = [run for run in scores.pooled.values() if model in run]
    for run in runs:
        others = [run[name].rmse for name in scores.best_of if name in run and name != model]
        least = min(filter(math.isfinite, others), default=math.inf)
        won += run[model].rmse < least
        tied += run[model].rmse == least
    return _won(won, len(runs), tied)


def published_table(scores: CampaignScores) -> Table:
    """Return the table that compares the RMSE and the NRMSE on held-out data with those that are
    printed in a publication, with a row for each model in the publication. Columns without numbers
    are left out.
    """
    rows: list[Cells] = []
    for name, paper in scores.published.items():
        for model, score in scores.pooled.get(name, {}).items():
            rmse, nrmse = paper.shown_rmse(model), paper.nrmse.get(model)
            if score.split == "validate" and (rmse, nrmse) != (None, None):
                percent = None if nrmse is None else 100 * nrmse
                rows.append((name, model, score.rmse, rmse, 100 * score.nrmse, percent))
    units = {scores.units.get(str(row[0]), "") for row in rows}
    unit = units.pop() if len(units) == 1 else ""
    columns = (
        *("run", MODEL, f"RMSE [{unit}] .3g", f"published RMSE [{unit}] .3g"),
        *("NRMSE [%] .3g", "published NRMSE [%] .3g"),
    )
    filled = [j for j in range(len(columns)) if any(row[j] is not None for row in rows)]
    kept = ([row[j] for j in filled] for row in rows)
    heads = [columns[j] for j in filled]
    sources = dict.fromkeys(f"Published: {paper.source}." for paper in scores.published.values())
    return Table.of("published", "Beside the published numbers", heads, kept, *sources)
