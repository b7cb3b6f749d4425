"""Black boxes as competitors, and as the yardstick of a search: what a learner that knows nothing
of muscles makes of the same samples.

They come from scikit-learn (extra `baselines`), which is imported when one is fitted. Inputs are
those of the run's own model, scaled to mean 0 and deviation 1 on the training samples. Against a
model that runs along recordings they also get every input some samples before (`DELAYS`), since
without a past they could not compete; the output is never fed back.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any, TypeVar

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.modelling.kinds import runs_over_time

T = TypeVar("T", bound=np.ndarray[Any, Any])

SEED = 0
DELAYS = (0, 1, 2, 4, 8, 16, 32)
"""Samples by which inputs are delayed where the run's own model has a past."""

MOST_SAMPLES = {"gaussian_process": 400, "gradient_boosting": 20_000, "mlp": 5_000}
"""Training samples of each at most, an even share: a Gaussian process costs the cube of their
number.
"""

MOST_IN_A_FOLD = 1_500
"""Training samples of a black box in each fold; half of those that it has as a competitor, where
these are fewer.
"""

FEWEST = 100
"""Training samples, below which no trees are fitted in folds: a step for every handful of samples
says nothing of a smooth surface.
"""

MOST_INPUTS = 4
"""Inputs, delays included, up to which a Gaussian process is fitted: it takes long with more."""

BINS = 12
"""Of a quantity, between which the mean of the residual is compared."""

TELLS = 0.2
"""Share of the residual's variance that a quantity explains, from which on it is named."""


def predictions(name: str, dataset: Dataset, model: Model) -> list[Array]:
    """Fit the baseline to the training samples, and predict every sample of every curve, (n_c,)
    each.

    - `name`: one of `domain.scores.BASELINES`.
    - `model`: the run's own model, for the names of the inputs.
    """
    names = [quantity.name for quantity in model.inputs if quantity.name != dataset.target]
    delays = DELAYS if runs_over_time(model) else (0,)
    inputs = [features(curve, names, delays) for curve in dataset.curves]
    x = np.concatenate(
        [of[curve.training] for of, curve in zip(inputs, dataset.curves, strict=True)]
    )
    y = np.concatenate([curve.columns[dataset.target][curve.training] for curve in dataset.curves])
    known = np.isfinite(x).all(axis=1) & np.isfinite(y)
    x, y = _share(x[known], MOST_SAMPLES[name]), _share(y[known], MOST_SAMPLES[name])
    predict = learned(name, x, y)
    return [predict(of) for of in inputs]


def learned(name: str, x: Array, y: Array) -> Callable[[Array], Array]:
    """Fit a baseline to inputs (n, features) and outputs (n,); what predicts (m,) from (m,
    features).
    """
    centre, width = x.mean(axis=0), _width(x)
    middle, height = float(y.mean()), float(_width(y))
    learner = _learner(name, x.shape[1])
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", module="sklearn"
        )  # a search that stopped early: its score says what it is worth
        learner.fit((x - centre) / width, (y - middle) / height)
    return lambda of: _predicted(learner, (of - centre) / width) * height + middle


def features(curve: Curve, names: Sequence[str], delays: Sequence[int]) -> Array:
    """Return the inputs of every sample and those before it in its recording, (n, features); the
    first stands for what came before.
    """
    found = np.empty((curve.size, len(names) * len(delays)))
    for rows in curve.logs:
        places = np.arange(len(rows))
        columns = [
            curve.columns[name][rows][np.maximum(places - delay, 0)]
            for name in names
            for delay in delays
        ]
        found[rows] = np.column_stack(columns)
    return found


def _share(values: T, most: int) -> T:
    """At most so many rows, evenly spread."""
    return (
        values
        if len(values) <= most
        else values[np.linspace(0, len(values) - 1, most).round().astype(int)]
    )


def _width(values: Array) -> Array:
    """Return standard deviations; 1 where nothing varies."""
    found = values.std(axis=0)
    return np.where(found > 0, found, 1.0)


def _predicted(learner: Any, inputs: Array) -> Array:
    """Predictions (n,), NaN where an input is."""
    found = np.full(len(inputs), np.nan)
    known = np.isfinite(inputs).all(axis=1)
    if known.any():
        found[known] = learner.predict(inputs[known])
    return found


def _learner(name: str, inputs: int) -> Any:
    """Return the learner with its settings, the same for every study."""
    if name == "gaussian_process":
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

        kernel = ConstantKernel(1.0) * RBF(np.ones(inputs)) + WhiteKernel(1e-2)
        return GaussianProcessRegressor(kernel, n_restarts_optimizer=1, random_state=SEED)
    if name == "gradient_boosting":
        from sklearn.ensemble import HistGradientBoostingRegressor

        return HistGradientBoostingRegressor(
            max_iter=300, min_samples_leaf=5, early_stopping=False, random_state=SEED
        )
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(
        hidden_layer_sizes=(32, 32), solver="lbfgs", alpha=1e-3, max_iter=500, random_state=SEED
    )


Left = tuple[Array, BoolArray]
"""Errors of a structure on the samples of a fold, (n,), and which of them it predicts."""


def black_boxes(
    dataset: Dataset,
    folds: Sequence[Sequence[BoolArray]],
    rows: Sequence[BoolArray],
    inputs: Sequence[str],
    past: bool,
) -> dict[str, list[Left]]:
    """Errors of each black box on the left-out samples of every fold, by its name; without
    scikit-learn of a Gaussian process alone.

    It learns from, and is asked for, some `rows` of every curve. With a `past` it gets delayed
    inputs as well. The Gaussian process is that of `plan`: loading scikit-learn takes longer than
    all structures of a small table.
    """
    if not inputs:
        return {}
    delays = DELAYS if past else (0,)
    x = np.concatenate(
        [
            features(curve, inputs, delays)[some]
            for curve, some in zip(dataset.curves, rows, strict=True)
        ]
    )
    y = np.concatenate(
        [
            curve.columns[dataset.target][some]
            for curve, some in zip(dataset.curves, rows, strict=True)
        ]
    )
    names = ["gaussian_process"] if x.shape[1] <= MOST_INPUTS else []
    if find_spec("sklearn") is not None and (len(x) >= FEWEST or not names):
        names.append(
            "gradient_boosting" if len(x) >= FEWEST else "mlp"
        )  # a network takes as long as the rest of a search
    found: dict[str, list[Left]] = {name: [] for name in names}
    for fold in folds:
        out = np.concatenate([mask[some] for mask, some in zip(fold, rows, strict=True)])
        rest = np.flatnonzero(~out)
        for name in names:
            learnt = _share(rest, min(MOST_IN_A_FOLD, MOST_SAMPLES[name] // 2))
            learner = smooth if name == "gaussian_process" else partial(learned, name)
            errors = learner(x[learnt], y[learnt])(x[out]) - y[out]
            found[name].append((errors, np.isfinite(errors)))
    return found


def smooth(x: Array, y: Array) -> Callable[[Array], Array]:
    """Fit a Gaussian process to inputs (n, d) and outputs (n,); what predicts (m,) from (m, d)."""
    from mapmore_cli.annexes.planning.points import fitted

    low, middle = x.min(axis=0), y.mean()
    width = np.where(np.ptp(x, axis=0) > 0, np.ptp(x, axis=0), 1.0)
    process = fitted((x - low) / width, y - middle)
    return lambda at: process.predict((at - low) / width)[0] + middle


def strongest(
    curves: Sequence[Curve], residual: Sequence[Array], inputs: Sequence[str], past: bool
) -> str:
    """Return what explains most of a residual, (n_c,) of each curve, NaN where unknown: an input,
    an earlier one, a direction, the time.

    It is the share of the variance between the means of equally full bins; "" where nothing
    explains a fifth.
    """
    e = np.concatenate(list(residual))
    known = np.isfinite(e)
    if known.sum() < 2 * BINS or np.ptp(e[known]) == 0:
        return ""
    shares = {
        words: _explained(values[known], e[known])
        for words, values in _explanations(curves, inputs, past)
    }
    words = max(shares, key=lambda one: shares[one], default="")
    return (
        f"{words} ({shares[words]:.0%} of its variance)" if words and shares[words] >= TELLS else ""
    )


def _explanations(
    curves: Sequence[Curve], inputs: Sequence[str], past: bool
) -> Iterator[tuple[str, Array]]:
    """Quantities in words, each with its values along all curves."""
    for name in inputs:
        yield name, np.concatenate([curve.columns[name] for curve in curves])
        if past:
            for steps in DELAYS[1:]:
                yield (
                    f"{name} {steps} sample{'s' if steps > 1 else ''} before",
                    _along(curves, name, steps),
                )
            yield (
                f"the direction of {name}",
                np.sign(_along(curves, name, 0) - _along(curves, name, 1)),
            )
    if all("time" in curve.columns for curve in curves):
        yield (
            "the time (a drift, or cycles that differ)",
            np.concatenate([curve.columns["time"] for curve in curves]),
        )


def _along(curves: Sequence[Curve], name: str, steps: int) -> Array:
    """Return a quantity some samples before, in each recording."""
    return np.concatenate([features(curve, [name], (steps,))[:, 0] for curve in curves])


def _explained(values: Array, e: Array) -> float:
    """Return the variance of the means of bins over the whole variance, with the degrees of freedom
    counted.
    """
    edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)[1:-1]))
    places = np.searchsorted(edges, values, side="right")
    means = {place: e[places == place].mean() for place in np.unique(places)}
    within = sum(float(np.sum((e[places == place] - mean) ** 2)) for place, mean in means.items())
    total = float(np.sum((e - e.mean()) ** 2))
    free = len(e) - len(means)
    return 1 - within / free / (total / (len(e) - 1)) if free > 0 and total > 0 else 0.0
