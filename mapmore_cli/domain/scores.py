"""The numbers that a validation ends with, and the page that shows them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Annotated, Any, get_type_hints

from mapmore_cli.domain.declared import Label

OWN = "mapmore"
"""Name of the run's own model in its scores, and of the needed static model in a composite."""

REPEATABILITY = "repeatability"
"""Name of the rows that say how far repeated measurements lie apart: the floor of every model's
error, and no model itself.
"""


BASELINES: Mapping[str, str] = MappingProxyType(
    {
        "gaussian_process": "Gaussian process",
        "gradient_boosting": "Gradient boosting",
        "mlp": "Neural network",
    }
)
"""Competitors that are black boxes of scikit-learn: their names, and their titles."""

SIMPLE: Mapping[str, str] = MappingProxyType(
    {name: name.capitalize() for name in ("plane", "quadratic", "cubic", "backbone")}
    | {"arx": "ARX"}
)
"""Competitors that need no muscle, likewise; every validation has those that its model allows."""


@dataclass(frozen=True)
class Score:
    """One row of the score table.

    `nrmse = rmse / normaliser` is a fraction; `normaliser` is the number and `normaliser_name` says
    what it is, as `max|force| over validate`. `rmse`, `normaliser` and `max_abs_error` carry the
    target's unit. `rrse` is the root relative squared error, of a free run where the model has
    memory; `rrse_one_step` then that of predictions from the measured past, else NaN. `r_uncentred`
    is the correlation about zero, `sum y yhat / sqrt(sum y^2 sum yhat^2)`, which W prints.
    `interval_coverage` and `interval_half_width` are of the run's own model on held-out rows, where
    the spec asks for intervals. `chi2_dof` is `sum (error / uncertainty)^2 / (n - p)`, with the p
    free numbers of the run's own model on the rows that it is fitted to, else p = 0. `nrmse_range`
    divides by the range of the samples that the
    normaliser is of: it tells more of a target that lies far from zero.
    """

    model: Annotated[Label, "`mapmore`, or the name of a literature model"]
    target: Annotated[Label, "the modelled quantity"]
    split: Annotated[
        Label, "`train` or `validate`; `seen` of held-out data that the model was trained on"
    ]
    curve: Annotated[Label, "`all`, or the identifier of a curve"]
    n: Annotated[int, "samples"]
    rmse: Annotated[float, "root of the mean squared error", "[target]"]
    nrmse: Annotated[float, "rmse / normaliser, a fraction"]
    normaliser: Annotated[float, "what the error is divided by", "[target]"]
    normaliser_name: Annotated[Label, "what the normaliser is"]
    max_abs_error: Annotated[float, "greatest absolute error", "[target]"]
    max_abs_error_fs: Annotated[float, "greatest absolute error as a fraction of the normaliser"]
    r2: Annotated[float, "coefficient of determination"]
    rrse: Annotated[float, "root relative squared error"] = math.nan
    rrse_one_step: Annotated[
        float, "the same of predictions from the measured past; NaN without memory"
    ] = math.nan
    r_uncentred: Annotated[float, "correlation of measured and predicted about zero, W's index"] = (
        math.nan
    )
    interval_coverage: Annotated[
        float, "share of the samples within their 95 % interval; NaN without intervals"
    ] = math.nan
    interval_half_width: Annotated[
        float, "half of the width of that interval, the median over the samples", "[target]"
    ] = math.nan
    nrmse_range: Annotated[float, "rmse / range of the measured target, a fraction"] = math.nan
    rmse_weighted: Annotated[
        float, "rmse with samples weighted by their uncertainty; NaN without one", "[target]"
    ] = math.nan
    chi2_dof: Annotated[
        float, "chi-square per degree of freedom, near 1 where only noise is left; NaN without one"
    ] = math.nan

    @property
    def far(self) -> bool:
        """Whether the full scale is mostly how far the target lies from zero."""
        return self.nrmse_range > FAR_FROM_ZERO * self.nrmse


FAR_FROM_ZERO = 3.0
"""A target lies far from zero where its mean is more than so many times its range."""


NUMBERS = {
    name: hint
    for name, hint in get_type_hints(Score, include_extras=True).items()
    if hint.__origin__ in (int, float)
}
METRICS: Mapping[str, str] = MappingProxyType(
    {name: hint.__metadata__[0] for name, hint in NUMBERS.items()}
)
"""What the numbers of a score row mean."""

AT_LEAST = frozenset({"r2", "n", "interval_coverage"})
"""Metrics whose limit is a lower one; all others are errors."""


@dataclass(frozen=True)
class Limit:
    """A limit that the score row of a run's own model is held to, with the value that it has."""

    metric: str
    model: str
    split: str
    value: float
    limit: float

    @property
    def kept(self) -> bool:
        """False also where there is no number."""
        return self.value >= self.limit if self.metric in AT_LEAST else self.value <= self.limit

    @property
    def sentence(self) -> str:
        """The value beside its limit."""
        return (
            f"{self.metric} of {self.model} on the {self.split} rows is {self.value:.6g}; the "
            f"limit is {self.limit:g}"
        )


@dataclass(frozen=True)
class Published:
    """Numbers of a publication by model, all of held-out data; shown beside ours and used in no
    computation.
    """

    source: str
    nrmse: Mapping[str, float] = field(default_factory=dict)  # fractions
    rmse: Mapping[str, float] = field(default_factory=dict)  # in the target's unit
    # where only a lower bound was printed
    rmse_at_least: Mapping[str, float] = field(default_factory=dict)

    def shown_rmse(self, model: str) -> float | str | None:
        """Return the RMSE as a cell of a table: a bound is told as one, and None where nothing was
        printed.
        """
        if model in self.rmse_at_least:
            return f">= {self.rmse_at_least[model]:.3g}"
        return self.rmse.get(model)


@dataclass(frozen=True)
class ScoreTable:
    """What a validation says in numbers: the rows, the unit of every target, models without scores,
    what must be known before, and by target what residual tests found.
    """

    scores: tuple[Score, ...]
    units: Mapping[str, str]
    failed: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    alerts: Mapping[str, str] = field(default_factory=dict)

    @property
    def alert(self) -> str:
        """What residual tests found of all targets; empty where they pass."""
        return "; ".join(self.alerts.values())

    @property
    def each(self) -> tuple[ScoreTable, ...]:
        """The table of each target; itself where there is one."""
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


STRUCTURE_SEEN = "the structure was chosen with all "
"""What a warning and a verdict begin with, where a structure was chosen with held-out data."""


def deciding(scores: Iterable[Score]) -> list[Score]:
    """Return the rows that decide: all curves pooled, of the held-out data where there are any,
    else of the training data.
    """
    pooled = [score for score in scores if score.curve == "all"]
    held_out = [score for score in pooled if score.split == "validate"]
    return held_out or pooled


@dataclass(frozen=True)
class Trial:
    """One combination of settings, by their place in the spec."""

    settings: Mapping[str, Any]
    parameters: int = 0  # free numbers of its model of all training data
    errors: tuple[
        float, ...
    ] = ()  # NRMSE on each fold of a model without it; empty where a fit failed
    error: float = math.nan  # their geometric mean
    excess: float = math.nan  # mean over the folds of ln(error / that of the best combination)
    spread: float = math.nan  # standard error of that mean
    failure: str = ""  # why a fit failed


@dataclass(frozen=True)
class Tuning:
    """All combinations that were tried."""

    name: str
    left_out: str  # by each fold
    full_scale: str  # what errors are divided by
    trials: tuple[Trial, ...]
    best: Trial  # errs least
    chosen: Trial  # the simplest within one standard error of the best
