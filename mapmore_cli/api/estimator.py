"""Provide regression by FROLS as a class with the interface of a scikit-learn estimator. The
package scikit-learn itself need not be installed.
"""

from __future__ import annotations

import sys
import warnings
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from itertools import product
from math import comb
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Selection
from mapmore_cli.modelling.expressions import Expression, parse, substitute
from mapmore_cli.modelling.expressions.evaluation import dictionary_matrix
from mapmore_cli.modelling.expressions.families import products, refuse_beyond_memory
from mapmore_cli.modelling.expressions.printing import to_text
from mapmore_cli.modelling.expressions.states import IDENTIFIER
from mapmore_cli.modelling.frols.engine import frols
from mapmore_cli.pipeline.frames import Door, labels_of

TOLERANCE = 1e-4  # default of `tolerance` if `stop` is `tolerance`
FEWEST = 3  # the default of `max_terms` is at least this number, even if there are very few samples
# A column with mean m and standard deviation s is centred if `eps (|m|/s)^order` is larger than
# this number, where eps is the relative rounding error of a double.
LOST = 1e-10
# A coefficient is a sum of contributions, which may cancel except for rounding errors.
# A coefficient below this fraction of the sum of its absolute contributions is treated as zero.
ROUNDING = 1e-13


class NotFitted(ValueError, AttributeError):
    """Error for a method that needs the result of `fit`, but was called before `fit`."""


@dataclass(eq=False, repr=False)
class FROLS:
    """Regression by a polynomial with few terms in the columns of X, selected by error reduction
    ratio (`mapmore_cli.modelling.frols`).

    - `order`: total degree of the candidate monomials; `constant`: whether the constant is a
      candidate.
    - `max_terms`, `tolerance`, `stop`: as in `frols`. Without a tolerance, the extended Bayesian
      criterion (`ebic`) chooses the number of terms, up to half of the number of samples, so that
      noise is left unexplained.

    `X` and `y` may be arrays and frames of any kind. Arrays with units, and missing or masked
    values, are refused.

    After `fit`, the attributes `terms_`, `coef_` and `err_`, (k,) each, hold the terms, their
    coefficients and their error reduction ratios.

    If the values of a column x of `X` vary little around a mean c that is far from zero, the powers
    of x cannot be told apart because of rounding errors. In this case, c is subtracted from x
    before terms are selected (not with `constant=False`, because the difference contains a
    constant). `predict`, `selection_` and `table_` use terms of the difference x - c, for example
    `(x - c)^2`. `terms_` and `coef_` describe the same model by terms of x itself. To get these
    terms, powers of x - c are expanded, which can add terms that were not selected. The error
    reduction ratio of an added term is zero.

    >>> x = np.linspace(0, 1, 50)
    >>> model = FROLS(order=2, max_terms=2).fit(np.column_stack([x, np.cos(9 * x)]), 3 * x**2 - 1)
    >>> model.equations_
    ('3*x0^2 - 1',)
    """

    order: int = 2
    max_terms: int | None = None
    tolerance: float | None = None
    stop: str | None = None
    constant: bool = True
    _estimator_type: ClassVar[str] = "regressor"

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Select terms for the target `y`, (n,), among monomials of the columns of `X`, (n, m).

        Raises ValueError if `X` is not a table of numbers with at least two rows, if `y` is not a
        column with one number for each row of `X`, or if a value is not finite.
        """
        names, values = _names_of_frame(X), _numeric_table(X)
        target = _target(y, len(values))
        samples, m = values.shape
        if samples < 2:
            raise ValueError(
                f"n_samples={samples}: at least 2 samples are needed to fit a model, and "
                "there is 1 sample"
            )
        refuse_beyond_memory(comb(m + self.order, self.order))
        self._columns = tuple(f"x{i}" for i in range(m))
        if names is not None and all(map(IDENTIFIER.fullmatch, names)):
            self._columns = tuple(names)
        self._centre = self._centre_of(values)
        candidates = products(self._columns, self.order, constant=self.constant)
        selection = frols(
            self._dictionary(candidates, values),
            target,
            max(FEWEST, samples // 2) if self.max_terms is None else self.max_terms,
            TOLERANCE if self.tolerance is None else self.tolerance,
            stop=self.stop or ("ebic" if self.tolerance is None else "tolerance"),
            names=self._names_of_centred(candidates),
        )
        self.n_features_in_ = m
        self.__dict__.pop("feature_names_in_", None)
        if names is not None:
            self.feature_names_in_ = np.array(names, dtype=object)
        self._terms, self.selection_ = tuple(candidates[i] for i in selection.chosen), selection
        self.terms_, self.coef_, self.err_ = selection.names, selection.theta, selection.err
        if self._centre.any():
            self.terms_, self.coef_, self.err_ = self._in_columns(candidates, selection)
        return self

    def _names_of_centred(self, candidates: Sequence[Expression]) -> tuple[str, ...]:
        """Return the candidate terms as texts, for example `(x0 - 3.5)^2`. In these texts, a column
        that was centred is written as the difference of the column and its offset.
        """
        centred = {
            name: parse(f"{name} - {centre!r}" if centre > 0 else f"{name} + {-centre!r}")
            for name, centre in zip(self._columns, self._centre.tolist(), strict=True)
            if centre
        }
        return tuple(to_text(substitute(candidate, centred)) for candidate in candidates)

    def _centre_of(self, values: Array) -> Array:
        """Return the offset that is subtracted from each column, (m,). If a column is far from
        zero, the differences between its powers are hardly larger than rounding errors; the offset
        is then the mean of the column. Otherwise, the offset is 0. It is also 0 for a constant
        column, and for every column if the constant is not a candidate.
        """
        mean, spread = values.mean(axis=0), values.std(axis=0)
        far = spread * (LOST / np.finfo(float).eps) ** (1 / max(self.order, 1)) < np.abs(mean)
        return np.where(far & (spread > 0) & self.constant, mean, 0.0)

    def _dictionary(self, terms: Sequence[Expression], values: Array) -> Array:
        centred = (values - self._centre).T
        return dictionary_matrix(terms, dict(zip(self._columns, centred, strict=True)), len(values))

    def _in_columns(
        self, candidates: Sequence[Expression], selection: Selection
    ) -> tuple[tuple[str, ...], Array, Array]:
        """Return the model in the original columns: terms, coefficients and error reduction ratios,
        (k,) each. If columns were centred, the powers of (column - offset) are expanded. The
        coefficients are computed as exact fractions.
        """
        m, chosen = len(self._columns), selection.chosen.tolist()
        # At point j, column j has the value 2, and every other column has the value 1.
        # At point j, a monomial therefore has the value 2^p, where p is its exponent of column j.
        twos = dict(zip(self._columns, 1 + np.eye(m), strict=True))
        powers = np.log2(dictionary_matrix(candidates, twos, m)).round().astype(int).T.tolist()
        number_of = {tuple(power): number for number, power in enumerate(powers)}
        offsets = list(map(Fraction, self._centre.tolist()))
        total = defaultdict(Fraction, dict.fromkeys(chosen, Fraction(0)))
        size = defaultdict[int, float](float)
        for term, theta in zip(chosen, selection.theta.tolist(), strict=True):
            for power, factor in _expanded(powers[term], offsets):
                number, part = number_of[power], Fraction(theta) * factor
                total[number] += part
                size[number] += abs(float(part))
        kept = [number for number in total if abs(float(total[number])) > ROUNDING * size[number]]
        ratio = dict(zip(chosen, selection.err.tolist(), strict=True))
        return (
            tuple(to_text(candidates[number]) for number in kept),
            np.array([float(total[number]) for number in kept]),
            np.array([ratio.get(number, 0.0) for number in kept]),
        )

    def predict(self, X: ArrayLike) -> Array:
        """Return the output of the model at every row of `X`, (n,)."""
        self._check_fitted()
        names = _names_of_frame(X)
        fitted_names = getattr(self, "feature_names_in_", None)
        if names is not None and fitted_names is not None and list(fitted_names) != names:
            raise ValueError(
                "The feature names should match those that were passed during fit, "
                f"{', '.join(fitted_names)}; they are {', '.join(names)}"
            )
        values = _numeric_table(X)
        if values.shape[1] != self.n_features_in_:
            raise ValueError(
                f"X has {values.shape[1]} features, but FROLS is expecting "
                f"{self.n_features_in_} features as input"
            )
        return np.asarray(self._dictionary(self._terms, values) @ self.selection_.theta)

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """Return R² of the prediction."""
        predicted = self.predict(X)
        target = _target(y, len(predicted))
        # values are divided by this number, so that their squares do not overflow
        unit = float(np.abs(target).max()) or 1.0
        predicted, target = predicted / unit, target / unit
        spread = float(np.sum((target - target.mean()) ** 2))
        return 1.0 - float(np.sum((target - predicted) ** 2)) / spread if spread else 0.0

    @property
    def table_(self) -> list[dict[str, Any]]:
        """The rows of the table of coefficients: a mapping for each term, in the order of
        selection, with the keys `term`, `coefficient`, `standard_error`, `t` and `err`.
        """
        self._check_fitted()
        return self.selection_.table()

    @property
    def errors_note_(self) -> str:
        """Sentence that says how far the standard errors can be trusted. If neighbouring samples
        have similar errors, the standard errors are lower bounds.
        """
        self._check_fitted()
        return self.selection_.errors_note

    @property
    def equations_(self) -> tuple[str, ...]:
        """The model as text, with coefficients rounded to six digits."""
        self._check_fitted()
        parts = [
            f"{c:.6g}" if t == "1" else f"{c:.6g}*{t}"
            for t, c in zip(self.terms_, self.coef_, strict=True)
        ]
        return (" + ".join(parts).replace("+ -", "- ") or "0",)

    def get_params(self, deep: bool = True) -> dict[str, Any]:  # noqa: ARG002
        """Return the parameters of the estimator by name, as scikit-learn expects."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def set_params(self, **given: object) -> Self:
        """Set parameters. Raises ValueError for an unknown name."""
        known = self.get_params()
        for name, value in given.items():
            if name not in known:
                raise ValueError(
                    f"Invalid parameter {name!r} for estimator {self!r}. Valid parameters "
                    f"are: {sorted(known)}."
                )
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        changed = [
            f"{field.name}={value!r}"
            for field in fields(self)
            if (value := getattr(self, field.name)) != field.default
        ]
        return f"FROLS({', '.join(changed)})"

    def __sklearn_tags__(self) -> Any:
        """Return the tags that scikit-learn expects of an estimator."""
        from sklearn.utils import InputTags, RegressorTags, Tags, TargetTags

        return Tags(
            estimator_type="regressor",
            target_tags=TargetTags(required=True),
            transformer_tags=None,
            classifier_tags=None,
            regressor_tags=RegressorTags(),
            input_tags=InputTags(),
        )

    def _check_fitted(self) -> None:
        if not hasattr(self, "coef_"):
            raise _of_sklearn("NotFittedError", NotFitted)(
                "This FROLS instance is not fitted yet: call `fit` first"
            )


def _expanded(
    powers: Sequence[int], offsets: Sequence[Fraction]
) -> Iterator[tuple[tuple[int, ...], Fraction]]:
    """Expand the product of all `(column - offset)^power` by the binomial theorem. For every
    monomial whose coefficient is not zero, yield the powers of the columns and the coefficient.
    """
    for lower in product(*(range(power + 1) for power in powers)):
        factor = Fraction(1)
        for power, low, offset in zip(powers, lower, offsets, strict=True):
            factor *= comb(power, low) * (-offset) ** (power - low)
        if factor:
            yield lower, factor


def _names_of_frame(X: object) -> list[str] | None:
    """Return the names of the columns of a data frame. Return None if `X` has no column names, or
    if a name is not a text. Raises ValueError if two columns have the same name.
    """
    labels = labels_of(X) or ()
    names = [label for label in labels if isinstance(label, str)]
    if len(set(names)) < len(names):
        raise ValueError(f"X has several columns with the same name: {', '.join(names)}")
    return names if names and len(names) == len(labels) else None


def _numeric_table(X: object) -> Array:
    """Return a table of numbers, (n, m). Raises ValueError or TypeError for anything else."""
    if hasattr(X, "toarray"):
        raise TypeError(
            "Sparse data was passed for X, but dense data is required. Use '.toarray()' to "
            "convert to a dense numpy array."
        )
    values = _finite_numbers(X, "X")
    if values.ndim != 2:
        hint = (
            "Reshape your data: X.reshape(-1, 1) for one feature, X.reshape(1, -1) for one sample"
        )
        raise ValueError(f"Expected 2D array, got {values.ndim}D array instead. {hint}")
    if 0 in values.shape:
        size = f"0 feature(s) (shape={values.shape})" if len(values) else "0 sample(s)"
        raise ValueError(f"Found array with {size} while a minimum of 1 is required.")
    return values


def _target(y: object, rows: int) -> Array:
    if y is None:
        raise ValueError("requires y to be passed, but the target y is None")
    values = _finite_numbers(y, "y")
    if values.ndim == 2 and values.shape[1] == 1:
        kind = _of_sklearn("DataConversionWarning", UserWarning)
        warnings.warn(
            "A column-vector y was passed when a 1d array was expected.", kind, stacklevel=3
        )
        values = values[:, 0]
    if values.ndim != 1:
        raise ValueError(f"y should be a 1d array, got an array of shape {values.shape} instead.")
    if len(values) != rows:
        raise ValueError(f"X and y have inconsistent numbers of samples: {rows} and {len(values)}")
    return values


def _of_sklearn(name: str, otherwise: type) -> Any:
    """Return the exception or the warning of scikit-learn with this name, if scikit-learn is
    loaded. If it is not loaded, return `otherwise`.
    """
    return getattr(sys.modules.get("sklearn.exceptions"), name, otherwise)


class NotNumbers(ValueError, TypeError):
    """Error for an input that is no table of numbers. It is a ValueError and a TypeError, because
    some callers of scikit-learn catch ValueError and some catch TypeError.
    """


def _no_unit(numbers: Array, unit: str) -> Array:
    if unit == "dimensionless":
        return numbers
    raise ValueError(f"it has the unit {unit}, but no unit is known here: give plain numbers")


def _finite_numbers(values: object, name: str) -> Array:
    """Return the values as an array of finite real numbers. Raises ValueError for other values."""
    try:
        numbers = Door(_no_unit).numbers(values, name)
    except DataError as fault:
        raise NotNumbers(fault.message) from fault
    if not np.isfinite(numbers).all():
        raise ValueError(
            "Input contains NaN or infinity (or missing or masked values). Remove those rows."
        )
    return numbers
