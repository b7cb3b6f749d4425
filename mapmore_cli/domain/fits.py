"""Define the results of fitting: scalings, FROLS selections, segment fits, fits of formulas, and
fits of models with memory.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import (
    ASCENDING,
    Array,
    BoolArray,
    IntArray,
    Number,
    Numbers,
    Rows,
    Span,
)
from mapmore_cli.domain.declared import (
    Count,
    Label,
    Notes,
    QuantityName,
    TermName,
    ValueCondition,
    one_of,
)
from mapmore_cli.domain.recording import CurveRange

Boundaries = Annotated[Numbers, ASCENDING]
Step = Annotated[Number, ValueCondition("is not above 0", lambda step: step > 0)]


LOWER_BOUND = (
    "Standard errors are lower bounds: they assume independent samples, but neighbouring samples "
    "of a recording have similar errors. The true intervals are wider."
)
BY_CURVE = "Standard errors allow for correlated residuals within a curve."
BY_RECORDING = (
    "Standard errors allow for correlated residuals along a recording. They are a guess if there "
    "are few curves, or no more curves than terms."
)
ErrorsNote = Annotated[str, "assumption about residuals on which the standard errors are based"]
"""Assumption about residuals on which the standard errors are based. Standard errors are lower
bounds if nothing better is known.
"""


class Fit:
    """Base class of the results of fits. Each kind of model has a subclass (`modelling.kinds`)."""


@dataclass(frozen=True)
class Scaling:
    """Linear scaling of the inputs, `z_j = slope_j x_j + intercept_j`, and of the output, `y =
    y_slope y_scaled + y_intercept` (M2 eq 8).

    `placement` says at which end of the range of each variable the scaled value is 0, for example
    `left,right`. It is `-` for scaling rules without this choice.
    """

    rule: Annotated[Label, "`unit_square`, `max_abs`, `none` or `range`"]
    placement: Annotated[Label, "end at which the origin lies, for example `left`"]
    variables: Annotated[
        tuple[QuantityName, ...], "(v) inputs, in the order of slope and intercept"
    ]
    slope: Annotated[Numbers, "(v) slope of each input", "[slopes]"]
    intercept: Annotated[Numbers, "(v) intercept of each input"]
    y_slope: Annotated[Number, "slope of the output", "[target]"]
    y_intercept: Annotated[Number, "intercept of the output", "[target]"]


@dataclass(frozen=True)
class ChosenTerms:
    """Numbers that FROLS computes for the k chosen terms (M2 eq 2-7), in scaled coordinates."""

    theta: Annotated[Array, "(k) coefficients of the terms, A theta = g"]
    theta_error: Annotated[Array, "(k) standard errors of theta; NaN without a degree of freedom"]
    g: Annotated[Array, "(k) coefficients of the orthogonalised terms"]
    err: Annotated[Array, "(k) error reduction ratios"]
    samples: Annotated[Count, "number of samples of the fit"]
    condition: Annotated[float, "2-norm condition number of the chosen regressors"]
    stop: Annotated[Label, "why selection stopped"]


@dataclass(frozen=True, repr=False)
class Selection(ChosenTerms):
    """All results of FROLS for one segment (M2 eq 2-7): k terms chosen from M candidates, in scaled
    coordinates.

    `candidates` holds the names of the dictionary's M columns if they were given; they are not
    stored. `stop` is the reason why the selection ended: `tolerance`, `max_terms`, `no_gain`,
    `rank`, `bic`, `free_run`, or `pruned` (more terms were selected, and then removed down to
    `max_terms`).
    """

    chosen: Annotated[IntArray, "(k) candidates in the order of selection, from 0", "-"]
    a: Annotated[Array, "(k, k) unit upper triangular A, P_chosen = Q A"]
    g_all: Annotated[
        Array,
        "(k, M) g of every candidate at every iteration; NaN if already chosen or excluded",
    ]
    err_all: Annotated[
        Array,
        "(k, M) err of every candidate at every iteration; NaN if already chosen or excluded",
    ]
    runner_up: Annotated[
        IntArray,
        "(k) second best candidate of each iteration, from 0; -1 if there was none",
        "-",
    ]
    tied: Annotated[IntArray, "(k) other candidates within 1e-9 of the winner's err"]
    sse: Annotated[float, "residual sum of squares, uncentred"]
    yy: Annotated[float, "total sum of squares, uncentred"]
    curves: Annotated[
        Count,
        "number of curves whose residuals were summed for theta_error; 0 if residuals were not "
        "summed by curve",
    ] = 0
    scale: Annotated[
        float, "scale of the residuals by which a robust loss weighs them; NaN for squares"
    ] = float("nan")
    worth: Annotated[
        float,
        "number of independent samples to which the samples are equivalent for theta_error, "
        "because their residuals are correlated; NaN if this number was not estimated",
    ] = float("nan")
    candidates: tuple[str, ...] = field(default=(), compare=False, metadata={"stored": False})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the chosen terms in the order of selection. If the columns have no names, column
        3 is called `p3`.
        """
        return tuple(
            self.candidates[i] if self.candidates else f"p{i}" for i in self.chosen.tolist()
        )

    def predict(self, P: ArrayLike) -> Array:
        """Return the predicted output, (n,), for every row of `P`, (n, M). The columns of `P` are
        the M candidate terms, in the order in which they were given to FROLS.
        """
        return np.asarray(P, dtype=np.float64)[:, self.chosen] @ self.theta

    @property
    def errors_note(self) -> str:
        """Sentence that states the assumption about residuals on which the standard errors are
        based.
        """
        if self.curves:
            return BY_CURVE
        return LOWER_BOUND if math.isnan(self.worth) else BY_RECORDING

    @property
    def freedom(self) -> int:
        """Degrees of freedom of the standard errors. If the residuals of each curve were summed,
        this is the number of curves minus 1. Otherwise, it is the number of samples minus the
        number of terms. If correlated residuals are equivalent to a smaller number of independent
        samples, this smaller number is used in place of the number of samples.
        """
        left = self.samples - len(self.theta)
        if self.curves:
            return self.curves - 1
        return (
            left if math.isnan(self.worth) else min(left, max(int(self.worth) - len(self.theta), 1))
        )

    def table(self) -> list[dict[str, Any]]:
        """Return a row for each term in the order of selection, with the keys `term`,
        `coefficient`, `standard_error`, `t` and `err`; t is the coefficient divided by its
        standard error. `errors_note` states the assumption about residuals.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            t = self.theta / self.theta_error
        columns = (self.names, *map(np.ndarray.tolist, (self.theta, self.theta_error, t, self.err)))
        keys = ("term", "coefficient", "standard_error", "t", "err")
        return [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]

    def __repr__(self) -> str:
        """Return the sum of the terms as text, the share of `y'y` that each term explains, and the
        reason why the selection stopped.
        """
        terms = (
            f"{row['coefficient']:.6g}" + ("" if row["term"] == "1" else f"*{row['term']}")
            for row in self.table()
        )
        model = " + ".join(terms).replace("+ -", "- ") or "0"
        shares = ", ".join(f"{100 * row['err']:.4g} %" for row in self.table()) or "none"
        return f"Selection({model}; ERR {shares}; stop: {self.stop})"


@dataclass(frozen=True)
class GridCell:
    """A segment of a training curve, and its place in the grid of segments into which the curve is
    cut.
    """

    id: Annotated[Label, "identifier of the segment, for example `pressure=150/strain:2`"]
    curve: Annotated[Label, "identifier of its curve"]
    cell: Annotated[tuple[int, ...], "place along each segmented variable, from 1", "-"]


@dataclass(frozen=True)
class Segment(GridCell):
    """A segment of a training curve with its rows. One segment function is fitted to these rows."""

    rows: Annotated[
        Rows,
        "row numbers within the curve's training samples, from 0; for consecutive rows, the first "
        "row and the last row plus 1",
        "-",
    ]


@dataclass(frozen=True)
class CutCurve(CurveRange):
    """Training range of a curve, and the boundaries at which the curve is cut into segments."""

    boundaries: Annotated[
        tuple[Boundaries, ...],
        "(p) boundaries of the segments along each segmented variable, both ends included",
        "[variables.*]",
    ]


@dataclass(frozen=True)
class SegmentedCurve(CutCurve):
    """A training curve that is cut into segments. The samples themselves are not stored here, but
    in the dataset file.
    """

    variables: Annotated[tuple[QuantityName, ...], "(p) segmented variables"]
    segments: Annotated[tuple[Segment, ...], "segments of the curve"]


@dataclass(frozen=True)
class SegmentFit(GridCell):
    """A segment function: the chosen terms with their scaling, and the results of their
    selection.
    """

    candidates: Annotated[tuple[TermName, ...], "(M) names of all M dictionary terms"]
    scaling: Annotated[Scaling, "scaling of the segment"]
    selection: Annotated[Selection, "how the terms were found"]

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the chosen terms in the order of selection."""
        return tuple(self.candidates[i] for i in self.selection.chosen)


@dataclass(frozen=True)
class Optimum:
    """Another local minimum of a formula's error, at which the formula fits the training data
    nearly as well as at the best fit.
    """

    parameters: Annotated[Mapping[QuantityName, float], "its parameters", "those of the formula"]
    sse: Annotated[float, "its residual sum of squares", "[target]^2"]


@dataclass(frozen=True)
class FormulaFit(Fit):
    """A literature model fitted to training data.

    `method` is `linear least squares`, `variable projection` or `levenberg_marquardt`. `rivals` are
    other minima, which the training data hardly distinguish from the best fit; the rival with the
    smallest error comes first. `definition` is the formula itself, if a spec defines it.
    """

    name: Annotated[Label, "name of the formula"]
    parameters: Annotated[
        Mapping[QuantityName, float],
        "fitted parameters; NaN if the fit failed",
        "those of the formula",
    ]
    errors: Annotated[
        Mapping[QuantityName, float],
        "standard errors of the parameters; NaN if unknown",
        "those of the formula",
    ]
    status: Annotated[
        str,
        "`converged`, `at_bound`, `rank_deficient`, `stopped_by_limit` or `failed`",
        one_of("converged", "at_bound", "rank_deficient", "stopped_by_limit", "failed"),
    ]
    method: Annotated[Label, "how it was fitted"]
    rank: Annotated[int, "rank of the linear problem"]
    condition: Annotated[float, "condition number of the linear problem"]
    sse: Annotated[float, "residual sum of squares", "[target]^2"]
    samples: Annotated[Count, "number of samples of the fit"]
    notes: Notes = ()
    rivals: Annotated[tuple[Optimum, ...], "other minima with nearly the same error"] = ()
    definition: Annotated[str, "text of a family or of a formula of the user's own"] = ""
    errors_note: ErrorsNote = LOWER_BOUND

    @property
    def formula(self) -> str:
        """Key by which the formula is looked up: its definition if a spec defines it, otherwise its
        name in the literature package.
        """
        return self.definition or self.name

    @property
    def failed(self) -> bool:
        """Return True if the fit gave no usable parameters."""
        return self.status == "failed"


# Models with memory
# --------------------------------------------------------------------------------------------------

PIECE = "memory"
"""Name of a model with memory in tables and equations, at the place at which other models have the
names of segments.
"""


@dataclass(frozen=True)
class StateSet:
    """States with memory, and everything that is needed to compute them for a new recording.

    The widths of `play`, `stop` and `saturate` are fractions of `ranges`. Scaled states are limited
    to the interval from -`margin` to 1 + `margin`.
    """

    names: Annotated[
        tuple[TermName, ...], "(s) names, such as `force[k-1]` or `slow(play(pressure, 0.16), 0.3)`"
    ]
    step: Annotated[Step, "time between samples; the median if `ordered`", "s"]
    ranges: Annotated[
        Mapping[TermName, Span],
        "training range of each source of `play`, `stop` and `saturate`, by its name",
        "that of the source",
    ]
    resonances: Annotated[
        Mapping[TermName, tuple[Number, Number]],
        "frequency (Hz) and damping ratio that training found, by the name of their source",
        "Hz, 1",
    ]
    low: Annotated[
        Numbers,
        "(s or 0) smallest training value of each state, which is scaled to 0; empty if states "
        "are not scaled",
        "that of the state",
    ]
    high: Annotated[
        Numbers,
        "(s or 0) largest training value of each state, which is scaled to 1; empty if states "
        "are not scaled",
        "that of the state",
    ]
    margin: Annotated[
        Number,
        "distance outside the training range at which a scaled state is limited, as a fraction of "
        "the range",
    ]
    ordered: Annotated[
        bool, "whether time steps may be uneven, because only the order of samples counts"
    ] = False

    @property
    def longest_step(self) -> float:
        """Longest time between two samples, in s, over which the memory continues. A longer time is
        treated as a gap.
        """
        return math.inf if self.ordered else self.step

    @property
    def scaled(self) -> bool:
        """Return True if states are scaled to their training range."""
        return len(self.low) > 0


@dataclass(frozen=True)
class MemoryModel:
    """Model with memory. The output of the model at sample k is `constant + sum_j theta_j
    D_j(states[k])`, with terms D_j and coefficients theta_j.

    A free run begins with measured outputs and continues with predicted outputs. It has diverged if
    a predicted output lies outside `limits`, and its distance from them is more than a hundred
    times the width of the interval `limits`.
    """

    output: Annotated[QuantityName, "the quantity whose delays are fed back"]
    states: Annotated[StateSet, "states with memory"]
    terms: Annotated[tuple[TermName, ...], "(k) the terms D_j, in the order of selection"]
    theta: Annotated[
        Numbers,
        "(k) coefficients of the terms of states that are scaled as in `states`",
        "those of the terms",
    ]
    theta_error: Annotated[
        Array, "(k) standard errors of theta; NaN without a degree of freedom", "those of the terms"
    ]
    constant: Annotated[Number, "the constant", "[target]"]
    limits: Annotated[Span, "smallest and largest training output", "[target]"]
    errors_note: ErrorsNote = LOWER_BOUND

    @property
    def scaling(self) -> Scaling:
        """Scaling of the states as a `Scaling`, the form in which segments store it. The constant
        of the model is the intercept of y.
        """
        states = self.states
        width = states.high - states.low if states.scaled else np.ones(len(states.names))
        # the slope is zero for a state that was constant in training
        slope = np.divide(1.0, width, out=np.zeros(len(width)), where=width > 0)
        low = states.low if states.scaled else np.zeros(len(width))
        return Scaling(
            "range" if states.scaled else "none",
            "-",
            states.names,
            slope,
            -low * slope,
            1.0,
            self.constant,
        )


@dataclass(frozen=True)
class Identified:
    """Parameters of operators that training estimated.

    If the search for a parameter ended at one of its bounds, `held` is True for this parameter: the
    data do not determine its value within the bounds.
    """

    names: Annotated[tuple[TermName, ...], "(m) names, such as `p of wen(force[k-1])`"]
    numbers: Annotated[Array, "(m) the numbers", "s, Hz or 1"]
    errors: Annotated[Array, "(m) standard errors; NaN at a bound", "those of the numbers"]
    held: Annotated[BoolArray, "(m) 1 if the search ended at a bound"]

    @property
    def notes(self) -> tuple[str, ...]:
        """One note for each parameter that ended at a bound of the search."""
        note = (
            "lies at a bound of its search, because the training data call for a value beyond it, "
            "or do not determine it"
        )
        ends = zip(self.names, self.numbers.tolist(), self.held.tolist(), strict=True)
        return tuple(f"{name} = {number:.4g} {note}" for name, number, held in ends if held)


@dataclass(frozen=True)
class MemoryFit(Fit):
    """Fit of a model with memory: the model, and how its k terms were chosen from M candidates.

    If terms were pruned, `selection` is computed again with the remaining terms only, and so is its
    ERR. Tables show NaN as the ERR of the terms that were removed.
    """

    model: Annotated[MemoryModel, "the model"]
    candidates: Annotated[tuple[TermName, ...], "(M) names of all M dictionary terms"]
    selection: Annotated[
        Selection, "how the terms were found; after pruning, among the remaining terms"
    ]
    ridge: Annotated[
        float, "ridge as a fraction of the variance of a standardised candidate; 0 for none"
    ]
    forward: Annotated[IntArray, "candidates chosen before pruning, in their order, from 0", "-"]
    held_out: Annotated[
        Array | None,
        "free-run RMSE of the models of 1, 2, ... terms over the last training samples; the models "
        "are fitted to the other samples; inf if a run diverged",
        "[target]",
    ] = None
    identified: Annotated[
        Identified | None,
        "operator parameters that training estimated; absent if the dictionary gives all of them",
    ] = None

    @property
    def piece(self) -> SegmentFit:
        """The fit in the form of a fit of one segment, so that the same tables can show its
        terms.
        """
        return SegmentFit(PIECE, PIECE, (), self.candidates, self.model.scaling, self.selection)
