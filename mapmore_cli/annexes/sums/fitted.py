"""Add the models of needed runs, or formulas that are fitted together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mapmore_cli.annexes.sums import Part
from mapmore_cli.annexes.sums.joint import (
    fit_jointly,
    own_inputs,
    refuse_shared_names,
    split,
    sum_of,
)
from mapmore_cli.domain.arrays import extremes
from mapmore_cli.domain.errors import FitError, SpecError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.domain.recording import CurveRange, Dataset, Quantity
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds import Given, Maker
from mapmore_cli.fitting.kinds.choices import ModelChoices
from mapmore_cli.modelling.expressions import Name, parse
from mapmore_cli.modelling.literature.backbone import pooled_training
from mapmore_cli.modelling.tendon import Tendon
from mapmore_cli.study.sections.model import Summand, TendonSettings
from mapmore_cli.study.units import convert


def behind_tendon(muscle: Model, tendon: TendonSettings | None) -> Model:
    """Return the model of a muscle in series with a tendon; without a tendon, the muscle itself.

    Raises SpecError if the muscle's model does not depend on its length, or is not in the units m
    and N.
    """
    if tendon is None:
        return muscle
    length = next((quantity for quantity in muscle.inputs if quantity.name == "length"), None)
    if length is None:
        raise SpecError(
            f"{muscle.name} does not depend on `length`, which a tendon changes",
            "name the length of the muscle `length` in the spec of its model",
        )
    stiffness = convert(tendon.stiffness, "N/m", f"{muscle.output.unit}/({length.unit})")
    body = Tendon(muscle, stiffness, convert(tendon.force, "N", muscle.output.unit))
    return replace(muscle, name=f"{muscle.name}-behind-a-tendon", body=body)


def formula_parts(summands: Sequence[Summand], joint: FormulaFit, dataset: Dataset) -> list[Part]:
    """Return each formula of a joint fit as a model of its own inputs, with their training
    ranges.
    """
    training, parts = pooled_training(dataset.curves), []
    for number, (summand, fit) in enumerate(zip(summands, split(joint, summands), strict=True), 1):
        inputs = own_inputs(summand, training)
        limits = {name: extremes(x) for name, x in inputs.items()}
        quantities = tuple(
            Quantity(name, _unit(summand.inputs.get(name, name), dataset))
            for name in sorted(inputs)
        )
        body = Formula(fit, None, (CurveRange("all", None, limits),))
        model = Model(f"{fit.name}_{number}", dataset.quantities[dataset.target], quantities, body)
        parts.append(Part(model, float(summand.sign), dict(summand.inputs)))
    return parts


def _unit(text: str, dataset: Dataset) -> str:
    """Return the unit of an input that is a quantity or a negated quantity; `1` for any other
    expression.
    """
    source = parse(text)
    names = tuple(source.names)
    is_plain = len(names) == 1 and source in (Name(names[0]), parse(f"-{names[0]}"))
    return dataset.unit(names[0]) if is_plain else "1"


class SumMaker(Maker):
    """Object that makes sums: it adds models, or fits formulas together."""

    def fit(self, part: ModelChoices, given: Given) -> FitResult:
        """Fit formulas together. If the summands are models of other runs, nothing is fitted.

        Raises FitError if the fit of the formulas has no usable result.
        """
        formulas = part.model.sum or []
        if not formulas or formulas[0].formula is None:
            return FitResult(None)
        joint = _jointly(formulas, given.dataset, None)
        if joint.failed:
            raise FitError(
                f"the fit of {joint.name} failed: {'; '.join(joint.notes)}",
                "choose other formulas in `model.sum`",
            )
        return FitResult(joint)

    def build(self, part: ModelChoices, given: Given, result: FitResult) -> Model:
        """Return the sum. Its parts are a static model and a model of damping, the models of other
        runs, or formulas that were fitted together.
        """
        dataset, model_of = given.dataset, given.model_of
        output, quantities = dataset.quantities[dataset.target], dataset.quantities
        summands = part.model.sum
        if summands is None:
            parts = [Part(model_of(path)) for path in part.summands]
        elif result.formula is not None:
            parts = formula_parts(summands, result.formula, dataset)
        else:
            parts = [
                Part(
                    behind_tendon(model_of(str(summand.model)), summand.tendon),
                    float(summand.sign),
                    dict(summand.inputs),
                )
                for summand in summands
            ]
            refuse_shared_names(
                [(each.model.name, each.model.input_names, each.inputs) for each in parts]
            )
        return sum_of(part.name, parts, output, quantities)

    def fit_sum(
        self, name: str, summands: Sequence[Summand], dataset: Dataset, method: str | None
    ) -> tuple[FormulaFit, Model]:
        """Fit formulas together to the training data; return the fit, and the sum as a model."""
        joint = _jointly(summands, dataset, method)
        parts, quantities = formula_parts(summands, joint, dataset), dataset.quantities
        return joint, sum_of(name, parts, quantities[dataset.target], quantities)


def _jointly(summands: Sequence[Summand], dataset: Dataset, method: str | None) -> FormulaFit:
    training = pooled_training(dataset.curves)
    return fit_jointly(summands, training, training[dataset.target], method)
