"""Forward regression with orthogonal least squares (FROLS), the engine of MAPMORE.

M1 eq 2-3, M2 eq 2-7; S. A. Billings, *Nonlinear System Identification*, Wiley 2013, chapter 3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.information import information_criterion

RANK_TOLERANCE = 1e-24
"""A regressor counts as dependent when `q'q <= RANK_TOLERANCE p'p`: what remains is then rounding error."""

TIE_TOLERANCE = 1e-9
"""Candidates whose ERR lies within this fraction of the best are tied; the lower dictionary index wins."""

NO_GAIN = 1e-28
"""The square of rounding error: a smaller ERR explains nothing."""


def frols(P: ArrayLike, y: ArrayLike, max_terms: int | None = None, tolerance: float = 0.0, *, stop: str = "tolerance") -> Selection:
    """Select the few columns of `P` that explain `y`, one after the other by error reduction ratio.

    In each iteration every unselected regressor is orthogonalised against the selected ones (M2 eq 2), its coefficient is
    `g = y'q / q'q` (eq 3) and its error reduction ratio `ERR = g^2 q'q / y'y` (eq 4), with the uncentred `y'y`; the highest wins
    (eq 5). The coefficients of the original regressors follow from `A theta = g`.

    The remainders of all candidates are kept and orthogonalised twice, so that no digits are lost in ill-conditioned dictionaries.

    Parameters
    ----------
    P
        Candidate regressors, (n, M).
    y
        Dependent variable, (n,).
    max_terms
        Limit on the number of terms (M2 eq 7 read as: stop after that many); None for no limit.
    tolerance
        Stop when `1 - sum ERR <= tolerance` (M2 eq 6).
    stop
        `tolerance`; or `bic`, `aicc`, `press`: go on to `max_terms` (or the tolerance) and keep the number of terms at which the
        criterion is least.

    Raises
    ------
    DataError
        Where `P` or `y` has a value that is not finite, with its column and row.
    ValueError
        Where the shapes do not fit or `max_terms` is below one.

    Examples
    --------
    >>> x = np.linspace(0, 1, 50)
    >>> chosen = frols(np.column_stack([x**0, x, x**2]), 3 * x**2 - 1, max_terms=2)
    >>> chosen.chosen.tolist(), chosen.theta.round(12).tolist()
    ([2, 0], [3.0, -1.0])
    """
    P, y = _checked(P, y)
    n, M = P.shape
    if max_terms is not None and max_terms < 1:
        raise ValueError(f"max_terms is {max_terms}; it must be at least 1")
    engine = _Orthogonaliser(P, y)
    limit = min(n, M) if max_terms is None else min(max_terms, n, M)
    reason = "max_terms" if max_terms is not None and limit == max_terms else "rank"
    if engine.yy == 0.0:
        limit, reason = 0, "no_gain"
    while len(engine.chosen) < limit:
        refusal = engine.select()
        if refusal:
            reason = refusal
            break
        if engine.sse[-1] <= tolerance * engine.yy:
            reason = "tolerance"
            break
    k = len(engine.chosen)
    if stop != "tolerance" and k > 0:
        best = information_criterion(stop, np.array(engine.sse) / engine.yy, np.array(engine.press), n)
        if best < k:
            k, reason = best, stop
    return engine.selection(k, reason)


def _checked(P: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    P, y = np.asarray(P, dtype=np.float64), np.asarray(y, dtype=np.float64)
    if P.ndim != 2 or y.ndim != 1 or len(P) != len(y) or P.size == 0:
        raise ValueError(f"P must be (n, M) and y (n,), neither empty; they are {P.shape} and {y.shape}")
    if not np.isfinite(y).all():
        raise DataError(f"y is not finite at row {int(np.argmin(np.isfinite(y)))}", "drop or mend the sample before the fit")
    finite = np.isfinite(P)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise DataError(f"candidate {column} is not finite at row {row}", "drop or mend the sample, or leave the term out")
    return P, y


class _Orthogonaliser:
    """The state of one selection: remainders of all candidates, the orthonormal basis, and the record of every iteration.

    Columns are held divided by a power of two near their largest value: exact, and safe from overflow in the products.
    """

    def __init__(self, P: Array, y: Array) -> None:
        self.column_scale = _power_of_two(np.abs(P).max(axis=0))
        self.y_scale = float(_power_of_two(np.abs(y).max(initial=0.0, keepdims=True))[0])
        self.P = np.asfortranarray(P / self.column_scale)
        self.y = y / self.y_scale
        self.remainder = self.P.copy(order="F")
        self.residual = self.y.copy()
        self.pp = np.einsum("ij,ij->j", self.P, self.P)
        self.yy = float(self.y @ self.y)
        self.basis = np.empty((len(y), 0), order="F")
        self.leverage = np.zeros(len(y))
        self.live: BoolArray = self.pp > 0
        self.chosen: list[int] = []
        self.sse: list[float] = []
        self.press: list[float] = []
        self.tables: list[tuple[Array, Array]] = []
        self.runner_up: list[int] = []
        self.tied: list[int] = []

    def select(self) -> str | None:
        """Choose one more regressor, or say why there is none: `rank` or `no_gain`."""
        qq = np.einsum("ij,ij->j", self.remainder, self.remainder)
        self.live &= qq > RANK_TOLERANCE * self.pp
        if not self.live.any():
            return "rank"
        qq = np.where(self.live, qq, 1.0)
        g = np.where(self.live, self.remainder.T @ self.residual / qq, np.nan)
        err = g**2 * qq / self.yy
        best = float(np.nanmax(err))
        if best <= NO_GAIN:
            return "no_gain"
        ties = np.flatnonzero(err >= best * (1 - TIE_TOLERANCE))
        pick = int(ties[0])
        others = np.where(np.arange(len(err)) == pick, np.nan, err)
        self.runner_up.append(int(np.nanargmax(others)) if np.isfinite(others).any() else -1)
        self.tied.append(len(ties) - 1)
        self.tables.append((g, err))
        self._orthogonalise_against(pick)
        return None

    def _orthogonalise_against(self, pick: int) -> None:
        unit = self.remainder[:, pick].copy()
        unit -= self.basis @ (self.basis.T @ unit)
        unit /= np.linalg.norm(unit)
        self.basis = np.column_stack([self.basis, unit])
        for _ in range(2):  # twice is enough (Giraud and Langou 2005)
            self.remainder -= self.basis @ (self.basis.T @ self.remainder)
            self.residual -= self.basis @ (self.basis.T @ self.residual)
        self.live[pick] = False
        self.chosen.append(pick)
        self.leverage += unit**2
        self.sse.append(float(self.residual @ self.residual))
        with np.errstate(divide="ignore", invalid="ignore"):
            self.press.append(float(np.sum((self.residual / (1 - self.leverage)) ** 2)))

    def selection(self, k: int, stop: str) -> Selection:
        """The first k iterations, in the units of `P` and `y`."""
        chosen = np.array(self.chosen[:k], dtype=np.int64)
        n, M = self.P.shape
        basis, scale = self.basis[:, :k], self.column_scale[chosen]
        R = np.triu(basis.T @ self.P[:, chosen])
        lengths = np.diag(R)
        g_scaled = basis.T @ self.y / lengths
        sse = self.sse[k - 1] if k else self.yy
        theta = np.linalg.solve(R, lengths * g_scaled) if k else np.empty(0)
        variance = sse / (n - k) if n > k else np.nan
        spread = np.linalg.norm(np.linalg.inv(R), axis=1) if k else np.empty(0)
        tables = self.tables[:k]
        return Selection(
            chosen=chosen,
            g=g_scaled * self.y_scale / scale,
            err=(g_scaled * lengths) ** 2 / self.yy if k else np.empty(0),
            theta=theta * self.y_scale / scale,
            theta_error=np.sqrt(variance) * spread * self.y_scale / scale,
            a=R / lengths[:, None] * scale[None, :] / scale[:, None],
            g_all=np.array([g for g, _ in tables]).reshape(k, M) * self.y_scale / self.column_scale,
            err_all=np.array([err for _, err in tables]).reshape(k, M),
            runner_up=np.array(self.runner_up[:k], dtype=np.int64),
            tied=np.array(self.tied[:k], dtype=np.int64),
            condition=float(np.linalg.cond(R * scale)) if k else 1.0,
            sse=sse * self.y_scale**2,
            yy=self.yy * self.y_scale**2,
            samples=n,
            stop=stop,
        )


def _power_of_two(largest: Array) -> Array:
    """The power of two next above each value; one where the value is zero."""
    return np.ldexp(1.0, np.where(largest > 0, np.frexp(largest)[1], 0))
