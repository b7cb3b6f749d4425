"""Make tables and sentences from the scores of a run, from comparisons of models, and from searches
for a structure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from mapmore_cli.domain.recording import Dataset, Quantity
from mapmore_cli.domain.results import Search
from mapmore_cli.domain.scores import (
    MEASURES,
    REPEATABILITY,
    STRUCTURE_SEEN,
    Published,
    Score,
    ScoreTable,
    deciding,
)
from mapmore_cli.modelling.validation.comparison import Comparison
from mapmore_cli.reporting.table import MODEL, Cells, Column, Table, cells_of, title_of, with_unit

FLOOR_NOTE = (
    f"{REPEATABILITY}: not a model, but the difference between repeated measurements, that is, "
    "the distance of a sample from the mean of the other recordings at the same level, place and "
    "direction. If cycles are held out, it is the distance from the last training cycle: at the "
    "same moment if the input repeats itself in time, otherwise at the same place of the same "
    "stroke. No model is likely to have a much smaller error."
)
FAR_NOTE = (
    "The target lies far from zero, so that every model has a small NRMSE. By range: RMSE divided "
    "by the range of the measured values, which is the full scale FS with `validate: "
    "{normaliser: range}`."
)
FREE_RUN_NOTE = (
    "All numbers are those of the free run, in which a model with delayed outputs uses its own "
    "predictions. RRSE: root relative squared error, the RMSE divided by the standard deviation "
    "of the measured values. One step: the model uses the measured past instead, which says "
    "little about a simulation."
)


def score_table(
    scores: Sequence[Score],
    units: Mapping[str, str],
    published: Published | None = None,
    failed: Sequence[str] = (),
) -> Table:
    """Return the table of the scores over all curves together. Rows of held-out data come first;
    the models keep the given order.

    `units` holds the unit of every target. The numbers of a publication are shown only beside the
    rows of held-out data, because they are errors on held-out data. Models in `failed` have no
    scores; they get a row that says so.
    """
    pooled = sorted((s for s in scores if s.curve == "all"), key=lambda s: s.split != "validate")
    unit = units.get(pooled[0].target, "") if pooled else ""
    columns, rows = _metrics(pooled, unit)
    rows += [(name, "failed", *[None] * (len(columns) - 2)) for name in failed]
    notes = [full_scale(pooled, unit)] if pooled else []
    notes += [FAR_NOTE] if any(s.far for s in pooled) else []
    notes += [FLOOR_NOTE] if any(s.model == REPEATABILITY for s in pooled) else []
    notes += [FREE_RUN_NOTE] if any(s.runs_free for s in pooled) else []
    if published is not None and pooled and pooled[0].split == "validate":
        percent = {model: 100 * value for model, value in published.nrmse.items()}
        models = [*published.rmse, *published.rmse_at_least]
        newton = {model: published.shown_rmse(model) for model in models}
        for name, cells in (("NRMSE [%]", percent), (f"RMSE [{unit}]", newton)):
            if cells:
                columns.append(f"published {name} .3g")
                rows = [
                    (*row, cells.get(str(row[0])) if row[1] != "train" else None) for row in rows
                ]
        notes.append(f"Published: {published.source}.")
    elif published is not None:
        notes.append(
            f"Published numbers ({published.source}) are of held-out data, but nothing is held "
            "out here with which they could be compared."
        )
    title = f"Scores (target: {pooled[0].target}), all curves pooled" if pooled else "Scores"
    return Table.of("scores", title, columns, rows, *notes)


def full_scale(pooled: Sequence[Score], unit: str) -> str:
    """Return a sentence that says by which quantity errors are divided (the full scale), with its
    value.
    """
    scale = f"FS = {pooled[0].normaliser_name} = {pooled[0].normaliser:.4g} {unit}".rstrip()
    return f"NRMSE: RMSE / FS, for all rows {scale}."


def curve_scores_table(scores: Sequence[Score], units: Mapping[str, str]) -> Table:
    """Return a table of the scores of each curve, with a row for each model."""
    order: dict[str, int] = {}
    for score in scores:
        order.setdefault(score.curve, len(order))
    single = [s for s in scores if s.curve != "all"]
    single.sort(key=lambda s: (s.split != "validate", order[s.curve]))
    columns, rows = _metrics(single, units.get(single[0].target, "") if single else "")
    cells = [(s.curve, *row) for s, row in zip(single, rows, strict=True)]
    return Table.of("curve_scores", "Scores by curve", ("curve", *columns), cells)


def _metrics(scores: Sequence[Score], unit: str) -> tuple[list[Column | str], list[Cells]]:
    """Return the columns and rows of a table of scores. Measures that none of the scores has are
    left out.
    """
    shown = {
        measure.heading: name
        for name, measure in MEASURES.items()
        if measure.heading and (measure.shown is None or any(map(measure.shown, scores)))
    }
    rows: list[Cells] = [(s.model, s.split, *cells_of(s, shown)) for s in scores]
    return [MODEL, "data", *with_unit(shown, unit)], rows


EQUAL_WITHIN = 0.01
"""Largest relative difference between two errors at which neither model is called better."""


def scored(table: ScoreTable, dataset: Dataset) -> Quantity:
    """Return the quantity whose errors a table of scores contains. If the model is inverted, this
    is an input of the model.
    """
    name = next(iter(table.units), dataset.target)
    return dataset.quantities[name if name in dataset.quantities else dataset.target]


def verdict_sentence(
    scores: Sequence[Score],
    model: str,
    target: Quantity,
    failed: Sequence[str] = (),
    alert: str = "",
    warnings: Sequence[str] = (),
) -> str:
    """Return a sentence that compares the error of the `model` with the smallest error of the
    other models, over all curves, on held-out data if there are any.

    `target` is the scored quantity. `failed` names the competitors without scores, because their
    fit failed. If the `warnings` say that held-out data chose the structure, the sentence begins
    with this warning. The `alert` follows, if there is one, and then the comparison. Competitors
    that were trained with held-out data are named but not compared.
    """
    head = f"Alert: {alert}. " if alert else ""
    compared = deciding(scores)
    ours = _known_score(compared, model)
    if ours is None:
        return f"{head}{model} gave no prediction."
    where = "on the held-out data"
    if ours.split == "train":
        where = (
            "on its own training data (nothing was held out, so this says little about new data)"
        )
    unit = _of(target.unit)
    by_range = (
        f", {_percent(ours.nrmse_range)} of the range: the target lies far from zero"
        if ours.far
        else ""
    )
    errors = f"an NRMSE of {_percent(ours.nrmse)} (RMSE {ours.rmse:.3g}{unit}{by_range})"
    others = [s for s in compared if s.model not in (model, REPEATABILITY)]
    floors = [
        f"; repeated measurements differ by {_percent(s.nrmse)}"
        for s in compared
        if s.model == REPEATABILITY
    ]
    comparison = _comparison(ours, others, failed)
    seen = [title_of(s.model) for s in scores if (s.split, s.curve) == ("seen", "all")]
    if seen:
        trained = "were trained on held-out samples, and are" if seen[1:] else TRAINED
        comparison += f"; {', '.join(seen)} {trained} not compared"
    chosen = [
        f"{warning.split(':')[0]}; " for warning in warnings if warning.startswith(STRUCTURE_SEEN)
    ]
    predicts = f"{model} predicts {target.name} with {errors} {where}; {comparison}"
    return f"{''.join(chosen[:1])}{head}{predicts}{''.join(floors)}."


def _known_score(scores: Sequence[Score], model: str) -> Score | None:
    """Return the score of a model, or None if it has no finite error."""
    return next((s for s in scores if s.model == model and math.isfinite(s.nrmse)), None)


TRAINED = "was trained on held-out samples, and is"


def short_verdict(table: ScoreTable, model: str) -> str:
    """Return a line that compares the `model` with the best other model. The line contains the
    errors of both.
    """
    compared, unit = deciding(table.scores), next(iter(table.units.values()), "")
    ours = _known_score(compared, model)
    if ours is None:
        return "no prediction"
    best = _best([s for s in compared if s.model not in (model, REPEATABILITY)])
    word = "alone" if best is None else _word(ours, best)
    rows = [ours] if best is None else [ours, best]
    errors = (f"{title_of(s.model)} {_error(s, unit)}" for s in rows)
    where = "held-out" if ours.split == "validate" else "training"
    alert = "alert: the errors are not noise alone; " if table.alert else ""
    return f"{alert}{word}: {ours.target}, {where} RMSE: {', '.join(errors)}"


def _error(score: Score, unit: str) -> str:
    """Return the RMSE with its unit, and the NRMSE, as text for people."""
    return f"{score.rmse:.3g}{_of(unit)} ({_percent(score.nrmse)})"


def _of(unit: str) -> str:
    """Return a unit as text that can be appended to a number; it is empty for a quantity without
    unit.
    """
    return "" if unit in ("", "1") else f" {unit}"


def _best(others: Sequence[Score]) -> Score | None:
    """Return the score with the smallest error; None if no error is finite."""
    usable = [s for s in others if math.isfinite(s.nrmse)]
    return min(usable, key=lambda s: s.nrmse, default=None)


def _word(ours: Score, best: Score) -> str:
    """Return the word that compares the error of the own model with the smallest error of the other
    models, for example `better`.
    """
    if ours.rmse == best.rmse:
        return "an exact tie"
    if abs(ours.rmse - best.rmse) <= EQUAL_WITHIN * max(ours.rmse, best.rmse):
        return "no difference to speak of"
    return "better" if ours.rmse < best.rmse else "worse"


def _comparison(ours: Score, others: Sequence[Score], failed: Sequence[str]) -> str:
    best = _best(others)
    if best is None:
        if others or failed:
            return "no competitor gave a prediction to compare with"
        return "it was compared with no other model"
    claim = f"the best competitor ({title_of(best.model)}) reaches {_percent(best.nrmse)}"
    word = _word(ours, best)
    if word not in ("better", "worse"):
        return f"{claim}: {word}"
    ratio = f" ({ours.rmse / best.rmse:.3g} times the RMSE)" if best.rmse > 0 else ""
    return f"{claim}: {ours.model} is {word}{ratio}"


def pieces_sentence(scores: Sequence[Score], model: str, backbone: str) -> str:
    """Return a sentence that compares the error of the `model` with the error of its formula
    alone (`backbone`), over all curves. Return an empty text if one of the two has no score.
    """
    errors = {score.model: score.rmse for score in deciding(scores)}
    alone = errors.get(backbone, errors.get("backbone", math.nan))
    gain = 1 - errors.get(model, math.nan) / alone if alone else math.nan
    if not math.isfinite(gain):
        return ""
    if gain > EQUAL_WITHIN:
        return f"pieces: {100 * gain:.3g} % less error than the backbone {backbone} alone"
    word = "as good" if gain > -EQUAL_WITHIN else "better"
    return f"the backbone alone is {word}: `model: {{type: literature, name: {backbone}}}`"


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.3g} %"


def changes_table(comparison: Comparison) -> Table:
    """Return a table with a row for every curve that both models have. A row gives the ratio of the
    later output to the earlier output, the weight of the curve in the ratio of all curves together,
    and the differences between the outputs. The curve with the largest root mean square difference
    comes first.
    """
    columns = {
        "curve": "curve",
        "ratio .4f": "ratio",
        "weight [%] .1f": "weight",
        "mean difference [UNIT] .3g": "difference",
        "RMS difference [UNIT] .3g": "rms",
        "largest difference [UNIT] .3g": "largest",
    }
    rows: list[Cells] = []
    for curve in comparison.by_effect:
        place = ", ".join(f"{name} {value:.4g}" for name, value in curve.place.items())
        rows.append((*cells_of(curve, columns), place))
    rows.append(("all", comparison.ratio, 100.0, *[None] * 4))
    low, high = comparison.interval
    permuted = (
        ""
        if comparison.p_permutation is None
        else f"; permutation of the curves' signs p = {comparison.p_permutation:.2g}"
    )
    note = (
        f"Ratio of all curves: 95 % interval {low:.4f} to {high:.4f} (Student's t, "
        f"{len(comparison.curves) - 1} degrees of freedom; the unit is "
        f"the curve), p = {comparison.p:.2g}{permuted}. Weight: share of the sum of squares of "
        "the earlier output."
    )
    title = f"{comparison.after} against {comparison.before}"
    headings = with_unit(columns, comparison.unit)
    return Table.of("changes", title, (*headings, "at"), rows, note)


def drift_table(names: Sequence[str], results: Sequence[Comparison]) -> Table:
    """Return a table that compares the first of the named models with each of the others."""
    later = zip(names[1:], results, strict=True)
    rows = ((name, result.ratio, *result.interval, result.answer) for name, result in later)
    columns = (MODEL, "ratio .4f", "from .4f", "to .4f", "answer")
    return Table.of("drift", f"Every model against {names[0]}", columns, rows)


def search_table(search: Search) -> Table:
    """Return a table of a search for a structure, with a row for every structure that was tried,
    the smallest error first. Remarks mark the best structure and the chosen one.
    """
    columns = {
        "structure": "words",
        "left-out error [%] .3f": "error",
        "levels left out [%] .3f": "parts",
        "above the best [%] .1f": "excess",
        "standard error [%] .1f": "spread",
    }
    rows: list[Cells] = []
    marks = {"best": search.best, "chosen": search.chosen}
    order = sorted(
        enumerate(search.tried),
        key=lambda numbered: (bool(numbered[1].failure), numbered[1].excess),
    )
    for number, structure in order:
        remark = ", ".join(mark for mark, place in marks.items() if place == number)
        if structure.family == "black box":
            remark = "to compare with"
        if structure.failure:
            remark = f"failed: {structure.failure}"
        rows.append(
            (*cells_of(structure, columns), structure.parameters or None, structure.seconds, remark)
        )
    notes = (
        f"Left out in turn: {search.left_out}. Errors: RMSE / FS, FS = range of the training "
        f"samples = {search.scale:.4g}. Above the best: mean of the logarithm of the ratio over "
        "all folds (for recordings, the median), and the standard error of the mean.",
        *((f"Levels left out: the same for {search.parts}.",) if search.parts else ()),
        f"Chosen: {search.rule}. Held-out data were not used.",
        *search.notes,
    )
    title = "Structures that were tried on training data"
    heads = (*columns, "parameters", "seconds .2f", "remark")
    return Table.of("search", title, heads, rows, *notes)
