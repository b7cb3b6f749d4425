"""Score the model and its competitors: `validate.h5`, `scores.csv`, `scores.json`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.spec.models import Competitor, ExperimentSpec
from mapmore_cli.stages.stage import Stage, Workspace

if TYPE_CHECKING:
    from mapmore_cli.domain.arrays import Array
    from mapmore_cli.domain.fits import FormulaFit
    from mapmore_cli.domain.models import Model
    from mapmore_cli.domain.recording import Dataset
    from mapmore_cli.domain.scores import Score

OWN = "mapmore"
"""Name of the run's own model in its scores."""

AT_LEAST = frozenset({"r2", "n"})
"""Metrics whose limit is a lower one; all others are errors."""


@dataclass(frozen=True)
class Slice:
    """What the scores depend on beyond the model."""

    target: str
    against: list[str | Competitor]


def reads(spec: ExperimentSpec) -> Slice:
    """The stage's slice of the spec."""
    target = spec.target if isinstance(spec.target, str) else spec.target.column
    return Slice(target, spec.validation.against)


def run(part: Slice, workspace: Workspace) -> None:
    """Fit the competitors to the same training data, predict every sample, and score."""
    from mapmore_cli.domain.scores import Validation
    from mapmore_cli.modelling.model import predict
    from mapmore_cli.storage.artefacts import read_dataset, read_model, write_scores, write_validation

    dataset = read_dataset(workspace.run_dir / "ingest.h5")
    model = read_model(workspace.run_dir / "model.h5")
    predictions = {OWN: tuple(predict(model, curve.columns) for curve in dataset.curves)}
    formulas: dict[str, FormulaFit] = {}
    for number, competitor in enumerate(part.against):
        if isinstance(competitor, Competitor) and competitor.run is not None:
            predictions[competitor.label] = _of_other_run(workspace.needed[competitor.run], model, dataset)
        else:
            name, formula = _fitted(competitor, dataset)
            formulas[name], predictions[name] = formula, _predicted(formula, dataset)
            if formula.failed:
                workspace.warn(f"{name}: the fit failed, its rows are left out: {'; '.join(formula.notes)}")
        workspace.progress("competitors", number + 1, len(part.against))
    scored = [name for name in predictions if name not in formulas or not formulas[name].failed]
    scores = tuple(row for name in scored for row in _scores(name, part.target, predictions[name], dataset))
    validation = Validation(predictions, formulas, scores, {part.target: dataset.unit(dataset.target)})
    write_validation(workspace.out / "validate.h5", validation)
    write_scores(workspace.out, validation, model.name)


def _fitted(competitor: str | Competitor, dataset: Dataset) -> tuple[str, FormulaFit]:
    from mapmore_cli.modelling.backbone import fit_formula

    if isinstance(competitor, str):
        return competitor, fit_formula(competitor, dataset.curves, dataset.target)
    assert competitor.model is not None
    return competitor.label, fit_formula(competitor.model, dataset.curves, dataset.target, competitor.method)


def _of_other_run(run_dir: Path, own: Model, dataset: Dataset) -> tuple[Array, ...]:
    """Predictions of another run's model on this run's curves.

    Raises
    ------
    SpecError
        Where that model is of another quantity or unit, or needs an input that this study lacks.
    """
    from mapmore_cli.domain.errors import SpecError
    from mapmore_cli.modelling.model import predict
    from mapmore_cli.storage.artefacts import read_model

    other = read_model(run_dir / "model.h5")
    differing = [q.name for q in (other.output, *other.inputs) if dataset.quantities.get(q.name) != q]
    if other.output != own.output or differing:
        raise SpecError(
            f"validate.against: the model of {other.name} is of other quantities or units ({', '.join(differing) or other.output.name})",
            "compare runs of the same quantities in the same units",
        )
    return tuple(predict(other, curve.columns) for curve in dataset.curves)


def _predicted(formula: FormulaFit, dataset: Dataset) -> tuple[Array, ...]:
    import numpy as np

    from mapmore_cli.modelling import literature

    if formula.failed:
        return tuple(np.full(curve.size, np.nan) for curve in dataset.curves)
    return tuple(literature.get(formula.name).predict(formula.parameters, curve.columns) for curve in dataset.curves)


def _scores(name: str, target: str, predictions: Sequence[Array], dataset: Dataset) -> Iterator[Score]:
    """Rows of one model: each split pooled, then curve by curve."""
    import numpy as np

    from mapmore_cli.modelling.metrics import max_abs, score

    for split, held_out in (("train", False), ("validate", True)):
        parts = [
            (curve.id, curve.columns[dataset.target][mask], predicted[mask])
            for curve, predicted in zip(dataset.curves, predictions, strict=True)
            if (mask := curve.held_out == held_out).any()
        ]
        if not parts:
            continue
        measured = np.concatenate([y for _, y, _ in parts])
        scale = max_abs(measured, dataset.target, split)
        yield score(name, target, split, "all", measured, np.concatenate([p for _, _, p in parts]), scale)
        for curve, y, p in parts:
            yield score(name, target, split, curve, y, p, scale)


def missed_limits(require: Mapping[str, float], scores: Sequence[Score]) -> list[str]:
    """The `validate.require` limits that the run's own model misses, each as a sentence.

    Limits hold on the pooled validation rows, or on the training rows where nothing is held out.
    """
    pooled = [row for row in scores if row.model == OWN and row.curve == "all"]
    row = next((row for row in pooled if row.split == "validate"), pooled[0])
    missed = []
    for metric, limit in require.items():
        value = float(getattr(row, metric))
        kept = value >= limit if metric in AT_LEAST else value <= limit
        if not kept:
            missed.append(f"{metric} of {row.model} on the {row.split} rows is {value:.6g}; the limit is {limit:g}")
    return missed


def needs(spec: ExperimentSpec) -> list[str]:
    """The specs of the other runs that this one is compared with."""
    return [c.run for c in spec.validation.against if isinstance(c, Competitor) and c.run is not None]


STAGE = Stage(name="validate", revision=1, outputs=("validate.h5", "scores.csv", "scores.json"), reads=reads, run=run, needs=needs)
