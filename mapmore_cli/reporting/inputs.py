"""Bundle the results of the earlier stages from which a report is made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.domain.fits import Fit, SegmentedCurve
from mapmore_cli.domain.models import Equation, LeftOut, Model
from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.domain.results import FitResult, Search, Validation
from mapmore_cli.domain.scores import REPEATABILITY, Alert, Published, deciding
from mapmore_cli.modelling.forecast import outside
from mapmore_cli.modelling.kinds import rules, runs_over_time
from mapmore_cli.modelling.shape.violations import Violation
from mapmore_cli.modelling.simple import SIMPLE
from mapmore_cli.modelling.validation.intervals import INTERVAL, ends, half_widths_of
from mapmore_cli.modelling.validation.shown import in_time, is_turned
from mapmore_cli.reporting.alerts import alerts_of

MOST_LINES = 7
"""Largest number of lines that can be distinguished in one panel."""

FAR_OFF = 10.0
"""A model is ignored in the scale of a figure if its error is more than this many times as large as
the error of the run's own model.
"""


SINGLE = 3.5
"""Width of one column of a journal page, inches."""


@dataclass(frozen=True)
class FigureStyle:
    """Appearance of figures.

    - `width`: width of a single panel, inches.
    - `font`, `size`: name of the font (None means the machine's sans-serif font), and size of the
      axis labels in points.
    - `labels`: axis labels by quantity, including the unit; formulas may stand between dollar
      signs.
    - `palette`: colours of the models; the first is the colour of the run's own model.
    """

    width: float = SINGLE
    font: str | None = None
    size: float = 8.0
    labels: Mapping[str, str] = field(default_factory=dict)
    palette: tuple[str, ...] = ()

    def axis_label(self, quantity: Quantity, prefix: str = "") -> str:
        """Return the label of an axis, such as `Pressure (kPa)`, or `Strain (–)` for a quantity
        without unit. If the user gave a label for the quantity, return this label. A `prefix` is
        put in front.
        """
        if quantity.name in self.labels:
            return f"{prefix} {self.labels[quantity.name]}".strip()
        words = f"{prefix} {quantity.name}".strip().replace("_", " ")
        return (
            f"{words[:1].upper()}{words[1:]} "
            f"({'–' if quantity.unit in ('', '1') else quantity.unit})"
        )

    def is_own_label(self, label: str) -> bool:
        """Return True if the user gave this label in the spec. Only such a label may contain
        formulas between dollar signs.
        """
        return any(label.endswith(label_of_user) for label_of_user in self.labels.values())


@dataclass(frozen=True)
class ReportInputs:
    """Contents of the report of one output. A report shows only these numbers and summaries of
    them.

    - `muscle`: labels of the muscle as the spec gives them (`name`, `kind`, `length`, ...), ready
      to print.
    - `whole`: the dataset with all samples; tables show only how many samples it has.
    - `spec_text`: the resolved spec.
    - `provenance`: versions, hashes and the like, in the order in which to print them.
    - `command`: command that repeats the run; empty if its spec is unknown.
    - `other_equations`: the equations in other units; the keys describe these units.
    - `style`: appearance of the figures.
    - `unconfirmed`: guesses in the spec that nobody has confirmed.
    - `doubts`: findings of the rules of `check`.
    - `asked`: ids of the curves and recordings that figures show; if it is empty, some are chosen.
    - `search`: the structures that were tried, if mapmore searched for a structure.
    - `as_recorded`: True if recordings are drawn over time for every model.
    - `violations`: violations of the known shape of the output, which the spec requires or which
      the kind of muscle implies.
    - `explore`: True if the page computes the model in the browser.
    - `prefix`: text with which names of files and sections begin if the run has several outputs.
    """

    name: str
    muscle: Mapping[str, str]
    whole: Dataset
    segmentation: tuple[SegmentedCurve, ...]
    fit: FitResult
    model: Model
    validation: Validation
    equations: tuple[Equation, ...]
    published: Published | None
    spec_text: str
    provenance: Mapping[str, str]
    command: str = ""
    notes: tuple[str, ...] = ()
    other_equations: Mapping[str, tuple[Equation, ...]] = field(default_factory=dict)
    style: FigureStyle = field(default_factory=FigureStyle)
    unconfirmed: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    asked: frozenset[str] = frozenset()
    search: Search | None = None
    as_recorded: bool = False
    violations: Sequence[Violation] = ()
    explore: bool = True
    prefix: str = ""

    @property
    def alerts(self) -> tuple[Alert, ...]:
        """Alerts about the verdict of this output, the worst first."""
        return alerts_of(
            *(self.whole, self.model, self.validation),
            *(self.unconfirmed, self.doubts, self.search),
        )

    @property
    def dataset(self) -> Dataset:
        """The samples that the report shows. If curves have very many samples, the stage `validate`
        has chosen some of them.
        """
        return self.validation.shown or self.whole

    @property
    def target(self) -> Quantity:
        """Quantity that is predicted and scored, with the unit of every prediction and error."""
        return self.dataset.quantities[self.dataset.target]

    def axis_label(self, quantity: Quantity, prefix: str = "") -> str:
        """Return the label of an axis for a quantity, in the style of the report."""
        return self.style.axis_label(quantity, prefix)

    @property
    def models(self) -> tuple[str, ...]:
        """Names of the compared models; the run's own model comes first."""
        return tuple(self.validation.predictions)

    @property
    def own(self) -> str:
        """Name of the run's own model."""
        return self.models[0]

    def pooled(self, name: str) -> Array:
        """Return the values of a quantity in all shown curves, one curve after the other, (n,)."""
        return np.concatenate([curve.columns[name] for curve in self.dataset.curves])

    @property
    def pooled_held_out(self) -> BoolArray:
        """Mask of the held-out samples in all shown curves, one curve after the other, (n,)."""
        return np.concatenate([curve.held_out for curve in self.dataset.curves])

    def errors_of(self, model: str) -> Array:
        """Return the errors of a model (predicted minus measured) in all shown curves, one curve
        after the other, (n,).
        """
        return np.concatenate(self.validation.predictions[model]) - self.pooled(self.dataset.target)

    def beside(self, names: Sequence[str]) -> ReportInputs:
        """Return a copy in which only the competitors in `names` are compared with the run's own
        model, in this order. Raises UsageError for a model that the run does not have.
        """
        if unknown := [name for name in names if name not in self.models]:
            raise UsageError(
                f"the run compares no model called {unknown[0]!r}",
                f"choose one of {', '.join(self.models[1:])}",
            )
        predictions = {name: self.validation.predictions[name] for name in (self.own, *names)}
        kept = {*predictions, REPEATABILITY}
        scores = tuple(row for row in self.validation.scores if row.model in kept)
        validation = replace(self.validation, predictions=predictions, scores=scores)
        return replace(self, validation=validation)

    @property
    def lines(self) -> tuple[str, ...]:
        """Names of the models that figures draw as lines."""
        return self.best(MOST_LINES)

    def best(self, most: int) -> tuple[str, ...]:
        """Return the names of the models that figures show. If there are more than `most`, return
        the run's own model and the best of the other models.
        """
        errors = self.pooled_errors
        others = sorted(self.shown[1:], key=lambda model: errors.get(model, math.inf))
        kept = {self.own, *others[: most - 1]}
        return tuple(model for model in self.shown if model in kept)

    @property
    def shown(self) -> tuple[str, ...]:
        """Names of the models that figures show: all models, but only the best one of the simple
        competitors.
        """
        errors = self.pooled_errors
        best = min(
            (model for model in self.models if model in SIMPLE),
            key=lambda model: errors.get(model, math.inf),
            default=None,
        )
        return tuple(model for model in self.models if model not in SIMPLE or model == best)

    @property
    def far_off(self) -> tuple[str, ...]:
        """Names of the models whose error is more than `FAR_OFF` times as large as the error of the
        run's own model. On an axis that shows such large errors, the errors of the own model could
        not be seen.
        """
        errors = self.pooled_errors
        limit = FAR_OFF * errors.get(self.own, math.inf)
        return tuple(model for model in self.models if errors.get(model, 0.0) > limit > 0)

    @property
    def pooled_errors(self) -> dict[str, float]:
        """RMSE of every model over all curves, on held-out data if there are any. Models without a
        finite RMSE are left out.
        """
        return {
            score.model: score.rmse
            for score in deciding(self.validation.scores)
            if math.isfinite(score.rmse)
        }

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the competitors without predictions and scores, because their fit failed."""
        scored = {row.model for row in self.validation.scores}
        return tuple(name for name in self.models if name not in scored)

    @property
    def has_pieces(self) -> bool:
        """Return True if the model has segments."""
        return self.model.pieces is not None and bool(self.model.pieces.segments)

    @property
    def over_time(self) -> bool:
        """Return True if the curves are recordings of motion (step responses); these are drawn over
        time.
        """
        return any(curve.at_rest is not None for curve in self.dataset.curves)

    @property
    def has_memory(self) -> bool:
        """Return True if the model has memory, or is a sum with such a model. It then needs whole
        recordings as input, and not single samples.
        """
        return runs_over_time(self.model)

    @property
    def timed(self) -> bool:
        """Return True if curves are drawn over time."""
        return self.as_recorded or in_time(self.model, self.dataset)

    @property
    def holds_out(self) -> bool:
        """Return True if some samples are held out."""
        return bool(self.pooled_held_out.any())

    @property
    def left_out(self) -> LeftOut | None:
        """Data from which intervals are computed. None if there are no such data, or if the report
        shows another quantity than the output of the model.
        """
        return self.model.left_out if self.target == self.model.output else None

    def interval(self, number: int) -> tuple[Array, Array] | None:
        """Return the ends of the prediction intervals of the run's own model along the curve with
        this number, (n,) each. Return None if the model has no intervals.
        """
        if self.left_out is None:
            return None
        curve = self.dataset.curves[number]
        half = half_widths_of(self.model, curve.columns, INTERVAL)
        return ends(self.validation.predictions[self.own][number], outside(self.model, curve), half)

    @property
    def fits(self) -> dict[str, Fit | None]:
        """Fit of the run's own model, and fits of the competitors that pages show, by name."""
        return {self.own: self.fit.body, **self.validation.fits}

    @property
    def turned(self) -> bool:
        """Return True if the scored quantity is an input of the model, so that the model is
        inverted before it is scored.
        """
        return is_turned(self.model, self.dataset)

    @property
    def fitted(self) -> str:
        """Name of the quantity to which the segments are fitted."""
        return self.model.output.name if self.turned else self.dataset.target

    @property
    def in_curve(self) -> Quantity:
        """Quantity over which the target is drawn: the quantity that varies within a curve. If the
        model is inverted, this is the output of the model.
        """
        return self.model.output if self.turned else self.along

    @property
    def along(self) -> Quantity:
        """Input of the model that varies within a curve. For a model without inputs, it is any
        measured quantity.
        """
        return self.dataset.quantities[self.validation.along]

    @property
    def rules(self) -> tuple[str, ...]:
        """Sentences that say how the equations of the model are combined."""
        return rules(self.model)

    @property
    def all_notes(self) -> tuple[str, ...]:
        """Notes of the run and of every stage, without repetitions."""
        return tuple(
            dict.fromkeys((*self.notes, *self.dataset.notes, *self.model.notes, *self.fit.notes))
        )

    def ids_of(self, words: str) -> frozenset[str]:
        """Return the ids of the curves and recordings that a user means by `words`: an id, a level
        (`250` or `250 kPa`), or the name of a log that was cut into several recordings.
        """
        curves = [
            curve.id
            for curve in self.dataset.curves
            if words in (curve.id, curve.id.partition("=")[2], self.curve_label(curve))
        ]
        logs = [
            recording.id
            for recording in self.dataset.recordings
            if words in (recording.id, recording.log)
        ]
        return frozenset((*curves, *logs))

    def curve_label(self, curve: Curve) -> str:
        """Return a short name of a curve: its level with the unit (`150 kPa`, `strain 0.04`), or
        its id if it has no level.
        """
        level = self.dataset.level
        if curve.level is None or level is None:
            return curve.id
        unit = self.dataset.unit(level)
        return f"{level} {curve.level:.4g}" if unit == "1" else f"{curve.level:.4g} {unit}"
