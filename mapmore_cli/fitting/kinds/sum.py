"""Models that are added up: those of needed runs, or formulas that are fitted together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import FitError, SpecError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import CurveRange, Formula, Model, Part
from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds.choices import FitChoices, ModelChoices
from mapmore_cli.fitting.stage import Workspace
from mapmore_cli.modelling.expressions import Name, parse
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.sums.joint import Summand, fit_jointly, refuse_shared_names, split, sum_of
from mapmore_cli.spec.sections import model as sections
from mapmore_cli.storage.run_folder import RunFiles


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """Formulas together; nothing where the summands are fitted by runs of their own.

    Raises FitError where the formulas did not converge to anything usable.
    """
    del workspace
    formulas = summands_of(part.model.sum or [])
    return FitResult(_fitted(formulas, dataset) if formulas else None)


def _fitted(formulas: Sequence[Summand], dataset: Dataset) -> FormulaFit:
    training = pooled_training(dataset.curves)
    found = fit_jointly(formulas, training, training[dataset.target])
    if found.failed:
        raise FitError(f"the fit of {found.name} failed: {'; '.join(found.notes)}", "take other formulas")
    return found


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """Return the sum: static plus damping, or the parts that the spec names."""
    joint = workspace.files.fit().formula
    return _built(part, dataset, joint, lambda path: RunFiles(workspace.needed[path]).model())


def refit_parts(part: ModelChoices, dataset: Dataset, needed: Mapping[str, Path]) -> Model:
    """Return the same where the runs that are added up are fitted anew without the levels and recordings that the dataset holds out."""
    formulas = summands_of(part.model.sum or [])
    joint = _fitted(formulas, dataset) if formulas else None
    return _built(part, dataset, joint, lambda path: _without(needed[path], dataset))


def _built(part: ModelChoices, dataset: Dataset, joint: FormulaFit | None, model_of: Callable[[str], Model]) -> Model:
    """Return the sum of formulas that were fitted as `joint`, or of the models of runs by the path of their spec."""
    output, quantities = dataset.quantities[dataset.target], dataset.quantities
    if part.model.sum is None:
        return sum_of(part.name, [Part(model_of(path)) for path in part.summands], output, quantities)
    if joint is not None:
        return sum_of(part.name, formula_parts(summands_of(part.model.sum), joint, dataset), output, quantities)
    parts = [Part(model_of(str(one.model)), float(one.sign), dict(one.inputs)) for one in part.model.sum]
    refuse_shared_names([(one.model.name, [q.name for q in one.model.inputs], one.inputs) for one in parts])
    return sum_of(part.name, parts, output, quantities)


def _without(run_dir: Path, dataset: Dataset) -> Model:
    """Return the model of a run, fitted anew to its data without the curves that a dataset holds out as a whole: by level, else by name."""
    from mapmore_cli.fitting.kinds.choices import model_choices
    from mapmore_cli.fitting.left_out import made_anew
    from mapmore_cli.spec.loader import load

    choices = model_choices(load(run_dir / "experiment.yaml").spec)
    if choices.summands:
        found = f"{choices.name} adds runs up itself, and cannot be fitted anew without a part of the data"
        raise SpecError(f"validate.intervals: {found}", "leave it out, or add up all runs in one spec")
    own = RunFiles(run_dir).dataset()
    out = {_key(curve) for curve in dataset.curves if not curve.training.any()}
    curves = tuple(replace(c, held_out=np.ones(c.size, dtype=np.bool_)) if _key(c) in out else c for c in own.curves)
    return made_anew(choices, replace(own, curves=curves), {})


def _key(curve: Curve) -> float | str:
    return curve.id if curve.level is None else curve.level


def summands_of(parts: Sequence[sections.Summand]) -> list[Summand]:
    """Return the parts that are formulas."""
    return [Summand(part.formula, float(part.sign), dict(part.inputs)) for part in parts if part.formula is not None]


def formula_parts(summands: Sequence[Summand], joint: FormulaFit, dataset: Dataset) -> list[Part]:
    """Each formula of a joint fit as a model of its own inputs, with the range that they trained on."""
    training = pooled_training(dataset.curves)
    parts = []
    for number, (one, fit) in enumerate(zip(summands, split(joint, summands), strict=True), 1):
        inputs = one.own_inputs(training)
        limits = {name: (float(np.min(x)), float(np.max(x))) for name, x in inputs.items()}
        quantities = tuple(Quantity(name, _unit(one.inputs.get(name, name), dataset)) for name in sorted(inputs))
        body = Formula(fit, None, (CurveRange("all", None, limits),))
        model = Model(f"{fit.name}_{number}", dataset.quantities[dataset.target], quantities, body)
        parts.append(Part(model, one.sign, dict(one.inputs)))
    return parts


def _unit(text: str, dataset: Dataset) -> str:
    """Return the unit of an input, where it is a quantity as it stands or another sign of it; else that of a plain number."""
    source = parse(text)
    names = sorted(source.names)
    plain = len(names) == 1 and source in (Name(names[0]), parse(f"-{names[0]}"))
    return dataset.unit(names[0]) if plain else "1"
