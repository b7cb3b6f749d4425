"""What fitting finds out: scalings, FROLS selections, segment fits, fits of formulas."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import Array, IntArray


@dataclass(frozen=True)
class Scaling:
    """Elementwise linear scaling of a segment (M1 step 1, M2 step i).

    `z_j = slope_j x_j + intercept_j` and `y = y_slope y_scaled + y_intercept` (M2 eq 8).
    """

    rule: str  # unit_square | max_abs | none | range
    placement: str  # where the origin lies: "left", "right", "left,right" (one word a variable), "-"
    variables: tuple[str, ...]
    slope: Array  # (variables,)
    intercept: Array  # (variables,)
    y_slope: float
    y_intercept: float


@dataclass(frozen=True, repr=False)
class Selection:
    """Everything that FROLS found out about one segment (M2 eq 2-7), for k chosen of M candidates.

    Attributes
    ----------
    chosen
        `(k,)` dictionary indices in the order of selection.
    g, err
        `(k,)` coefficients of the orthogonalised regressors, and their error reduction ratios.
    theta
        `(k,)` coefficients of the original regressors, from `A theta = g`.
    theta_error
        `(k,)` standard errors of `theta`; NaN where no degree of freedom is left.
    a
        `(k, k)` unit upper triangular, `P_chosen = Q A`.
    g_all, err_all
        `(k, M)` value of every candidate at every iteration; NaN where already chosen or excluded.
    runner_up
        `(k,)` index of the second best candidate of each iteration, -1 where there was none.
    tied
        `(k,)` number of other candidates whose ERR lay within 1e-9 relative of the winner's.
    condition
        2-norm condition number of the chosen regressors.
    sse, yy
        Residual and total sum of squares, both uncentred and in scaled coordinates.
    candidates
        `(M,)` names of the dictionary's columns, where they were given; they are not stored.
    stop
        `tolerance`, `max_terms`, `no_gain`, `rank`, `bic`, `aicc`, `press`, `free_run`, or `pruned` (from more terms to `max_terms`).
    """

    chosen: IntArray
    g: Array
    err: Array
    theta: Array
    theta_error: Array
    a: Array
    g_all: Array
    err_all: Array
    runner_up: IntArray
    tied: IntArray
    condition: float
    sse: float
    yy: float
    samples: int
    stop: str
    candidates: tuple[str, ...] = field(default=(), compare=False, metadata={"stored": False})

    @property
    def names(self) -> tuple[str, ...]:
        """The chosen terms, in the order of selection; `p3` for column 3 where columns have no names."""
        return tuple(self.candidates[i] if self.candidates else f"p{i}" for i in self.chosen.tolist())

    def predict(self, P: ArrayLike) -> Array:
        """Return the model's output at every row of a dictionary `P` with the same columns, (n,)."""
        predicted: Array = np.asarray(P, dtype=np.float64)[:, self.chosen] @ self.theta
        return predicted

    def table(self) -> list[dict[str, Any]]:
        """Return a row for each term, in the order of selection: `{"term", "coefficient", "standard_error", "err"}`."""
        columns = (self.names, self.theta.tolist(), self.theta_error.tolist(), self.err.tolist())
        return [dict(zip(("term", "coefficient", "standard_error", "err"), row, strict=True)) for row in zip(*columns, strict=True)]

    def __repr__(self) -> str:
        """Return the model as one reads it, with the share of `y'y` that each term explains."""
        terms = (f"{row['coefficient']:.6g}" + ("" if row["term"] == "1" else f"*{row['term']}") for row in self.table())
        model = " + ".join(terms).replace("+ -", "- ") or "0"
        shares = ", ".join(f"{100 * row['err']:.4g} %" for row in self.table()) or "none"
        return f"Selection({model}; ERR {shares}; stop: {self.stop})"


@dataclass(frozen=True)
class Segment:
    """Rows of a training curve that one segment function is fitted to."""

    id: str  # pressure=150/strain:2
    curve: str
    cell: tuple[int, ...]  # 1-based place along each segmented variable
    rows: IntArray  # (n,) row numbers within the training curve


@dataclass(frozen=True)
class SegmentedCurve:
    """A training curve cut up.

    `boundaries[j]` are the `(count_j + 1,)` segment locations of `variables[j]`, both ends included;
    `limits` is the range of every input over the curve's training samples.
    """

    curve: str
    level: float | None
    variables: tuple[str, ...]
    boundaries: tuple[Array, ...]
    limits: Mapping[str, tuple[float, float]]
    segments: tuple[Segment, ...]


@dataclass(frozen=True)
class SegmentFit:
    """A segment function: the chosen terms with their scaling, and how they were found."""

    id: str
    curve: str
    cell: tuple[int, ...]
    candidates: tuple[str, ...]  # names of all M dictionary terms
    scaling: Scaling
    selection: Selection

    @property
    def terms(self) -> tuple[str, ...]:
        """Names of the chosen terms in the order of selection."""
        return tuple(self.candidates[i] for i in self.selection.chosen)


@dataclass(frozen=True)
class Optimum:
    """Another minimum of a formula's error that explains the training data nearly as well as the one taken.

    `sse` is its training sum of squares, `held_out_rmse` its error on the validation data; NaN where nobody has asked.
    """

    parameters: Mapping[str, float]
    sse: float
    held_out_rmse: float = math.nan


@dataclass(frozen=True)
class FormulaFit:
    """A literature model fitted to training data.

    `status` is `converged`, `at_bound`, `rank_deficient`, `stopped_by_limit` or `failed`; numbers of a failed fit are NaN.
    `method` names how it was fitted (`linear least squares`, `variable projection`, `levenberg_marquardt`). `rivals` are other minima with
    nearly its training error, the least first: which of them is right, training data hardly tell. `definition` is the formula itself, where
    a spec defines it.
    """

    name: str
    parameters: Mapping[str, float]
    errors: Mapping[str, float]  # standard errors, NaN where unknown
    status: str
    method: str
    rank: int
    condition: float
    sse: float
    samples: int
    notes: tuple[str, ...] = ()
    rivals: tuple[Optimum, ...] = ()
    definition: str = ""

    @property
    def formula(self) -> str:
        """What the formula is found by: its definition, else its name."""
        return self.definition or self.name

    @property
    def failed(self) -> bool:
        """True where the fit gave no usable parameters."""
        return self.status == "failed"
