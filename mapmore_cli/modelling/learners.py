"""Declare the black-box competitors. These are general regression methods, without any knowledge of
muscles, that are fitted to the same samples as the model.

They come from scikit-learn (extra `baselines`), which is imported only when a black box is used.
Settings and seeds are the same for every study.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np

from mapmore_cli.domain.arrays import Array


class Regressor(Protocol):
    """Interface of a regressor: `fit` takes inputs, (n, m), and outputs, (n,); `predict` returns
    outputs for new inputs.
    """

    def fit(self, x: Array, y: Array, /) -> object:
        """Fit the regressor to inputs, (n, m), and outputs, (n,)."""

    def predict(self, x: Array, /) -> Array:
        """Return the predicted outputs, (n,), for inputs, (n, m)."""


@dataclass(frozen=True)
class Learner:
    """A black box: a regression method of scikit-learn. `make` takes the number of inputs and
    returns a regressor. If there are more training samples than `most_samples`, an evenly spread
    part of them is used.
    """

    title: str
    most_samples: int
    make: Callable[[int], Regressor]


def _gaussian_process(inputs: int) -> Regressor:
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    kernel = ConstantKernel(1.0) * RBF(np.ones(inputs)) + WhiteKernel(1e-2)
    learner: Regressor = GaussianProcessRegressor(kernel, n_restarts_optimizer=1, random_state=0)
    return learner


def _gradient_boosting(_inputs: int) -> Regressor:
    from sklearn.ensemble import HistGradientBoostingRegressor

    learner: Regressor = HistGradientBoostingRegressor(
        max_iter=300, min_samples_leaf=5, early_stopping=False, random_state=0
    )
    return learner


def _neural_network(_inputs: int) -> Regressor:
    from sklearn.neural_network import MLPRegressor

    learner: Regressor = MLPRegressor(
        hidden_layer_sizes=(32, 32), solver="lbfgs", alpha=1e-3, max_iter=500, random_state=0
    )
    return learner


LEARNERS: Mapping[str, Learner] = MappingProxyType(
    {
        # for n samples, a Gaussian process needs a time of order n^3 and a memory of order n^2
        "gaussian_process": Learner("Gaussian process", 400, _gaussian_process),
        "gradient_boosting": Learner("Gradient boosting", 20_000, _gradient_boosting),
        "mlp": Learner("Neural network", 5_000, _neural_network),
    }
)
"""Black boxes by their names in a spec."""
