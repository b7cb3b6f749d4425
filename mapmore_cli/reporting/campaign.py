"""The page of a campaign: tables over all runs, and the way to the page of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median

from mapmore_cli.domain.scores import OWN, REPEATABILITY, Published, Score, deciding
from mapmore_cli.reporting.table import MODEL, Cell, Column, Columns, Table

Pooled = Mapping[str, Score]
"""The scores of a run that count, by model: all curves pooled, of the held-out rows where there are
any.
"""

SPARSE = 0.5
"""Share of filled cells below which a table of all runs by all models is hard to read."""


@dataclass(frozen=True)
class CampaignScores:
    """What the tables of a campaign are made of.

    - `runs`: the scores of every run, by its name.
    - `own`: the name of the runs' own model.
    - `units`: the unit of the modelled quantity, by run.
    - `published`: numbers of publications, by run.
    - `relative_to`: the model that ratios are taken to.
    - `best_of`: models of which the best in each run, picked afterwards, is compared with.
    - `groups`: what runs are summarised together, by run.
    - `failed`: the runs that have no scores.
    """

    runs: Mapping[str, Sequence[Score]]
    own: str = OWN
    units: Mapping[str, str] = field(default_factory=dict)
    published: Mapping[str, Published] = field(default_factory=dict)
    relative_to: str | None = None
    best_of: Sequence[str] = ()
    groups: Mapping[str, str] = field(default_factory=dict)
    failed: Sequence[str] = ()

    @property
    def pooled(self) -> dict[str, Pooled]:
        """The scores that count, by run."""
        return {
            name: {score.model: score for score in deciding(scores)}
            for name, scores in self.runs.items()
        }

    @property
    def models(self) -> tuple[str, ...]:
        """Every model of any run, what is no model last."""
        names = dict.fromkeys(model for scores in self.pooled.values() for model in scores)
        return tuple(sorted(names, key=lambda name: name == REPEATABILITY))

    @property
    def sparse(self) -> bool:
        """Whether most models are those of a few runs."""
        return sum(map(len, self.pooled.values())) < SPARSE * len(self.runs) * len(self.models)

    @property
    def normalisers(self) -> str:
        """What errors are divided by."""
        rows = [score for run in self.pooled.values() for score in run.values()]
        return " and ".join(dict.fromkeys(score.normaliser_name for score in rows))


def campaign_tables(scores: CampaignScores) -> tuple[Table, ...]:
    """Every table of the page; those without rows are left out. Runs that have few models in common
    are listed one after the other.
    """
    first = models_table if scores.sparse else nrmse_table
    return tuple(table for table in (first(scores), published_table(scores)) if table.rows)


def nrmse_table(scores: CampaignScores) -> Table:
    """Return validation NRMSE of every model (columns) in every run (rows); training rows where a
    run holds nothing out.

    Closing rows give the median and the worst of each group, over the runs that have the model; the
    geometric mean, the worst and the number of wins of each model's RMSE in ratio to that of
    `relative_to`, over the runs that have both; and in how many runs it lies below the best of
    `best_of`.
    """
    models = scores.models
    rows: list[tuple[Cell, ...]] = [
        (name, *(100 * run[model].nrmse if model in run else None for model in models))
        for name, run in scores.pooled.items()
    ]
    rows += [(name, *["failed", *[None] * len(models)][: len(models)]) for name in scores.failed]
    notes = [f"NRMSE in per cent, all curves pooled; normalised by {scores.normalisers}."]
    closing: list[tuple[str, Mapping[str, Cell]]] = _summaries(scores)
    if scores.relative_to in models:
        closing += _ratios(scores, scores.relative_to)
        notes.append(
            f"Ratios are of RMSE to that of {scores.relative_to}; a ratio below one is better."
        )
    if set(scores.best_of) & set(models):
        closing.append(("below the best formula", _wins(scores)))
        notes.append(
            f"The best formula of {', '.join(scores.best_of)}: which of them it is in a run, "
            "one knows afterwards only."
        )
    rows += [(name, *map(cells.get, models)) for name, cells in closing]
    columns: Columns = ("run", *(Column(model, "", ".3g") for model in models))
    return Table.of("nrmse", "NRMSE of every run and model", columns, rows, *notes)


def models_table(scores: CampaignScores) -> Table:
    """Return validation NRMSE of every model of every run, a row each: the run's own model first,
    then from the least error up.
    """

    def place(score: Score) -> tuple[bool, bool, float]:
        return score.model != scores.own, score.model == REPEATABILITY, _error_of(score)

    rows: list[tuple[Cell, ...]] = []
    for name, run in scores.pooled.items():
        own = run.get(scores.own)
        for score in sorted(run.values(), key=place):
            ratio = _ratio(score, own) if own is not None and score is not own else None
            rows.append((name, score.model, 100 * score.nrmse, ratio))
    rows += [(name, scores.own, "failed", None) for name in scores.failed]
    columns = ("run", MODEL, "NRMSE [%] .3g", Column(f"RMSE in ratio to {scores.own}", "", ".3g"))
    note = f"All curves pooled; normalised by {scores.normalisers}."
    return Table.of("models", "NRMSE of every run and model", columns, rows, note)


def _error_of(score: Score) -> float:
    """Return the NRMSE; a run that diverged has none, which is worse than any."""
    return math.inf if math.isnan(score.nrmse) else score.nrmse


def _summaries(scores: CampaignScores) -> list[tuple[str, Mapping[str, Cell]]]:
    """Median and worst NRMSE of each group, by model."""
    rows: list[tuple[str, Mapping[str, Cell]]] = []
    for group in dict.fromkeys(scores.groups.values()):
        errors: dict[str, list[float]] = {}
        for name, run in scores.pooled.items():
            for model, score in run.items() if scores.groups.get(name) == group else ():
                errors.setdefault(model, []).append(100 * _error_of(score))
        for word, of in (("median", median), ("worst", max)):
            rows.append((f"{group}: {word}", {model: of(x) for model, x in errors.items()}))
    return rows


def _ratios(scores: CampaignScores, relative_to: str) -> list[tuple[str, Mapping[str, Cell]]]:
    """Return rows about each model's RMSE in ratio to that of one, over the runs that have both."""
    means: dict[str, Cell] = {}
    worst: dict[str, Cell] = {}
    better: dict[str, Cell] = {}
    for model in scores.models:
        if model == REPEATABILITY:  # the floor wins nothing
            continue
        pairs = [(run.get(model), run.get(relative_to)) for run in scores.pooled.values()]
        ratios = [_ratio(one, other) for one, other in pairs if one and other]
        known = [ratio for ratio in ratios if ratio is not None]
        if known:
            worst[model] = max(known)
            ties = known.count(1.0) if model != relative_to else 0
            better[model] = _won(sum(ratio < 1 for ratio in known), len(known), ties)
        if known and min(known) > 0:
            means[model] = math.exp(sum(map(math.log, known)) / len(known))
    return [("ratio, geometric mean", means), ("ratio, worst", worst), ("runs better", better)]


def _won(won: int, count: int, tied: int) -> str:
    """`3 of 5, 1 tied`: runs in which a model is strictly better, and in which it is exactly as
    good.
    """
    return f"{won} of {count}{f', {tied} tied' if tied else ''}"


def _ratio(score: Score, other: Score) -> float | None:
    """Of two RMSE; infinite where the first run diverged, None where the second did or has no error
    at all.
    """
    if not other.rmse > 0:
        return None
    return math.inf if math.isnan(score.rmse) else score.rmse / other.rmse


def _wins(scores: CampaignScores) -> dict[str, Cell]:
    """In how many runs each model lies below the best of `best_of`, and in how many it is exactly
    as good.
    """
    cells: dict[str, Cell] = {}
    for model in scores.models:
        runs = [run for run in scores.pooled.values() if model in run]
        won = tied = 0
        for run in runs:
            others = [run[name].rmse for name in scores.best_of if name in run and name != model]
            least = min(filter(math.isfinite, others), default=math.inf)
            won += run[model].rmse < least
            tied += run[model].rmse == least
        if model != REPEATABILITY:
            cells[model] = _won(won, len(runs), tied)
    return cells


def published_table(scores: CampaignScores) -> Table:
    """RMSE and NRMSE of held-out data, of every model that a publication reports, beside its
    numbers; columns without any are left out.
    """
    rows: list[tuple[Cell, ...]] = []
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
    sources = dict.fromkeys(f"Published: {paper.source}." for paper in scores.published.values())
    kept = ([row[j] for j in filled] for row in rows)
    heads = [columns[j] for j in filled]
    return Table.of("published", "Beside the published numbers", heads, kept, *sources)
