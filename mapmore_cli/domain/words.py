"""Words that a spec and a model share, apart from both: a spec is read without loading models."""

from __future__ import annotations

from typing import Literal

Transition = Literal["linear", "quadratic", "cubic"]
"""Course of a weight over a transition zone (M2 figure 5)."""

Between = Literal["linear", "pchip"]
"""Interpolation between the curves of neighbouring levels."""

Hold = Literal["samples", "none"]
"""Whether a segment function is held where a transition zone reaches far beyond its samples."""
