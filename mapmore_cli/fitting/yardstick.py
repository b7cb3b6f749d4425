"""Black boxes as a yardstick of a search: on the same left-out blocks, how much less does one err that knows nothing of muscles?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.util import find_spec

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.recording import Curve, Dataset
from mapmore_cli.fitting import baselines

LESS = 0.8
"""Times the error of the structure that was found, below which a black box errs clearly less."""

MOST_SAMPLES = 1_500
"""Training samples of a black box in each fold; fewer where as a competitor it has fewer."""

MOST_INPUTS = 4
"""Inputs, delays included, up to which a Gaussian process is fitted: it takes long with more."""

DELAYS = (1, 2, 4, 8, 16, 32)
BINS = 12
"""Of a quantity, between which the mean of the residual is compared."""

TELLS = 0.2
"""Share of the residual's variance that a quantity explains, from which on it is named."""


def black_boxes(dataset: Dataset, inputs: Sequence[str], folds: Sequence[Sequence[BoolArray]], past: bool) -> dict[str, float]:
    """RMSE of each black box on the left-out samples of all folds, by its name; nothing where scikit-learn is not installed.

    Against structures with a past they get delayed inputs as well.
    """
    if find_spec("sklearn") is None or not inputs:
        return {}
    delays = (0, *DELAYS) if past else (0,)
    x = [baselines.features(curve, inputs, delays) for curve in dataset.curves]
    names = ["gradient_boosting", "gaussian_process" if len(inputs) * len(delays) <= MOST_INPUTS else "mlp"]
    errors: dict[str, list[Array]] = {name: [] for name in names}
    y = np.concatenate([curve.columns[dataset.target] for curve in dataset.curves])
    for fold in folds:
        out = np.concatenate(list(fold))
        rest = np.flatnonzero(~out)
        for name in names:
            most = min(len(rest), MOST_SAMPLES, baselines.MOST_SAMPLES[name])
            rows = rest[np.linspace(0, len(rest) - 1, most).round().astype(int)]
            predict = baselines.learned(name, np.concatenate(x)[rows], y[rows])
            errors[name].append(predict(np.concatenate(x)[out]) - y[out])
    return {name: float(np.sqrt(np.nanmean(np.concatenate(each) ** 2))) for name, each in errors.items()}


def strongest(curves: Sequence[Curve], residual: Sequence[Array], inputs: Sequence[str], past: bool) -> str:
    """Return what explains most of a residual, (n_c,) of each curve, NaN where unknown: an input, an earlier one, a direction, the time.

    It is the share of the variance between the means of equally full bins; "" where nothing explains a fifth.
    """
    e = np.concatenate(list(residual))
    known = np.isfinite(e)
    if known.sum() < 2 * BINS or np.ptp(e[known]) == 0:
        return ""
    shares = {words: _share(values[known], e[known]) for words, values in _explanations(curves, inputs, past)}
    words = max(shares, key=lambda one: shares[one], default="")
    return f"{words} ({shares[words]:.0%} of its variance)" if words and shares[words] >= TELLS else ""


def _explanations(curves: Sequence[Curve], inputs: Sequence[str], past: bool) -> Iterator[tuple[str, Array]]:
    """Quantities in words, each with its values along all curves."""
    for name in inputs:
        yield name, np.concatenate([curve.columns[name] for curve in curves])
        if past:
            for steps in DELAYS:
                yield f"{name} {steps} sample{'s' if steps > 1 else ''} before", _along(curves, name, steps)
            yield f"the direction of {name}", np.sign(_along(curves, name, 0) - _along(curves, name, 1))
    if all("time" in curve.columns for curve in curves):
        yield "the time (a drift, or cycles that differ)", np.concatenate([curve.columns["time"] for curve in curves])


def _along(curves: Sequence[Curve], name: str, steps: int) -> Array:
    """Return a quantity some samples before, in each recording; its first value stands for what was before it."""
    found = [np.empty(curve.size) for curve in curves]
    for curve, values in zip(curves, found, strict=True):
        for log in curve.logs:
            values[log] = curve.columns[name][log][np.maximum(np.arange(len(log)) - steps, 0)]
    return np.concatenate(found)


def _share(values: Array, e: Array) -> float:
    """Return the variance of the means of bins over the whole variance, with the degrees of freedom counted."""
    edges = np.unique(np.quantile(values, np.linspace(0, 1, BINS + 1)[1:-1]))
    places = np.searchsorted(edges, values, side="right")
    means = {place: e[places == place].mean() for place in np.unique(places)}
    within = sum(float(np.sum((e[places == place] - mean) ** 2)) for place, mean in means.items())
    total = float(np.sum((e - e.mean()) ** 2))
    free = len(e) - len(means)
    return 1 - within / free / (total / (len(e) - 1)) if free > 0 and total > 0 else 0.0


def note_of(errors: Mapping[str, float], own: float, hint: str) -> str:
    """Return the sentence for the user; empty where no black box errs clearly less."""
    name = min(errors, key=lambda one: errors[one], default="")
    if not name or not errors[name] < LESS * own:
        return ""
    words = {"gaussian_process": "a Gaussian process", "gradient_boosting": "gradient boosting", "mlp": "a small network"}[name]
    told = f"; what is left depends most on {hint}" if hint else ""
    return f"{words} errs {own / errors[name]:.2g} times less on left-out training data: the structure lacks something{told}"
