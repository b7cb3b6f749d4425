"""Fit a formula of the literature, which is the model itself or the backbone of a model."""

from __future__ import annotations

from mapmore_cli.domain.errors import FitError
from mapmore_cli.domain.fits import FormulaFit
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult
from mapmore_cli.fitting.kinds import Given, Maker
from mapmore_cli.fitting.kinds.choices import ModelChoices, level_of
from mapmore_cli.modelling.literature import model as formula
from mapmore_cli.modelling.literature.backbone import fit_formula
from mapmore_cli.modelling.shape.violations import verified


def fitted(
    name: str, part: ModelChoices, dataset: Dataset, near: FormulaFit | None = None
) -> FormulaFit:
    """Fit a formula to all training samples of a dataset, and return the fit. If `near` is not
    None, the search begins at the parameters of this fit.

    Raises FitError if no usable parameters are found.
    """
    parameters = None if near is None else near.parameters
    formula_fit = fit_formula(
        name, dataset.curves, dataset.target, None, part.lengths, near=parameters
    )
    if formula_fit.failed:
        reasons = "; ".join(formula_fit.notes) or "no finite parameters were found"
        raise FitError(
            f"the fit of {formula_fit.name} failed: {reasons}",
            "use another formula, or build the model without a formula",
        )
    return formula_fit


class FormulaMaker(Maker):
    """Maker of models that consist of a formula from the literature."""

    def fit(self, part: ModelChoices, given: Given) -> FitResult:
        """Return the formula, fitted to all training samples. Raises the same errors as
        `fitted`.
        """
        assert part.model.name is not None
        near = None if given.near is None else given.near.formula
        return FitResult(fitted(part.model.name, part, given.dataset, near))

    def build(self, part: ModelChoices, given: Given, result: FitResult) -> Model:
        """Return the fitted formula as a model."""
        assert result.formula is not None
        quantities = given.dataset.quantities
        level = level_of(part.levels, part.segment)
        model = formula.formula_model(
            part.name,
            quantities[given.dataset.target],
            result.formula,
            level,
            given.segmentation,
            quantities,
        )
        return verified(model, given.dataset.curves, part.fit)
