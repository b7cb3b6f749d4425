"""Models that are added up: those of needed runs, or formulas that are fitted together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mapmore_cli.annexes.sums import Part
from mapmore_cli.annexes.sums.joint import (
    Summand,
    fit_jointly,
    predict,
    refuse_shared_names,
    split,
    sum_of,
)
from mapmore_cli.domain.arrays import Array, extremes
from mapmore_cli.domain.errors import FitError, SpecError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import CurveRange, Formula, Model
from mapmore_cli.domain.recording import Dataset, Quantity
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds import Given
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.modelling.expressions import Name, parse
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.tendon import Tendon
from mapmore_cli.spec.sections import model as sections
from mapmore_cli.spec.units import convert


def fit(part: ModelChoices, given: Given) -> FitResult:
    """Formulas together; nothing where the summands are fitted by runs of their own.

    Raises FitError where the formulas did not converge to anything usable.
    """
    formulas = summands_of(part.model.sum or [])
    if not formulas:
        return FitResult(None)
    training = pooled_training(given.dataset.curves)
    found = fit_jointly(formulas, training, training[given.dataset.target])
    if found.failed:
        raise FitError(
            f"the fit of {found.name} failed: {'; '.join(found.notes)}", "take other formulas"
        )
    return FitResult(found)


def build(part: ModelChoices, given: Given, result: FitResult) -> Model:
    """Return the sum: static plus damping, the models of runs that the spec names, or formulas that
    were fitted together.
    """
    dataset, model_of = given.dataset, given.model_of
    output, quantities = dataset.quantities[dataset.target], dataset.quantities
    if part.model.sum is None:
        return sum_of(
            part.name, [Part(model_of(path)) for path in part.summands], output, quantities
        )
    if result.formula is not None:
        return sum_of(
            part.name,
            formula_parts(summands_of(part.model.sum), result.formula, dataset),
            output,
            quantities,
        )
    parts = [
        Part(behind_tendon(model_of(str(one.model)), one.tendon), float(one.sign), dict(one.inputs))
        for one in part.model.sum
    ]
    refuse_shared_names(
        [(one.model.name, [q.name for q in one.model.inputs], one.inputs) for one in parts]
    )
    return sum_of(part.name, parts, output, quantities)


def behind_tendon(muscle: Model, tendon: sections.TendonSettings | None) -> Model:
    """Return the model of a muscle behind a tendon, where there is one.

    Raises SpecError where the muscle is no function of its length, or not in units of m and N.
    """
    if tendon is None:
        return muscle
    length = next((one for one in muscle.inputs if one.name == "length"), None)
    if length is None:
        raise SpecError(
            f"{muscle.name} is no function of `length`, which a tendon changes",
            "call the length of the muscle so where it is fitted",
        )
    stiffness = convert(tendon.stiffness, "N/m", f"{muscle.output.unit}/({length.unit})")
    body = Tendon(muscle, stiffness, convert(tendon.force, "N", muscle.output.unit))
    return replace(muscle, name=f"{muscle.name}-behind-a-tendon", body=body)


def fit_and_predict(
    parts: Sequence[sections.Summand], dataset: Dataset, method: str | None
) -> tuple[FormulaFit, list[Array]]:
    """Fit formulas together to the training data; return the fit, and the sum along every curve."""
    summands = summands_of(parts)
    training = pooled_training(dataset.curves)
    fitted = fit_jointly(summands, training, training[dataset.target], method)
    return fitted, [predict(fitted, summands, curve.columns) for curve in dataset.curves]


def summands_of(parts: Sequence[sections.Summand]) -> list[Summand]:
    """Return the parts that are formulas."""
    return [
        Summand(part.formula, float(part.sign), dict(part.inputs))
        for part in parts
        if part.formula is not None
    ]


def formula_parts(summands: Sequence[Summand], joint: FormulaFit, dataset: Dataset) -> list[Part]:
    """Each formula of a joint fit as a model of its own inputs, with the range that they trained
    on.
    """
    training = pooled_training(dataset.curves)
    parts = []
    for number, (one, fit) in enumerate(zip(summands, split(joint, summands), strict=True), 1):
        inputs = one.own_inputs(training)
        limits = {name: extremes(x) for name, x in inputs.items()}
        quantities = tuple(
            Quantity(name, _unit(one.inputs.get(name, name), dataset)) for name in sorted(inputs)
        )
        body = Formula(fit, None, (CurveRange("all", None, limits),))
        model = Model(f"{fit.name}_{number}", dataset.quantities[dataset.target], quantities, body)
        parts.append(Part(model, one.sign, dict(one.inputs)))
    return parts


def _unit(text: str, dataset: Dataset) -> str:
    """Return the unit of an input, where it is a quantity as it stands or another sign of it; else
    that of a plain number.
    """
    source = parse(text)
    names = sorted(source.names)
    plain = len(names) == 1 and source in (Name(names[0]), parse(f"-{names[0]}"))
    return dataset.unit(names[0]) if plain else "1"
