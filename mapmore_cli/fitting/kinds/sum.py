"""Models that are added up: those of needed runs, or formulas that are fitted together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import CurveRange, Formula, Model, Part
from mapmore_cli.domain.recording import Dataset, Quantity
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


def refit_parts(part: ModelChoices, dataset: Dataset, model_of: Callable[[str], Model]) -> Model:
    """Return the same for another dataset: formulas are fitted anew, and `model_of` gives the models of runs, by the path of their spec."""
    formulas = summands_of(part.model.sum or [])
    joint = _fitted(formulas, dataset) if formulas else None
    return _built(part, dataset, joint, model_of)


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
