"""What came of searching the structure of a model on training data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Tried:
    """One structure that was tried.

    - `family`, `words`: the family that offered it, and what it is called.
    - `sections`: the sections of a spec that make it, by their names.
    - `parameters`: free numbers of its model of all training data.
    - `errors`: RMSE on each fold of a model without it, as a fraction of `Search.scale`; empty where a fit failed, for which `failure` says
      why.
    - `error`: their root mean square.
    - `parts`: the same over left-out levels or recordings; NaN where there are too few of them.
    - `excess`, `spread`: mean over all folds of the logarithm of the error over that of the best structure, and the standard error of that
      mean.
    - `seconds`: how long it took.
    """

    family: str
    words: str
    sections: Mapping[str, Any]
    parameters: int = 0
    errors: tuple[float, ...] = ()
    error: float = float("nan")
    parts: float = float("nan")
    excess: float = float("nan")
    spread: float = float("nan")
    seconds: float = 0.0
    failure: str = ""


@dataclass(frozen=True)
class Search:
    """All structures that were tried, in the order of the list.

    `best` errs least, `chosen` is the simplest that is as good (numbers of `tried`). `left_out` and `parts` say what the
    folds leave out, `scale` what errors are divided by, in the unit of the target. `cut` structures were not tried for want of time.
    `black_boxes` are errors of learners that know nothing of muscles, on the same folds; `notes` are words for the user.
    """

    name: str
    target: str
    left_out: str
    parts: str
    scale: float
    tried: tuple[Tried, ...]
    best: int
    chosen: int
    cut: int = 0
    black_boxes: Mapping[str, float] | None = None
    notes: tuple[str, ...] = ()

    @property
    def found(self) -> Tried:
        """The structure that was chosen."""
        return self.tried[self.chosen]
