"""Define the results of a validation as numbers: scores, limits, published values and alerts."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, get_type_hints

import numpy as np

from mapmore_cli.domain.compared import Compared, ratio
from mapmore_cli.domain.declared import Label

OWN = "mapmore"
"""Name of the run's own model in its scores. In a sum, it is also the name of the static model in
`needs`.
"""

REPEATABILITY = "repeatability"
"""Name of the rows that show how much repeated measurements differ. These rows belong to no model:
no model can be expected to have a smaller error.
"""


@dataclass(frozen=True)
class Measure:
    """Rule for computing one number of a score row, and for showing it.

    - `of`: function that computes the number from the samples of the row.
    - `heading`: heading of the column on pages; `UNIT` is replaced by the unit of the target. If
      the heading contains `[%]`, the number is shown in per cent. If the heading is empty, pages do
      not show the number.
    - `shown`: function that returns True if a row has a value for this column.
    - `at_least`: True if larger values are better, so that a limit in `validate.require` is a lower
      limit.
    - `column`: column of the `SampleBlock` from which the number is computed; if it is unknown, the
      number is NaN.
    """

    of: Callable[[Compared], float]
    heading: str = ""
    shown: Callable[[Score], bool] | None = None
    at_least: bool = False
    column: str = ""


@dataclass(frozen=True)
class Score:
    """One row of the score table.

    `nrmse = rmse / normaliser` is a fraction; `normaliser` is the number, and `normaliser_name` its
    meaning, for example `max|force| over validate`. `rmse`, `normaliser` and `max_abs_error` carry
    the target's unit. `rrse` is the root relative squared error. For a model with memory, `rrse` is
    computed from a free run and `rrse_one_step` from one-step-ahead predictions; for other models,
    `rrse_one_step` is NaN. `r_uncentred` is the correlation without subtracting means, `sum y yhat
    / sqrt(sum y^2 sum yhat^2)`, which the paper about the wrist joint prints.
    `interval_coverage` and `interval_half_width` exist only for the run's own model on held-out
    data, if the spec asks for intervals. `chi2_dof` is `sum (error / uncertainty)^2 / (n - p)`. On
    the training rows of the run's own model, p is its number of free parameters; otherwise p is 0.
    `nrmse_range` is divided by the range of the normaliser's samples, which is more informative for
    a target far from zero.
    """

    model: Annotated[Label, "`mapmore`, or the name of a literature model"]
    target: Annotated[Label, "the modelled quantity"]
    split: Annotated[
        Label, "`train`, `validate`, or `seen` for held-out data on which the model was trained"
    ]
    curve: Annotated[Label, "`all`, or the identifier of a curve"]
    n: Annotated[int, "samples", Measure(lambda row: row.n, "samples", at_least=True)]
    rmse: Annotated[
        float,
        "root of the mean squared error",
        "[target]",
        Measure(lambda row: row.rmse, "RMSE [UNIT]"),
    ]
    nrmse: Annotated[
        float,
        "rmse / normaliser, a fraction",
        Measure(lambda row: row.scale.fraction(row.rmse), "NRMSE [%] .2f"),
    ]
    normaliser: Annotated[
        float, "what the error is divided by", "[target]", Measure(lambda row: row.scale.value)
    ]
    normaliser_name: Annotated[Label, "what the normaliser is"]
    max_abs_error: Annotated[
        float,
        "largest absolute error",
        "[target]",
        Measure(lambda row: row.worst, "max error [UNIT]"),
    ]
    max_abs_error_fs: Annotated[
        float,
        "largest absolute error as a fraction of the normaliser",
        Measure(lambda row: row.scale.fraction(row.worst), "max error [% FS] .2f"),
    ]
    r2: Annotated[
        float,
        "coefficient of determination",
        Measure(
            lambda row: 1 - ratio(row.squared_error, row.spread(lambda block: block.measured)),
            "R² .4f",
            at_least=True,
        ),
    ]
    rrse: Annotated[
        float,
        "root relative squared error",
        Measure(
            lambda row: math.sqrt(ratio(row.squared_error, row.recorded_spread)),
            "RRSE, free run .5f",
            shown=lambda score: score.runs_free,
        ),
    ] = math.nan
    rrse_one_step: Annotated[
        float,
        "root relative squared error of predictions from the measured past; NaN without memory",
        Measure(
            lambda row: math.sqrt(
                ratio(
                    row.total(lambda block: (block.one_step - block.measured) ** 2),
                    row.recorded_spread,
                )
            ),
            "RRSE, one step .5f",
            shown=lambda score: score.runs_free,
            column="one_step",
        ),
    ] = math.nan
    r_uncentred: Annotated[
        float,
        "correlation of measured and predicted values without subtracting their means",
        Measure(lambda row: row.correlation, at_least=True),
    ] = math.nan
    interval_coverage: Annotated[
        float,
        "fraction of the samples within their 95 % interval; NaN without intervals",
        Measure(
            lambda row: ratio(
                row.total(lambda block: np.abs(block.error) <= block.half),
                row.total(lambda block: np.isfinite(block.half)),
            ),
            at_least=True,
            column="half",
        ),
    ] = math.nan
    interval_half_width: Annotated[
        float,
        "half of the width of the 95 % interval, as the median over the samples",
        "[target]",
        Measure(lambda row: row.median(lambda block: block.half), column="half"),
    ] = math.nan
    nrmse_range: Annotated[
        float,
        "rmse / range of the measured target, a fraction",
        Measure(
            lambda row: ratio(row.rmse, row.scale.extent),
            "by range [%] .2f",
            shown=lambda score: score.far,
        ),
    ] = math.nan
    rmse_weighted: Annotated[
        float,
        "rmse with samples weighted by their uncertainty; NaN if it is unknown",
        "[target]",
        Measure(
            lambda row: math.sqrt(row.chi2 / row.total(lambda block: block.sigma**-2.0)),
            "weighted RMSE [UNIT]",
            shown=lambda score: math.isfinite(score.chi2_dof),
            column="sigma",
        ),
    ] = math.nan
    chi2_dof: Annotated[
        float,
        "chi-square per degree of freedom, which is near 1 if only noise is left; NaN if the "
        "uncertainty is unknown",
        Measure(
            lambda row: ratio(row.chi2, row.n - row.free),
            "chi²/dof .3g",
            shown=lambda score: math.isfinite(score.chi2_dof),
            column="sigma",
        ),
    ] = math.nan

    @classmethod
    def of(cls, model: str, target: str, split: str, curve: str, row: Compared) -> Score:
        """Compute one row of the score table from the samples that belong to it."""
        known = {"", *row.known}
        with np.errstate(over="ignore", invalid="ignore"):
            numbers: dict[str, Any] = {
                name: measure.of(row) if measure.column in known else math.nan
                for name, measure in MEASURES.items()
            }
        return cls(model, target, split, curve, normaliser_name=row.scale.name, **numbers)

    @property
    def far(self) -> bool:
        """Return True if the NRMSE is misleadingly small: the target lies far from zero, so that
        the normaliser is much larger than the range of the target.
        """
        return self.nrmse_range > FAR_FROM_ZERO * self.nrmse

    @property
    def runs_free(self) -> bool:
        """Return True if the model feeds its own output back, so that the error of its free run
        differs from its one-step-ahead error.
        """
        return math.isfinite(self.rrse_one_step) and self.rrse_one_step != self.rrse


FAR_FROM_ZERO = 3.0
"""A target lies far from zero if the ratio of its mean to its range is larger than this."""

_NUMBERS = {
    name: hint.__metadata__
    for name, hint in get_type_hints(Score, globals(), include_extras=True).items()
    if hint.__origin__ in (int, float)
}
MEASURES: Mapping[str, Measure] = {name: marks[-1] for name, marks in _NUMBERS.items()}
"""Each number of a score row, by its name: how it is computed and shown."""
assert all(isinstance(measure, Measure) for measure in MEASURES.values()), "a score has no formula"
METRICS: Mapping[str, str] = {name: marks[0] for name, marks in _NUMBERS.items()}
"""Meaning of each number of a score row, by its name."""
OF_TARGET = frozenset(name for name, marks in _NUMBERS.items() if "[target]" in marks)
"""Names of the numbers that have the unit of the target."""


@dataclass(frozen=True)
class Limit:
    """A limit in `validate.require`, with the value that the run's own model has reached."""

    metric: str
    model: str
    split: str
    value: float
    limit: float

    @property
    def kept(self) -> bool:
        """Return True if the value fulfils the limit. NaN never fulfils a limit."""
        return (
            self.value >= self.limit if MEASURES[self.metric].at_least else self.value <= self.limit
        )

    @property
    def sentence(self) -> str:
        """Sentence that states the value and its limit."""
        return (
            f"{self.metric} of {self.model} on the {self.split} rows is {self.value:.6g}; the "
            f"limit is {self.limit:g}"
        )


@dataclass(frozen=True)
class Published:
    """Errors that a publication gives for each of its models on held-out data. They are shown
    beside the scores of mapmore, and no computation uses them.
    """

    source: str
    nrmse: Mapping[str, float] = field(default_factory=dict)  # fractions
    # RMSE of each model, in the unit of the target
    rmse: Mapping[str, float] = field(default_factory=dict)
    # lower bound of the RMSE, for each model for which the publication gives no exact value
    rmse_at_least: Mapping[str, float] = field(default_factory=dict)

    def shown_rmse(self, model: str) -> float | str | None:
        """Return the published RMSE of a model for a table cell. A lower bound begins with `>=`.
        None if the publication gives no RMSE.
        """
        if model in self.rmse_at_least:
            return f">= {self.rmse_at_least[model]:.3g}"
        return self.rmse.get(model)


@dataclass(frozen=True)
class ScoreTable:
    """Numerical results of a validation: the rows of the score table, the unit of every target, the
    models whose fit failed, the warnings that a page shows before the scores, and the failed
    residual tests of each target.
    """

    scores: tuple[Score, ...]
    units: Mapping[str, str]
    failed: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    alerts: Mapping[str, str] = field(default_factory=dict)

    @property
    def alert(self) -> str:
        """Sentence with the failed residual tests of all targets; empty if all tests pass."""
        return "; ".join(self.alerts.values())

    @property
    def each(self) -> tuple[ScoreTable, ...]:
        """A score table for each target. With only one target, the only element is this table."""
        targets = dict.fromkeys(score.target for score in self.scores)
        if len(targets) < 2:
            return (self,)
        return tuple(
            replace(
                self,
                scores=tuple(score for score in self.scores if score.target == target),
                units={target: self.units[target]},
                alerts={target: self.alerts[target]} if target in self.alerts else {},
            )
            for target in targets
        )


@dataclass(frozen=True)
class Alert:
    """A sentence that warns about a number.

    - `kind`: word by which scripts recognise the warning, for example `residuals`.
    - `section`: section of the page that shows the sentence.
    - `target`: the output that the warning concerns; empty if it concerns all outputs.
    """

    kind: str
    sentence: str
    section: str
    target: str = ""


STRUCTURE_SEEN = "the structure was chosen with all "
"""First words of a warning and of a verdict if a structure was chosen with held-out data."""


def deciding(scores: Iterable[Score]) -> list[Score]:
    """Return the rows by which models are compared. They pool all curves of the held-out data, or
    of the training data if nothing is held out.
    """
    pooled = [score for score in scores if score.curve == "all"]
    held_out = [score for score in pooled if score.split == "validate"]
    return held_out or pooled
