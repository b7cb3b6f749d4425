"""Define the results that fits, simulations, forecasts, searches and plans return."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import comb
from typing import Annotated, Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.declared import Label, Notes, QuantityName
from mapmore_cli.domain.fits import Fit, FormulaFit, MemoryFit, SegmentFit
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.scores import Score, ScoreTable


@dataclass(frozen=True)
class PiecesFit(Fit):
    """Fit of a model of pieces: the segment functions of all training curves."""

    segments: Annotated[tuple[SegmentFit, ...], "segment functions"]


@dataclass(frozen=True)
class Outlier:
    """A training sample that lies far from the fit, and therefore has a smaller weight in the
    fit.
    """

    file: Annotated[str, "file that it comes from"]
    place: Annotated[Label, "`row 17` of the file; if the row is unknown, `sample 17` of its curve"]
    curve: Annotated[Label, "identifier of its curve"]
    off: Annotated[float, "measured minus predicted value", "[target]"]
    scales: Annotated[float, "the same, in units of the scale of the residuals"]


@dataclass(frozen=True)
class FitResult:
    """Result of a fit, including every step of the term selection.

    `body` is the fit itself; its type depends on the kind of the model (`modelling.kinds`). If
    there is a `backbone`, the body was fitted to the residual of the backbone.
    """

    body: Annotated[Fit | None, "what was fitted; absent if models are only added up"]
    backbone: Annotated[FormulaFit | None, "formula whose residual was fitted"] = None
    notes: Notes = ()

    @property
    def each(self) -> tuple[FitResult, ...]:
        """The fit of each output."""
        return (*self.body.fits.values(),) if isinstance(self.body, OutputsFit) else (self,)

    @property
    def pieces(self) -> tuple[SegmentFit, ...]:
        """The fits in which terms were selected: the fits of all segments, or the fit of a model
        with memory in the form of a single segment fit.
        """
        return self.segments if self.memory is None else (self.memory.piece,)

    @property
    def segments(self) -> tuple[SegmentFit, ...]:
        """The segment fits of a model of pieces."""
        return self.body.segments if isinstance(self.body, PiecesFit) else ()

    @property
    def memory(self) -> MemoryFit | None:
        """The fit of a model with memory; None for any other model."""
        return self.body if isinstance(self.body, MemoryFit) else None

    @property
    def formula(self) -> FormulaFit | None:
        """The fitted formula, which is the backbone or the whole model; None if there is no
        formula.
        """
        return self.body if isinstance(self.body, FormulaFit) else self.backbone


@dataclass(frozen=True)
class OutputsFit(Fit):
    """The fits of several outputs, which share segments and terms."""

    fits: Annotated[Mapping[QuantityName, FitResult], "the fit of each output", "[*]"]


@dataclass(frozen=True)
class ErrorBand:
    """Errors of models on the samples whose measured absolute value lies between `low` and `high`.
    `rmse` holds the RMSE of each model on these samples; it is NaN if the model predicts none of
    them.
    """

    low: Annotated[float, "smallest absolute value", "[target]"]
    high: Annotated[float, "largest absolute value", "[target]"]
    samples: Annotated[int, "samples in the band"]
    rmse: Annotated[Mapping[Label, float], "root mean square error of each model", "[target]"]


AUTOCORRELATION = "autocorrelation"

RARE = 0.01
"""Probability below which noise alone is not accepted as an explanation."""


@dataclass(frozen=True)
class ResidualTest:
    """Result of a test that shows whether the errors contain more than noise. The tested values are
    of one of these kinds: correlations of the errors with themselves or with an input, at some
    lags; or means of the errors in parts of the range of an input.

    The correlation of the errors with themselves at lag 0 is always one, and is not tested.
    """

    name: Annotated[Label, "`autocorrelation`, or the input"]
    x: Annotated[Array, "(m) lags in samples, or places along the input", "-"]
    values: Annotated[Array, "(m) correlations, or mean residuals", "-"]
    bounds: Annotated[
        Array, "(m) for noise, 95 % of the values lie within this distance of zero", "-"
    ]

    @property
    def tested(self) -> int:
        """Number of tested values. The autocorrelation at lag 0 is not counted, because it is
        always one.
        """
        return len(self.x) - (self.name == AUTOCORRELATION)

    @property
    def beyond(self) -> int:
        """Number of values that lie outside their bounds."""
        outside = np.abs(self.values) > self.bounds
        return int(outside[len(self.x) - self.tested :].sum())

    @property
    def fails(self) -> bool:
        """Return True if more values lie outside their bounds than noise can explain. If the errors
        are noise, each value lies outside with a probability of 5 %. From this follows the
        probability that at least as many values lie outside as were observed. The test fails if
        this probability is below `RARE`.
        """
        n, chance = self.tested, 0.05
        counts = range(self.beyond, n + 1)
        return sum(comb(n, k) * chance**k * (1 - chance) ** (n - k) for k in counts) < RARE

    @property
    def words(self) -> str:
        """Text with the number of tested values that lie outside their bounds."""
        count = f"{self.beyond} of {self.tested}"
        if self.name == AUTOCORRELATION:
            return f"{count} lags"
        return f"{count} checks of {self.name}"


@dataclass(frozen=True)
class Validation:
    """Predictions of the run's own model (`mapmore`) and of its competitors, and their scores.

    `predictions[model][c]`, (n_c,), has one prediction for each sample of curve number c of the
    dataset. If the dataset is long, it has predictions for the samples of `shown` instead, a
    dataset with fewer samples. `formulas` and `fits` hold the fits of competitors, and `models`
    holds their models. Scores, `bands` and `residual_tests` are always computed from all samples.
    """

    predictions: Annotated[
        Mapping[Label, tuple[Array, ...]],
        "by model, then by curve, row for row",
        "[target]",
    ]
    formulas: Annotated[Mapping[Label, FormulaFit], "literature models that were fitted"]
    scores: Annotated[tuple[Score, ...], "score table"]
    units: Annotated[Mapping[Label, Label], "unit of every target"]
    fits: Annotated[Mapping[Label, Fit], "fits of competitors whose kind has a page of its own"] = (
        field(default_factory=dict)
    )
    warnings: Annotated[
        tuple[str, ...], "what a reader must know before the scores of the run's own model"
    ] = ()
    along: Annotated[QuantityName, "the quantity that varies within a curve"] = ""
    bands: Annotated[tuple[ErrorBand, ...], "errors by the size of what was measured"] = ()
    residual_tests: Annotated[tuple[ResidualTest, ...], "tests of the own model's residuals"] = ()
    outliers: Annotated[
        tuple[Outlier, ...], "training samples far from a robust fit, the farthest first"
    ] = ()
    shown: Annotated[
        Dataset | None, "samples that figures show; absent if they show the whole dataset"
    ] = None
    others: Annotated[tuple[Validation, ...], "validations of further outputs"] = ()
    models: Annotated[
        Mapping[Label, Model], "competitors that are formulas, pieces or recursions, as models"
    ] = field(default_factory=dict)

    @property
    def each(self) -> tuple[Validation, ...]:
        """The validation of each output."""
        return (replace(self, others=()), *self.others)

    @property
    def alert(self) -> str:
        """Sentence that names the failed residual tests of the run's own model; empty if all tests
        pass.
        """
        failing = [test.words for test in self.residual_tests if test.fails]
        if not failing:
            return ""
        return f"the errors are not noise alone ({', '.join(failing)} are outside)"

    @property
    def table(self) -> ScoreTable:
        """Score table of all outputs, with the findings of the residual tests."""
        failed = [
            name
            for output in self.each
            for name, formula in output.formulas.items()
            if formula.failed
        ]
        return ScoreTable(
            tuple(score for output in self.each for score in output.scores),
            {name: unit for output in self.each for name, unit in output.units.items()},
            tuple(dict.fromkeys(failed)),
            tuple(dict.fromkeys(warning for output in self.each for warning in output.warnings)),
            {name: output.alert for output in self.each for name in output.units if output.alert},
        )


@dataclass(frozen=True)
class SimulatedRun:
    """Predictions of one recording, (n,).

    A prediction is NaN if there are not enough earlier samples. If a free run diverges, all
    predictions from there to the next gap, or to the end of the recording, are NaN.
    """

    values: Array
    diverged: tuple[int, ...] = ()  # rows at which free runs diverged


@dataclass(frozen=True)
class Forecast:
    """Predictions of the samples of a curve, (n,) each."""

    # Predictions. A model with memory predicts in a free run.
    # A prediction is NaN if there are too few earlier samples, or after the free run diverged.
    values: Array
    # True for samples with enough earlier samples for a prediction.
    # If a sample has the prediction NaN although `ready` is True, the free run has diverged.
    ready: BoolArray
    one_step: Array | None = (
        None  # one-step-ahead prediction of every sample; None for a model without memory
    )
    half: Array | None = (
        # half the width of the prediction interval; NaN for a sample without an interval
        # None for a model without prediction intervals
        None
    )

    @classmethod
    def of(cls, values: Array) -> Forecast:
        """Return the forecast of a model without memory. A value is NaN if there is no
        prediction.
        """
        return cls(values, np.broadcast_to(np.True_, len(values)))

    @property
    def diverged(self) -> tuple[int, ...]:
        """Row numbers at which a free run diverged."""
        if self.one_step is None:
            return ()
        lost = self.ready & np.isnan(self.values)
        return tuple(np.flatnonzero(lost & ~np.concatenate([[False], lost[:-1]])).tolist())


@dataclass(frozen=True)
class Tried:
    """A model structure that a search has tried, with its errors."""

    family: str  # kind of the structure
    words: str  # name of the structure
    sections: Mapping[str, Any]  # sections of the spec that define the structure, by name
    # number of free parameters of the model that is fitted to all training data
    parameters: int = 0
    errors: tuple[
        float, ...
        # RMSE on each left-out fold, divided by `Search.scale`; empty if a fit failed
    ] = ()
    # root mean square of `errors` on folds that leave out stretches of curves; NaN without them
    error: float = math.nan
    # root mean square of `errors` on folds that leave out larger parts, for example levels or ends
    # of recordings; NaN without them
    parts: float = math.nan
    # mean over all folds of log(error / error of the best structure)
    excess: float = math.nan
    spread: float = math.nan  # standard error of `excess`
    seconds: float = 0.0  # computing time
    failure: str = ""  # reason why a fit failed


@dataclass(frozen=True)
class Search:
    """Result of a search: all structures in the order in which they were tried, and the chosen
    structure.
    """

    name: str
    target: str
    left_out: str  # data that each fold leaves out to compute `Tried.error`
    parts: str  # data that each fold leaves out to compute `Tried.parts`
    scale: float  # number by which errors are divided, in the unit of the target
    tried: tuple[Tried, ...]
    best: int  # index of the structure with the smallest error
    chosen: int  # index of the chosen structure
    rule: str = ""  # rule by which the structure was chosen
    cut: int = 0  # number of structures that were not tried because of the time limit
    # `chosen` before structures with more terms were tried; None if none of them were tried
    short: int | None = None
    notes: tuple[str, ...] = ()  # notes for the user
    outdone: str = ""  # message if a black box has a clearly smaller error; otherwise ""

    @property
    def found(self) -> Tried:
        """The structure that was chosen."""
        return self.tried[self.chosen]
