"""The page of a campaign: tables over all runs, and the way to the page of each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
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
        return " and ".join(
            dict.fromkeys(
                score.normaliser_name for run in self.pooled.values() for score in run.values()
            )
        )


def campaign_tables(scores: CampaignScores) -> tuple[Table, ...]:
    """Every table of the page; those without rows are left out. Runs that have few models in common
    are listed one after the other.
    """
    first = models_table if scores.sparse else nrmse_table
    made = (table(scores) for table in (first, hindsight_table, published_table, order_table))
    return tuple(table for table in made if table.rows)


def nrmse_table(scores: CampaignScores) -> Table:
    """Return validation NRMSE of every model (columns) in every run (rows); training rows where a
    run holds nothing out.

    Closing rows give the median and the worst of each group, over the runs that have the model; the
    geometric mean, the worst and the number of wins of each model's RMSE in ratio to that of
    `relative_to`, over the runs that have both; and in how many runs it lies below the best of
    `best_of`.
    """
    pooled, models = scores.pooled, scores.models
    rows: list[tuple[Cell, ...]] = [
        (name, *(100 * run[model].nrmse if model in run else None for model in models))
        for name, run in pooled.items()
    ]
    rows += [
        (name, *("failed" if place == 0 else None for place in range(len(models))))
        for name in scores.failed
    ]
    notes = [f"NRMSE in per cent, all curves pooled; normalised by {scores.normalisers}."]
    rows += _summaries(scores)
    if scores.relative_to in models:
        rows += _ratios(list(pooled.values()), models, scores.relative_to)
        notes.append(
            f"Ratios are of RMSE to that of {scores.relative_to}; a ratio below one is better."
        )
    if set(scores.best_of) & set(models):
        rows.append(
            (
                "below the best formula",
                *(_wins(pooled.values(), model, scores.best_of) for model in models),
            )
        )
        notes.append(
            f"The best formula of {', '.join(scores.best_of)}: which of them it is in a run, "
            "one knows afterwards only."
        )
    columns: Columns = ("run", *(Column(model, "", ".3g") for model in models))
    return Table.of("nrmse", "NRMSE of every run and model", columns, rows, *notes)


def models_table(scores: CampaignScores) -> Table:
    """Return validation NRMSE of every model of every run, a row each: the run's own model first,
    then from the least error up.
    """
    rows: list[tuple[Cell, ...]] = []
    for name, run in scores.pooled.items():
        own = run.get(scores.own)
        for score in sorted(
            run.values(),
            key=lambda score: (
                score.model != scores.own,
                score.model == REPEATABILITY,
                _error_of(score),
            ),
        ):
            ratio = _ratio(score, own) if own is not None and score is not own else None
            rows.append((name, score.model, 100 * score.nrmse, ratio))
    rows += [(name, scores.own, "failed", None) for name in scores.failed]
    columns = ("run", MODEL, "NRMSE [%] .3g", Column(f"RMSE in ratio to {scores.own}", "", ".3g"))
    return Table.of(
        "models",
        "NRMSE of every run and model",
        columns,
        rows,
        f"All curves pooled; normalised by {scores.normalisers}.",
    )


def _error_of(score: Score) -> float:
    """Return the NRMSE; a run that diverged has none, which is worse than any."""
    return math.inf if math.isnan(score.nrmse) else score.nrmse


def _summaries(scores: CampaignScores) -> list[tuple[Cell, ...]]:
    """Median and worst NRMSE of each group."""
    rows: list[tuple[Cell, ...]] = []
    for group in dict.fromkeys(scores.groups.values()):
        runs = [run for name, run in scores.pooled.items() if scores.groups.get(name) == group]
        errors = [
            [100 * _error_of(run[model]) for run in runs if model in run] for model in scores.models
        ]
        rows.append(
            (f"{group}: median", *(median(of_model) if of_model else None for of_model in errors))
        )
        rows.append((f"{group}: worst", *(max(of_model, default=None) for of_model in errors)))
    return rows


def _ratios(
    runs: Sequence[Pooled], models: Sequence[str], relative_to: str
) -> list[tuple[Cell, ...]]:
    compared = {
        m: [_ratio(run[m], run[relative_to]) for run in runs if m in run and relative_to in run]
        for m in models
    }
    ratios = {m: [ratio for ratio in found if ratio is not None] for m, found in compared.items()}
    ratios[REPEATABILITY] = []  # the floor wins nothing
    means = {
        m: math.exp(sum(map(math.log, r)) / len(r)) if r and min(r) > 0 else None
        for m, r in ratios.items()
    }
    ties = {m: sum(r == 1 for r in ratios[m]) if m != relative_to else 0 for m in models}
    return [
        ("ratio, geometric mean", *(means[m] for m in models)),
        ("ratio, worst", *(max(ratios[m], default=None) for m in models)),
        (
            "runs better",
            *(_of(sum(r < 1 for r in ratios[m]), len(ratios[m]), ties[m]) for m in models),
        ),
    ]


def _of(won: int, count: int, tied: int) -> str | None:
    """`3 of 5, 1 tied`: runs in which a model is strictly better, and in which it is exactly as
    good.
    """
    return f"{won} of {count}{f', {tied} tied' if tied else ''}" if count else None


def _ratio(score: Score, other: Score) -> float | None:
    """Of two RMSE; infinite where the first run diverged, None where the second did or has no error
    at all.
    """
    if not other.rmse > 0:
        return None
    return math.inf if math.isnan(score.rmse) else score.rmse / other.rmse


def _wins(runs: Iterable[Pooled], model: str, best_of: Sequence[str]) -> str | None:
    """In how many runs a model lies below the best of others, and in how many it is exactly as
    good.
    """
    others = [name for name in best_of if name != model]
    compared = [(run[model].rmse, _best(run, others)) for run in runs if model in run]
    won = sum(best is None or rmse < best.rmse for rmse, best in compared)
    tied = sum(best is not None and rmse == best.rmse for rmse, best in compared)
    return _of(won, len(compared), tied) if model != REPEATABILITY else None


def hindsight_table(scores: CampaignScores) -> Table:
    """Who wins where, and how near to repeated measurements: the least error of all models, of
    `best_of`, and of the runs' own model.
    """
    rows: list[tuple[Cell, ...]] = []
    for name, run in scores.pooled.items():
        least = _best(run, [model for model in scores.models if model != REPEATABILITY])
        formula, own, floor = (
            _best(run, scores.best_of),
            run.get(scores.own),
            run.get(REPEATABILITY),
        )
        if least is None or formula is None or own is None:
            continue
        ratios = (_ratio(own, formula), _ratio(own, floor) if floor else None)
        first, second = (
            _tied(run, least),
            _tied({m: run[m] for m in scores.best_of if m in run}, formula),
        )
        rows.append(
            (name, first, 100 * least.nrmse, second, 100 * formula.nrmse, 100 * own.nrmse, *ratios)
        )
    columns: Columns = (
        *(
            "run",
            "least of all",
            "NRMSE [%] .3g",
            "least of the formulas",
            "NRMSE [%] .3g",
            Column(scores.own, "%", ".3g"),
        ),
        *("ratio to that formula .3g", "ratio to repeatability .3g"),
    )
    note = (
        f"The formulas are {', '.join(scores.best_of)}; the least is picked afterwards, which "
        "nobody can do beforehand."
    )
    return Table.of("hindsight", "Who is best where", columns, rows, note)


def _best(run: Pooled, models: Sequence[str]) -> Score | None:
    usable = [run[model] for model in models if model in run and math.isfinite(run[model].rmse)]
    return min(usable, key=lambda score: score.rmse, default=None)


def _tied(run: Pooled, best: Score) -> str:
    """Return the best model, with those that are exactly as good."""
    others = [
        m
        for m, score in run.items()
        if score.rmse == best.rmse and m not in (best.model, REPEATABILITY)
    ]
    return f"{best.model} (tied with {', '.join(others)})" if others else best.model


def published_table(scores: CampaignScores) -> Table:
    """RMSE and NRMSE of held-out data, of every model that a publication reports, beside its
    numbers; columns without any are left out.
    """
    rows: list[tuple[Cell, ...]] = []
    for name, run in scores.pooled.items():
        paper = scores.published.get(name, Published(""))
        for model, score in run.items():
            rmse, nrmse = paper.shown_rmse(model), paper.nrmse.get(model)
            if score.split == "validate" and (rmse, nrmse) != (None, None):
                printed = 100 * nrmse if nrmse is not None else None
                rows.append(
                    (
                        name,
                        model,
                        score.rmse,
                        rmse,
                        100 * score.nrmse,
                        printed,
                        _to_published(score, paper),
                    )
                )
    units = {scores.units.get(str(row[0]), "") for row in rows}
    unit = units.pop() if len(units) == 1 else ""
    columns = (
        *(
            "run",
            MODEL,
            f"RMSE [{unit}] .3g",
            f"published RMSE [{unit}] .3g",
            "NRMSE [%] .3g",
            "published NRMSE [%] .3g",
        ),
        "ours to published .2f",
    )
    filled = [j for j in range(len(columns)) if any(row[j] is not None for row in rows)]
    sources = dict.fromkeys(f"Published: {paper.source}." for paper in scores.published.values())
    kept = ([row[j] for j in filled] for row in rows)
    return Table.of(
        "published", "Beside the published numbers", [columns[j] for j in filled], kept, *sources
    )


def _to_published(score: Score, paper: Published) -> float | None:
    """Our error in ratio to the published one; None beside a lower bound."""
    if score.model in paper.nrmse:
        return score.nrmse / paper.nrmse[score.model]
    return score.rmse / paper.rmse[score.model] if score.model in paper.rmse else None


def order_table(scores: CampaignScores) -> Table:
    """Whether the models of a run come in the order that a publication has them in, from the least
    error up.

    Lower bounds stand at their bound, so that they only tell an order where it is clear.
    """
    rows: list[tuple[Cell, ...]] = []
    for name, run in scores.pooled.items():
        paper = scores.published.get(name, Published(""))
        printed = paper.nrmse or {**paper.rmse, **paper.rmse_at_least}
        ours = {
            model: run[model].rmse
            for model in printed
            if model in run and run[model].split == "validate"
        }
        if len(ours) > 1:
            theirs, mine = (sorted(ours, key=errors.__getitem__) for errors in (printed, ours))
            rows.append(
                (
                    name,
                    " < ".join(theirs),
                    " < ".join(mine),
                    "agrees" if theirs == mine else "differs",
                )
            )
    title = "Order of the models by their error, as published and here"
    return Table.of("order", title, ("run", "as published", "here", "order"), rows)
