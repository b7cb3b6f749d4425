"""Settings of a spec that its model keeps: a spec is read without loading models."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval

from mapmore_cli.domain.declared import Settings

Transition = Literal["linear", "quadratic", "cubic"]
"""Course of a weight over a transition zone (M2 figure 5)."""

Between = Literal["linear", "pchip"]
"""Interpolation between the curves of neighbouring levels."""

Hold = Literal["samples", "none"]
"""Whether a segment function is held where a transition zone reaches far beyond its samples."""

Beyond = Literal["continue", "continue_linear", "saturate", "zero"]
"""What happens beyond a limit (M2 eq 12)."""


@dataclass(frozen=True, kw_only=True)
class Joining(Settings):
    """How segment functions are joined, as the spec says it and the model keeps it (M2 eq 9-11)."""

    transition: Transition = "linear"
    z_s: Annotated[float, Interval(ge=0, le=0.5)] = 0.25
    levels: Between = "linear"
    hold: Hold = "samples"
