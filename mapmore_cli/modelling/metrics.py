"""How far predictions lie from measurements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.scores import Score


@dataclass(frozen=True)
class Normaliser:
    """What errors are divided by; a table always names it."""

    name: str
    value: float

    def fraction(self, error: float) -> float:
        """The error as a fraction; NaN where there is nothing to divide by."""
        return error / self.value if self.value > 0 else float("nan")


def max_abs(y: Array, quantity: str, split: str) -> Normaliser:
    """`max |y|` over the samples of a split (M2 eq 13)."""
    return Normaliser(f"max|{quantity}| over {split}", float(np.abs(y).max()))


def score(model: str, target: str, split: str, curve: str, measured: Array, predicted: Array, scale: Normaliser) -> Score:
    """One row of the score table over n pooled samples.

    `RMSE = sqrt(mean (y - yhat)^2)`, `NRMSE = RMSE / scale` (M2 eq 13), and `R^2 = 1 - SSE / sum (y - mean y)^2`, which is NaN for a
    constant y. `scale` is the normaliser over all samples of the split, so that the rows of its curves can be compared.
    """
    error = predicted - measured
    spread = float(np.sum((measured - measured.mean()) ** 2))
    rmse = float(np.sqrt(np.mean(error**2)))
    worst = float(np.abs(error).max())
    return Score(
        model=model,
        target=target,
        split=split,
        curve=curve,
        n=len(measured),
        rmse=rmse,
        nrmse=scale.fraction(rmse),
        normaliser=scale.value,
        normaliser_name=scale.name,
        max_abs_error=worst,
        max_abs_error_fs=scale.fraction(worst),
        r2=1 - float(np.sum(error**2)) / spread if spread > 0 else float("nan"),
    )
