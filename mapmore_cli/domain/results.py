"""What fits, simulations and forecasts hand on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.fits import FormulaFit, SegmentFit
from mapmore_cli.domain.memory import MemoryFit
from mapmore_cli.domain.motion import MotionFit


@dataclass(frozen=True)
class PiecesFit:
    """The segment functions of every training curve."""

    segments: Annotated[tuple[SegmentFit, ...], "segment functions"]


@dataclass(frozen=True)
class FitResult:
    """What was fitted, with every intermediate result of the selection of terms.

    `body` is of the kind's own type (`modelling.kinds`), fitted to what `backbone` leaves where there is one.
    """

    body: Annotated[Any, "what was fitted; absent where models are only added up"]
    backbone: Annotated[FormulaFit | None, "formula whose residual was fitted"] = None
    notes: Annotated[tuple[str, ...], "remarks for the reader"] = ()
    max_terms: Annotated[int, "number of terms that left-out training data chose; 0 where the spec says it", "-"] = 0

    @property
    def pieces(self) -> tuple[SegmentFit, ...]:
        """Everything that terms were chosen for: the segments, or the model with memory as one piece."""
        return self.segments if self.memory is None else (self.memory.piece,)

    @property
    def segments(self) -> tuple[SegmentFit, ...]:
        """The segment functions, where the model consists of pieces."""
        return self.body.segments if isinstance(self.body, PiecesFit) else ()

    @property
    def memory(self) -> MemoryFit | None:
        """The fit where it is one with memory."""
        return self.body if isinstance(self.body, MemoryFit) else None

    @property
    def motion(self) -> MotionFit | None:
        """The fit where it is one of motion."""
        return self.body if isinstance(self.body, MotionFit) else None

    @property
    def formula(self) -> FormulaFit | None:
        """The formula that was fitted: the backbone, or the model itself."""
        return self.body if isinstance(self.body, FormulaFit) else self.backbone


@dataclass(frozen=True)
class Run:
    """Predictions (n,), empty (NaN) before there is history and from a sample at which the run left all bounds to the end of its piece.

    `diverged` are the rows of such samples.
    """

    values: Array
    diverged: tuple[int, ...] = ()


@dataclass(frozen=True)
class Forecast:
    """Predictions of the samples of a curve, (n,) each.

    - `values`: the model's prediction, in free run where it has memory; NaN before there is history, and from where a run diverged.
    - `ready`: samples with enough history to be predicted; what is NaN among them has diverged.
    - `one_step`: prediction of every sample from the measured past; None for a model without memory.
    - `half`: half of the width of the interval at every sample, NaN where there is none; None for a model without intervals.
    """

    values: Array
    ready: BoolArray
    one_step: Array | None = None
    half: Array | None = None

    @classmethod
    def of(cls, values: Array) -> Forecast:
        """Predictions that need no history; what is NaN among them is none."""
        return cls(values, np.ones(len(values), dtype=np.bool_))

    @property
    def diverged(self) -> tuple[int, ...]:
        """Rows at which a free run diverges."""
        if self.one_step is None:
            return ()
        lost = self.ready & np.isnan(self.values)
        return tuple(np.flatnonzero(lost & ~np.concatenate([[False], lost[:-1]])).tolist())
