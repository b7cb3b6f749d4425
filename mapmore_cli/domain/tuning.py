"""What came of trying settings out on training data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Trial:
    """One combination of settings, by their place in the spec.

    Attributes
    ----------
    parameters
        Free numbers of its model of all training data.
    errors
        NRMSE on each fold of a model without it; empty where a fit failed, for which `failure` says why.
    error
        Their mean.
    excess, spread
        Mean over the folds of the error less that of the best combination, and the standard error of that mean.
    """

    settings: Mapping[str, Any]
    parameters: int = 0
    errors: tuple[float, ...] = ()
    error: float = float("nan")
    excess: float = float("nan")
    spread: float = float("nan")
    failure: str = ""


@dataclass(frozen=True)
class Tuning:
    """All combinations that were tried; `best` errs least, `chosen` is the simplest within one standard error of it.

    `left_out` says what each fold leaves out, `full_scale` what errors are divided by.
    """

    name: str
    left_out: str
    full_scale: str
    trials: tuple[Trial, ...]
    best: Trial
    chosen: Trial
