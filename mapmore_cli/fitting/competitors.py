"""Compare a model with formulas, other runs, and sums of a static and a damping formula."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from math import comb
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import Array, extremes, row_by_row
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.fits import Fit, FormulaFit
from mapmore_cli.domain.models import Formula, Memory, Model, Pieces
from mapmore_cli.domain.recording import DAMPING, STATIC_FORCE, Curve, CurveRange, Dataset
from mapmore_cli.domain.results import Forecast
from mapmore_cli.domain.scores import OWN
from mapmore_cli.fitting.kinds import FitsSums, maker_of
from mapmore_cli.modelling import literature, simple
from mapmore_cli.modelling.forecast import forecast, forecast_each
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.modelling.learners import LEARNERS
from mapmore_cli.modelling.literature.backbone import fit_formula, pooled_training
from mapmore_cli.modelling.literature.formulas.sarosi_hysteresis_loss import HysteresisLoss
from mapmore_cli.modelling.signals.plateau import damping_component
from mapmore_cli.storage.artefacts import read_model
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.sections.results import Competitor

Forecasts = tuple[Forecast, ...]
"""Forecasts of one model for every curve of the dataset."""

Computed = Formula | Memory | Pieces
"""Body of a model that a contest computes itself: a formula, a polynomial or an ARX."""


@dataclass(frozen=True)
class Rival:
    """A competitor with its forecasts of every curve.

    `formulas` holds the fit of each of its formulas; the keys are the names of the formulas in
    tables. If the competitor is another run, `own_fit` is the fit of that run, and `run` is its
    folder. `model` is None for a competitor that is no `Model`, for example a black box.
    """

    name: str
    forecasts: Forecasts
    formulas: Mapping[str, FormulaFit] = field(default_factory=dict)
    own_fit: Fit | None = None
    run: Path | None = None
    model: Model | None = None

    @property
    def failed(self) -> bool:
        """Return True if a fit gave no usable parameters."""
        return any(fit.failed for fit in self.formulas.values())


@dataclass(frozen=True)
class Contest:
    """The data and the other runs with which a model and its competitors are compared.

    `model` is the run's own model. `needed` holds the folders of the other runs. `static_run` is
    the folder of the run in `needs.static`, which models the static force. `lengths` holds the
    `length` and the `diameter` of the muscle (m). Paths of frozen models are relative to the folder
    `spec_dir`. In a cross-validation, `dataset` is one fold, and `refit` fits the model of another
    run again to the training samples of this fold.
    """

    dataset: Dataset
    model: Model
    needed: Mapping[str, Path]
    static_run: Path | None
    lengths: Mapping[str, float | None]
    spec_dir: Path
    refit: Callable[[Path, Dataset], Model] | None = None

    def rival(self, competitor: str | Competitor) -> Rival:
        """Fit a competitor to the training data of the model, and predict every sample.

        Raises SpecError or DataError if the quantities of another run differ from those of this
        study, or if there are no data to which a formula can be fitted.
        """
        if isinstance(competitor, str):
            competitor = Competitor(model=competitor)
        label, name, dataset = competitor.label, competitor.model, self.dataset
        if competitor.run is not None or competitor.set is not None:
            folder = self.needed[competitor.run or label]
            files = RunFiles(folder)
            model = (files.model() if self.refit is None else self.refit(folder, dataset)).of(
                dataset.target
            )
            forecasts, fit = self._of_model(model), files.fit().body
            return Rival(label, forecasts, own_fit=fit, run=folder, model=model)
        if competitor.is_file:
            model = read_model(self.spec_dir / str(name)).of(dataset.target)
            return Rival(label, self._of_model(model), model=model)
        if competitor.static is not None:
            return self._composite(competitor)
        if competitor.sum is not None:
            return self._sum(competitor)
        assert name is not None
        if name in simple.SIMPLE:
            outputs, body = self._of_simple(name)
            return Rival(label, _forecasts(outputs), model=self._as_model(label, body))
        if name in LEARNERS:
            from mapmore_cli.fitting.baselines import predictions

            return Rival(label, _forecasts(predictions(name, dataset, self.model)))
        curves = dataset.curves if competitor.levels is None else _at_levels(dataset)
        fit = self._fitted(name, curves, dataset.target, competitor.method, competitor.starts)
        fitted = self._as_model(label, None if fit.failed else Formula(fit, None, ()))
        return Rival(label, _forecasts(_formula_says(fit, curves)), {label: fit}, model=fitted)

    def simple_beside(self, named: Collection[str]) -> tuple[str, ...]:
        """Return the names of the simple competitors with which the model can be compared. Names in
        `named` are left out.

        A polynomial of the inputs is possible if it has fewer coefficients than there are training
        samples. The backbone alone is a competitor if the model consists of the backbone and
        further terms. An ARX model is a competitor if the model has memory, so that its output
        depends on earlier samples.
        """
        samples = sum(int(curve.training.sum()) for curve in self.dataset.curves)
        inputs = len(self._inputs)
        beside = [
            name
            for name, degree in simple.DEGREES.items()
            if inputs and comb(inputs + degree, degree) < samples
        ]
        backbone = None if isinstance(self.model.body, Formula) else self._backbone
        if backbone is not None and backbone.name not in named:
            beside.append("backbone")
        if runs_over_time(self.model):
            beside.append("arx")
        return tuple(name for name in beside if name not in named)

    def _of_simple(self, name: str) -> tuple[Sequence[Array], Computed | None]:
        """Fit a simple competitor. Return its predictions for every curve, and the formula,
        polynomial or ARX from which a `Model` can be made. If it cannot be fitted, the predictions
        are NaN, and the second result is None.
        """
        curves = self.dataset.curves
        if name == "arx":
            if fitted := simple.arx(self.dataset, self._inputs):
                arx, outputs = fitted
                limits = extremes(self._training[self.dataset.target])
                return outputs, arx.as_memory(curves, limits)
        elif name != "backbone":
            degree, names = simple.DEGREES[name], self._inputs
            rows = self._rows if names else None
            if polynomial := simple.polynomial_fit(degree, self.dataset, names, rows):
                return polynomial.of_curves(self.dataset), polynomial.as_pieces()
        elif self._backbone is not None:
            return _formula_says(self._backbone, curves), Formula(self._backbone, None, ())
        return [np.full(curve.size, np.nan) for curve in curves], None

    def _as_model(self, name: str, body: Computed | None) -> Model | None:
        """Return a model of the scored quantity. It consists of `body` (a formula, a polynomial or
        an ARX) and the training ranges of the inputs. If `body` is None, return None.
        """
        if body is None:
            return None
        names = self._inputs
        if isinstance(body, Formula):
            names = sorted(literature.of(body.fit).inputs)
        if not isinstance(body, Pieces):
            limits = {key: extremes(self._training[key]) for key in names}
            body = replace(body, ranges=(CurveRange("all", None, limits),))
        quantities = self.dataset.quantities
        output, inputs = quantities[self.dataset.target], tuple(quantities[key] for key in names)
        notes = (simple.AT_REST,) if isinstance(body, Memory) else ()
        return Model(name, output, inputs, body, notes=notes)

    @cached_property
    def _training(self) -> dict[str, Array]:
        return pooled_training(self.dataset.curves)

    @cached_property
    def _rows(self) -> simple.Rows:
        return simple.training_rows(self.dataset, self._inputs)

    @property
    def _inputs(self) -> list[str]:
        """Names of the quantities from which the scored quantity is predicted: the inputs of the
        model. If the scored quantity is an input of the model, the model is inverted; the names are
        then the output of the model and its other inputs.
        """
        return [
            q.name for q in (self.model.output, *self.model.inputs) if q.name != self.dataset.target
        ]

    @property
    def _backbone(self) -> FormulaFit | None:
        """The backbone of the model; None if the model must be inverted to predict the scored
        quantity.
        """
        fit: FormulaFit | None = getattr(self.model.body, "backbone", None)
        return fit if self.model.output.name == self.dataset.target else None

    def _of_model(self, other: Model) -> Forecasts:
        quantities, target = self.dataset.quantities, self.dataset.target
        differing = [q.name for q in (other.output, *other.inputs) if quantities.get(q.name) != q]
        if target not in (q.name for q in (other.output, *other.inputs)) or differing:
            quantities_named = ", ".join(differing) or other.output.name
            raise SpecError(
                f"validate.against: the model of {other.name} has other quantities or units "
                f"({quantities_named}) than this study",
                "compare with a run that has the same quantities and units",
            )
        return forecast_each(other, self.dataset.curves, target)

    def _sum(self, competitor: Competitor) -> Rival:
        """Fit all formulas of a sum together to the training data. Each formula has the sign + or
        -, and its inputs may have other names than the quantities of the study.
        """
        maker = maker_of("sum")
        assert isinstance(maker, FitsSums)
        assert competitor.sum is not None
        label, dataset = competitor.label, self.dataset
        fit, model = maker.fit_sum(label, competitor.sum, dataset, competitor.method)
        forecasts = forecast_each(model, dataset.curves, dataset.target)
        return Rival(label, forecasts, {label: fit}, model=None if fit.failed else model)

    def _composite(self, competitor: Competitor) -> Rival:
        """Return the sum of a static formula and a damping formula as a competitor.

        The static formula is fitted to the training data of the static run (`needs.static`). The
        damping formula is fitted to the force of this study minus the static formula. If this study
        models the damping force, the sum is compared with the damping force. For this purpose, the
        measured static force is subtracted from the sum, and then the mean on the plateau, as for
        the measured force.
        """
        assert competitor.static is not None
        assert competitor.damping is not None
        label, curves, static = competitor.label, self.dataset.curves, self._static
        fits: dict[str, FormulaFit] = {}
        if competitor.static == OWN:
            held = [forecast(static.model(), curve).values for curve in curves]
        else:
            training_data, how = static.dataset(), (competitor.method, self.lengths)
            fits["static"] = fit_formula(
                competitor.static, training_data.curves, training_data.target, *how
            )
            held = _formula_says(fits["static"], curves)
        force = static.model().output.name
        leaving = [
            replace(c, columns={**c.columns, DAMPING: damping_component(c.columns[force] - y, c)})
            for c, y in zip(curves, held, strict=True)
        ]
        fits["damping"] = self._fitted(competitor.damping, leaving, DAMPING, competitor.method)
        damping = _formula_says(fits["damping"], curves)
        total = [y + more for y, more in zip(held, damping, strict=True)]
        if self.dataset.target == DAMPING:
            total = [
                damping_component(y - c.columns[STATIC_FORCE], c)
                for y, c in zip(total, curves, strict=True)
            ]
        named = {f"{label} ({part})": fit for part, fit in fits.items()}
        return Rival(label, _forecasts(total), named)

    def _fitted(
        self,
        name: str,
        curves: Sequence[Curve],
        target: str,
        method: str | None,
        starts: str | None = None,
    ) -> FormulaFit:
        formula = literature.get(name)
        if not isinstance(formula, HysteresisLoss):
            return fit_formula(name, curves, target, method, self.lengths, starts)
        length = self.lengths["length"]
        if length is None:
            raise SpecError(
                f"validate.against: {name} needs the length of the muscle",
                "add `length: 88 mm` (with your own number) to `muscle`",
            )
        return formula.fit_cycles(pooled_training(self._static.dataset().curves), length)

    @property
    def _static(self) -> RunFiles:
        """Files of the static run, which is named in `needs.static` of the spec."""
        if self.static_run is None:
            raise SpecError(
                "validate.against: a competitor is fitted to the data of a static run, and this "
                "spec names no such run",
                "add `needs: {static: my-static.yaml}` with the spec of your static run",
            )
        return RunFiles(self.static_run)


def _at_levels(dataset: Dataset) -> list[Curve]:
    """Return the curves. The measured values of the level quantity are replaced by the nominal
    value of the level.
    """
    name = dataset.level
    return [
        replace(curve, columns={**curve.columns, name: np.full(curve.size, curve.level)})
        if name
        else curve
        for curve in dataset.curves
    ]


def _formula_says(fit: FormulaFit, curves: Sequence[Curve]) -> list[Array]:
    if fit.failed:
        return [np.full(curve.size, np.nan) for curve in curves]
    says = partial(literature.of(fit).predict, fit.parameters)
    return [row_by_row(says, curve.columns) for curve in curves]


def _forecasts(predictions: Sequence[Array]) -> Forecasts:
    return tuple(Forecast.of(values) for values in predictions)
