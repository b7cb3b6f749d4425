"""Models that are added up: those of needed runs, or formulas that are fitted together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import CurveRange, Formula, Model, Part
from mapmore_cli.domain.recording import Dataset, Quantity
from mapmore_cli.domain.results import FitResult
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.sums.build import refuse_shared_names, sum_of
from mapmore_cli.modelling.sums.joint import Summand, fit_jointly, split
from mapmore_cli.modelling.terms import Name, parse
from mapmore_cli.spec.sections import method
from mapmore_cli.stages.kinds.choices import FitChoices, ModelChoices
from mapmore_cli.stages.pipeline.stage import Workspace
from mapmore_cli.storage.run_folder import RunFiles


def fit(part: FitChoices, dataset: Dataset, workspace: Workspace) -> FitResult:
    """Formulas together; nothing where the summands are fitted by runs of their own.

    Raises
    ------
    FitError
        Where the formulas did not converge to anything usable.
    """
    del workspace
    formulas = summands_of(part.model.sum or [])
    if not formulas:
        return FitResult(None)
    training = pooled_training(dataset.curves)
    found = fit_jointly(formulas, training, training[dataset.target])
    if found.failed:
        raise FitError(f"the fit of {found.name} failed: {'; '.join(found.notes)}", "take other formulas")
    return FitResult(found)


def build(part: ModelChoices, dataset: Dataset, workspace: Workspace) -> Model:
    """The sum: static plus damping, or the parts that the spec names."""
    output, quantities = dataset.quantities[dataset.target], dataset.quantities
    if part.model.sum is None:
        models = [RunFiles(workspace.needed[path]).model() for path in part.summands]
        return sum_of(part.name, [Part(model) for model in models], output, quantities)
    formulas = summands_of(part.model.sum)
    if formulas:
        joint = workspace.files.fit().formula
        assert joint is not None
        return sum_of(part.name, formula_parts(formulas, joint, dataset), output, quantities)
    parts = [Part(RunFiles(workspace.needed[str(one.model)]).model(), float(one.sign), dict(one.inputs)) for one in part.model.sum]
    refuse_shared_names([(one.model.name, [q.name for q in one.model.inputs], one.inputs) for one in parts])
    return sum_of(part.name, parts, output, quantities)


def summands_of(parts: Sequence[method.Summand]) -> list[Summand]:
    """The parts that are formulas."""
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
        model = Model(f"{one.formula}_{number}", dataset.quantities[dataset.target], quantities, body)
        parts.append(Part(model, one.sign, dict(one.inputs)))
    return parts


def _unit(text: str, dataset: Dataset) -> str:
    """The unit of an input, where it is a quantity as it stands or another sign of it; else that of a plain number."""
    source = parse(text)
    names = sorted(source.names)
    plain = len(names) == 1 and source in (Name(names[0]), parse(f"-{names[0]}"))
    return dataset.unit(names[0]) if plain else "1"
