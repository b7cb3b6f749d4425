"""Collect the alerts of a run: reasons why the error that the run reports may be misleading. The
page, `--json` and stderr show the same alerts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import AUTOCORRELATION, ResidualTest, Search, Validation
from mapmore_cli.domain.scores import OWN, REPEATABILITY, STRUCTURE_SEEN, Alert, Score, deciding
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.validation.coverage import new_combinations, share_outside
from mapmore_cli.reporting.score_tables import EQUAL_WITHIN
from mapmore_cli.reporting.table import title_of

FEW_CURVES = 3
"""Smallest number of held-out curves without an alert. With fewer curves, their error says little
about the error on other curves, and no standard error is computed from them.
"""

ALERTS: Mapping[str, str] = {
    "structure": "fit",
    "unconfirmed": "unconfirmed",
    "warning": "fit",
    "competitor": "nrmse",
    "black box": "terms",
    "residuals": "fit",
    "mean error": "fit",
    "extrapolated": "fit",
    "combined": "fit",
    "near": "nrmse",
    "few curves": "fit",
    "search": "terms",
    "check": "data",
}
"""Section of the page to which each kind of alert refers. The worst kind comes first."""


def alerts_of(
    dataset: Dataset,
    model: Model,
    validation: Validation,
    unconfirmed: Sequence[str] = (),
    doubts: Sequence[str] = (),
    search: Search | None = None,
) -> tuple[Alert, ...]:
    """Return the alerts of all outputs, the worst first.

    - `unconfirmed`: guesses in the spec that nobody has confirmed.
    - `doubts`: findings of the rules of `check`.
    - `search`: the structures that were tried, with notes on the choice.
    """
    outputs = list(zip(dataset.each, model.each, validation.each, strict=True))
    alerts: list[tuple[str, str, str]] = []
    for curves, model_of_output, scored in outputs:
        target = scored.scores[0].target if len(outputs) > 1 and scored.scores else ""
        alerts += ((*alert, target) for alert in _of_output(curves, model_of_output, scored))
    if search:
        alerts += (
            ("black box" if note == search.outdone else "search", note, "") for note in search.notes
        )
    alerts += (("check", doubt, "") for doubt in doubts)
    if unconfirmed:
        alerts.append(("unconfirmed", unconfirmed_sentence(len(unconfirmed)), ""))
    ranks = [*ALERTS]
    alerts.sort(key=lambda alert: ranks.index(alert[0]))
    return tuple(Alert(kind, words, ALERTS[kind], of) for kind, words, of in dict.fromkeys(alerts))


def unconfirmed_sentence(count: int) -> str:
    """Return a sentence that says how many guesses of a spec nobody has confirmed, and what to
    do.
    """
    guesses = "guess of the spec is" if count == 1 else "guesses of the spec are"
    return (
        f"{count} {guesses} not confirmed, and the scores mean nothing if one of them is wrong: "
        "run `mapmore check`, and add `--confirm` if all guesses are right"
    )


def _of_output(dataset: Dataset, model: Model, validation: Validation) -> Iterator[tuple[str, str]]:
    """Yield the kind and the sentence of each alert of one output."""
    for warning in validation.warnings:
        yield "structure" if warning.startswith(STRUCTURE_SEEN) else "warning", warning
    yield from _of_competitors(validation.scores, next(iter(validation.units.values()), ""))
    for test in validation.residual_tests:
        if test.fails:
            yield _of_residuals(test)
    left_out = any(row.split == "validate" for row in validation.scores)
    yield from _of_held_out(dataset, model, left_out)


def _of_residuals(test: ResidualTest) -> tuple[str, str]:
    count = f"{test.beyond} of {test.tested}"
    if test.name == AUTOCORRELATION:
        words = (
            f"the errors are not noise alone: {count} lags of their autocorrelation lie "
            "outside the limits of noise"
        )
        return "residuals", words
    words = (
        f"the errors depend on {test.name}: {count} tests with it lie outside the limits of noise"
    )
    return "mean error", words


def _of_held_out(dataset: Dataset, model: Model, left_out: bool) -> Iterator[tuple[str, str]]:
    """Yield alerts if nothing is held out, if fewer than `FEW_CURVES` curves have held-out samples,
    or if held-out samples lie outside the training data. `left_out` is True if the model was scored
    by cross-validation, in which every part of the data is held out once.
    """
    held_out = [curve for curve in dataset.curves if curve.held_out.any()]
    if not held_out:
        if not left_out:
            words = "nothing is held out: errors on the training data say little about new data"
            yield "few curves", words
        return
    if len(held_out) < FEW_CURVES:
        curves = "curve has" if len(held_out) == 1 else "curves have"
        words = f"only {len(held_out)} {curves} held-out samples: the error on others may be larger"
        yield "few curves", words
    if share := share_outside(model, dataset):
        words = f"{100 * share:.3g} % of the held-out samples lie beyond the training range"
        yield "extrapolated", words
    if most := max(new_combinations(model, dataset), default=None):
        combined, first, second = most
        words = (
            f"{100 * combined:.3g} % of the held-out samples combine {first} and {second} as no "
            "training sample does, although each of them is inside its range: the model "
            "extrapolates there, so measure such combinations for training"
        )
        yield "combined", words


def _of_competitors(scores: Sequence[Score], unit: str) -> Iterator[tuple[str, str]]:
    """Yield an alert for each competitor whose pooled error is smaller than the error of the run's
    own model by more than 1 %. The sentence with the result of the run uses the same limit. If the
    competitor is a black box, the alert says so, and what may reduce the error of the own model.

    Yield another alert that names the competitors that are nearly as good. For each curve, the RMSE
    of the own model is subtracted from the RMSE of the competitor; the mean of these differences is
    at most one standard error of the mean. A competitor is named only if it has an error on at
    least `FEW_CURVES` curves.
    """
    compared = [s for s in deciding(scores) if math.isfinite(s.rmse) and s.model != REPEATABILITY]
    ours = next((score for score in compared if score.model == OWN), None)
    if ours is None:
        return
    better = [s for s in compared if s.rmse < (1 - EQUAL_WITHIN) * ours.rmse]
    for score in sorted(better, key=lambda score: score.rmse):
        errors = f"RMSE {score.rmse:.3g} against {ours.rmse:.3g} {unit}".rstrip()
        title = title_of(score.model)
        yield (
            "competitor",
            f"{title}, a black box that gives no equations, has a smaller error: {errors}; other "
            "inputs, further terms, longer structures or more training data may reduce the error "
            f"of {OWN}"
            if score.model in LEARNERS
            else f"{title} has a smaller error: {errors}",
        )
    curves = _errors_of_curves(scores, ours.split)
    near = []
    for score in (s for s in compared if s.model != OWN and s not in better):
        shared = curves.get(score.model, {}).keys() & curves.get(OWN, {}).keys()
        more = [curves[score.model][curve] - curves[OWN][curve] for curve in sorted(shared)]
        if len(more) >= FEW_CURVES and np.mean(more) <= np.std(more, ddof=1) / len(more) ** 0.5:
            near.append(title_of(score.model))
    if near:
        words = f"errors on the curves equal those of {OWN} within one standard error"
        yield "near", f"{', '.join(near)}: {words}"


def _errors_of_curves(scores: Sequence[Score], split: str) -> dict[str, dict[str, float]]:
    """Return the RMSE of every curve, for each model: `errors[model][curve]`. The `split` says
    which samples are used: `validate` (held out) or `train`.
    """
    errors: dict[str, dict[str, float]] = {}
    for score in scores:
        if score.split == split and score.curve != "all" and math.isfinite(score.rmse):
            errors.setdefault(score.model, {})[score.curve] = score.rmse
    return errors
