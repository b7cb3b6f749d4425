"""Score the model and its competitors: `validate.h5`, `scores.csv`, `scores.json`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mapmore_cli.domain.recording import DIRECTION
from mapmore_cli.spec.models import Competitor, ExperimentSpec
from mapmore_cli.spec.overrides import as_overrides
from mapmore_cli.stages.stage import Stage, Variation, Workspace

if TYPE_CHECKING:
    from mapmore_cli.domain.arrays import Array
    from mapmore_cli.domain.fits import FormulaFit
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.scores import Score

AT_LEAST = frozenset({"r2", "n"})
"""Metrics whose limit is a lower one; all others are errors."""


@dataclass(frozen=True)
class Slice:
    """What the scores depend on beyond the model; `static` is the spec of the needed static run, `length` the muscle's in m."""

    target: str
    against: list[str | Competitor]
    static: str | None
    length: float | None


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec; what only composites and load-cycle formulas need is in it where they may stand."""
    target = spec.target if isinstance(spec.target, str) else spec.target.column
    moving = target in ("damping", "dynamic")
    return Slice(target, spec.validation.against, spec.needs.static if moving else None, spec.muscle.length if moving else None)


def run(part: Slice, workspace: Workspace) -> None:
    """Fit the competitors to the same training data, predict every sample, and score."""
    from mapmore_cli.domain.scores import Validation
    from mapmore_cli.modelling.model import predict
    from mapmore_cli.stages.competitors import OWN, Contest
    from mapmore_cli.storage.artefacts import read_dataset, read_model, write_scores, write_validation

    dataset = read_dataset(workspace.run_dir / "ingest.h5")
    model = read_model(workspace.run_dir / "model.h5")
    static_run = workspace.needed[part.static] if part.static is not None else None
    contest = Contest(dataset, model, workspace.needed, static_run, part.length)
    predictions = {OWN: tuple(predict(model, curve.columns) for curve in dataset.curves)}
    formulas: dict[str, FormulaFit] = {}
    failed = []
    for number, competitor in enumerate(part.against):
        rival = contest.rival(competitor)
        predictions[rival.name] = rival.predictions
        formulas |= rival.formulas
        if rival.failed:
            failed.append(rival.name)
            reasons = "; ".join(note for fit in rival.formulas.values() for note in fit.notes)
            workspace.warn(f"{rival.name}: the fit failed, its rows are left out: {reasons}")
        workspace.progress("competitors", number + 1, len(part.against))
    scores = [row for name in predictions if name not in failed for row in _scores(name, part.target, predictions[name], dataset)]
    scores += _floor(part.target, [quantity.name for quantity in model.inputs], dataset)
    validation = Validation(predictions, formulas, tuple(scores), {part.target: dataset.unit(dataset.target)})
    write_validation(workspace.out / "validate.h5", validation)
    write_scores(workspace.out, validation, model.name)


def _scores(name: str, target: str, predictions: Sequence[Array], dataset: Dataset, partial: bool = False) -> Iterator[Score]:
    """Rows of one model: each split pooled, curve by curve, and rise and fall by themselves where directions are told apart.

    With `partial`, of the samples that it predicts.
    """
    import numpy as np

    from mapmore_cli.modelling.metrics import max_abs, score
    from mapmore_cli.modelling.signals.direction import FALL, RISE

    for split, held_out in (("train", False), ("validate", True)):
        every = [(curve, predicted, curve.held_out == held_out) for curve, predicted in zip(dataset.curves, predictions, strict=True)]
        rows = [(curve, predicted, mask & np.isfinite(predicted) if partial else mask) for curve, predicted, mask in every]
        parts = [(curve.id, curve.columns[dataset.target][mask], predicted[mask]) for curve, predicted, mask in rows if mask.any()]
        if not parts:
            continue
        ways = [
            (f"{curve.id};direction={word}", curve.columns[dataset.target][way], predicted[way])
            for curve, predicted, mask in rows
            for word, sign in (("rise", RISE), ("fall", FALL))
            if DIRECTION in curve.columns and (way := mask & (curve.columns[DIRECTION] == sign)).any()
        ]
        scale = max_abs(np.concatenate([curve.columns[dataset.target][mask] for curve, _, mask in every]), dataset.target, split)
        yield score(name, target, split, "all", np.concatenate([y for _, y, _ in parts]), np.concatenate([p for _, _, p in parts]), scale)
        for curve, y, p in [*parts, *ways]:
            yield score(name, target, split, curve, y, p, scale)


def _floor(target: str, inputs: Sequence[str], dataset: Dataset) -> Iterator[Score]:
    """Rows of the repeatability, where measurements at one level, coordinate and direction were repeated."""
    from mapmore_cli.domain.scores import REPEATABILITY
    from mapmore_cli.modelling.repeatability import repeats

    others = repeats(dataset.curves, dataset.target, [name for name in inputs if name != dataset.level])
    if others is not None:
        yield from _scores(REPEATABILITY, target, others, dataset, partial=True)


def missed_limits(require: Mapping[str, float], scores: Sequence[Score]) -> list[str]:
    """The `validate.require` limits that the run's own model misses, each as a sentence.

    Limits hold on the pooled validation rows, or on the training rows where nothing is held out.
    """
    pooled = [row for row in scores if row.model == "mapmore" and row.curve == "all"]
    row = next((row for row in pooled if row.split == "validate"), pooled[0])
    missed = []
    for metric, limit in require.items():
        value = float(getattr(row, metric))
        kept = value >= limit if metric in AT_LEAST else value <= limit
        if not kept:
            missed.append(f"{metric} of {row.model} on the {row.split} rows is {value:.6g}; the limit is {limit:g}")
    return missed


def needs(spec: ExperimentSpec) -> list[str | Variation]:
    """The other runs that this one is compared with, its own variations among them, and the static run that composites are fitted to."""
    static = reads(spec).static
    competitors = [c for c in spec.validation.against if isinstance(c, Competitor)]
    runs = [c.run for c in competitors if c.run is not None]
    variations = [Variation(c.label, as_overrides(c.set)) for c in competitors if c.set is not None]
    return [*dict.fromkeys([*runs, *([static] if static is not None else [])]), *variations]


STAGE = Stage(name="validate", revision=2, outputs=("validate.h5", "scores.csv", "scores.json"), reads=reads, run=run, needs=needs)
