"""The regression engine as an estimator that keeps the protocol of scikit-learn, which it does not
need.
"""

from __future__ import annotations

import sys
import warnings
from dataclasses import dataclass, fields
from math import comb
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.given import Door, labels_of
from mapmore_cli.modelling.expressions.evaluation import dictionary_matrix
from mapmore_cli.modelling.expressions.families import products, refuse_beyond_memory
from mapmore_cli.modelling.expressions.printing import to_text
from mapmore_cli.modelling.expressions.states import IDENTIFIER
from mapmore_cli.modelling.frols.engine import frols


class NotFitted(ValueError, AttributeError):
    """`fit` was not called yet."""


@dataclass(eq=False, repr=False)
class FROLS:
    """Few terms of a polynomial in the columns of X, selected by error reduction ratio
    (`mapmore_cli.modelling.frols`).

    - `order`: total degree of the candidate monomials; `constant`: whether the constant is one.
    - `max_terms`, `tolerance`, `stop`: as in `frols`.

    `X` and `y` may be arrays and frames of any kind. Units, and values that are missing or masked,
    are refused.

    After `fit`, `terms_`, `coef_` and `err_` are the terms, their coefficients and error reduction
    ratios, (k,).

    >>> x = np.linspace(0, 1, 50)
    >>> model = FROLS(order=2, max_terms=2).fit(np.column_stack([x, np.cos(9 * x)]), 3 * x**2 - 1)
    >>> model.equations_
    ('3*x0^2 - 1',)
    """

    order: int = 2
    max_terms: int | None = None
    tolerance: float = 1e-4
    stop: str = "tolerance"
    constant: bool = True
    _estimator_type: ClassVar[str] = "regressor"

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Select terms for the target `y`, (n,), among monomials of the columns of `X`, (n, m).

        Raises ValueError for tables of another form, or values that are not finite.
        """
        names, values = _names_of_frame(X), _numeric_table(X)
        target = _target(y, len(values))
        if len(values) < 2:
            raise ValueError(
                f"n_samples={len(values)}: at least 2 samples are needed to fit a model, and "
                "there is 1 sample"
            )
        columns = (
            names
            if names is not None and all(map(IDENTIFIER.fullmatch, names))
            else [f"x{i}" for i in range(values.shape[1])]
        )
        refuse_beyond_memory(comb(values.shape[1] + self.order, self.order))
        candidates = products(columns, self.order, constant=self.constant)
        P = dictionary_matrix(candidates, dict(zip(columns, values.T, strict=True)), len(values))
        found = frols(
            P,
            target,
            self.max_terms,
            self.tolerance,
            stop=self.stop,
            names=tuple(map(to_text, candidates)),
        )
        self.n_features_in_ = values.shape[1]
        self.__dict__.pop("feature_names_in_", None)
        if names is not None:
            self.feature_names_in_ = np.array(names, dtype=object)
        self._columns, self._terms = tuple(columns), tuple(candidates[i] for i in found.chosen)
        self.terms_, self.coef_, self.err_, self.selection_ = (
            found.names,
            found.theta,
            found.err,
            found,
        )
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Return the model at every row of `X`, (n,)."""
        self._check_fitted()
        names = _names_of_frame(X)
        own = getattr(self, "feature_names_in_", None)
        if names is not None and own is not None and list(own) != names:
            raise ValueError(
                "The feature names should match those that were passed during fit, "
                f"{', '.join(own)}; they are {', '.join(names)}"
            )
        values = _numeric_table(X)
        if values.shape[1] != self.n_features_in_:
            raise ValueError(
                f"X has {values.shape[1]} features, but FROLS is expecting "
                f"{self.n_features_in_} features as input"
            )
        P = dictionary_matrix(
            self._terms, dict(zip(self._columns, values.T, strict=True)), len(values)
        )
        return np.asarray(P @ self.coef_)

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """R² of the prediction."""
        predicted = self.predict(X)
        target = _target(y, len(predicted))
        spread = float(np.sum((target - target.mean()) ** 2))
        return 1.0 - float(np.sum((target - predicted) ** 2)) / spread if spread else 0.0

    @property
    def table_(self) -> list[dict[str, Any]]:
        """A row for each term, in the order of selection: `{"term", "coefficient",
        "standard_error", "t", "err"}`.
        """
        self._check_fitted()
        return self.selection_.table()

    @property
    def equations_(self) -> tuple[str, ...]:
        """The model as text, six digits."""
        self._check_fitted()
        parts = [
            f"{c:.6g}" if t == "1" else f"{c:.6g}*{t}"
            for t, c in zip(self.terms_, self.coef_, strict=True)
        ]
        return (" + ".join(parts).replace("+ -", "- ") or "0",)

    def get_params(self, deep: bool = True) -> dict[str, Any]:  # noqa: ARG002
        """Return the parameters by name."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def set_params(self, **given: Any) -> Self:
        """Set parameters; raises `ValueError` for one that there is not."""
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
            f"{one.name}={value!r}"
            for one in fields(self)
            if (value := getattr(self, one.name)) != one.default
        ]
        return f"FROLS({', '.join(changed)})"

    def __sklearn_tags__(self) -> Any:
        """Return what scikit-learn asks of an estimator."""
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


def _names_of_frame(X: Any) -> list[str] | None:
    """Return the names of a frame's columns; None where there are none, or they are not all
    text.
    """
    labels = labels_of(X) or ()
    names = [label for label in labels if isinstance(label, str)]
    if len(set(names)) < len(names):
        raise ValueError(f"X has columns of one name: {', '.join(names)}")
    return names if names and len(names) == len(labels) else None


def _numeric_table(X: Any) -> Array:
    """Return a table of numbers, (n, m); raises `ValueError` or `TypeError` for anything else."""
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
        what = f"0 feature(s) (shape={values.shape})" if len(values) else "0 sample(s)"
        raise ValueError(f"Found array with {what} while a minimum of 1 is required.")
    return values


def _target(y: Any, rows: int) -> Array:
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
    """Return a class that scikit-learn has for a fault, where that is loaded."""
    return getattr(sys.modules.get("sklearn.exceptions"), name, otherwise)


class NotNumbers(ValueError, TypeError):
    """What is no table of numbers; scikit-learn asks for one of the two, depending on why."""


def _no_unit(numbers: Array, unit: str) -> Array:
    if unit == "dimensionless":
        return numbers
    raise ValueError(f"it has the unit {unit}, and no unit is known here: give plain numbers")


def _finite_numbers(values: Any, name: str) -> Array:
    """Finite real numbers; raises `ValueError` for others."""
    try:
        found = Door(_no_unit).numbers(values, name)
    except DataError as fault:
        raise NotNumbers(fault.message) from fault
    if not np.isfinite(found).all():
        raise ValueError(
            "Input contains NaN or infinity: missing and masked values are such. Leave their "
            "rows out."
        )
    return found
