"""What the fit stage hands on."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.domain.fits import FormulaFit, SegmentFit
from mapmore_cli.domain.memory import MemoryFit


@dataclass(frozen=True)
class FitResult:
    """What the fit stage hands on: the segment functions, fitted to what `backbone` leaves where there is one.

    `fits` is empty where the run's own model is a formula, which is then the backbone, and where one model with `memory` stands in their
    place.
    """

    fits: tuple[SegmentFit, ...]
    backbone: FormulaFit | None = None
    notes: tuple[str, ...] = ()
    memory: MemoryFit | None = None

    @property
    def pieces(self) -> tuple[SegmentFit, ...]:
        """Everything that terms were chosen for: the segments, or the model with memory as one piece."""
        return self.fits if self.memory is None else (*self.fits, self.memory.piece)
