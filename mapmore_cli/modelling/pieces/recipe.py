"""Everything that MAPMORE has to be told to turn curves into a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from mapmore_cli.domain.models import Fusion, Side


@dataclass(frozen=True)
class Even:
    """`count` segments of one width; neighbours are joined until each holds `min_samples`."""

    count: int
    min_samples: int = 0


@dataclass(frozen=True)
class Breakpoints:
    """Segments between given inner boundaries; neighbours are joined until each holds `min_samples`."""

    at: tuple[float, ...]
    min_samples: int = 0


@dataclass(frozen=True)
class Gradient:
    """`count` segments that meet where the slope of the target changes most (M1 section IV.A).

    `window` is the width of the features to be seen, `separation` the least distance of boundaries, both in the variable's unit; None
    stands for a tenth of the curve's range and for the window.
    """

    count: int
    window: float | None = None
    separation: float | None = None


@dataclass(frozen=True)
class Optimal:
    """`count` segments whose fits leave the least, with boundaries on an even grid of `grid` cells and `min_samples` in each segment."""

    count: int
    grid: int = 20
    min_samples: int = 10


@dataclass(frozen=True)
class Directions:
    """A segment for each direction of motion, fall (-1) and rise (+1)."""


Cut = Even | Breakpoints | Gradient | Optimal | Directions
"""How one variable is cut into segments."""


Scale = Literal["unit_square", "max_abs", "none"]
"""Rule by which a segment's data are scaled (M1 step 1)."""

Stop = Literal["tolerance", "bic", "aicc", "press", "free_run"]
"""What ends the selection of terms."""

Align = Literal["none", "threshold"]
"""Whether curves are interpolated between points at the same pressure or strain, or at the same place relative to their thresholds."""

Limits = Literal["curve", "domain"]
"""Where extrapolation begins: at the ends of each curve, or at those of all training samples (M2 eq 12 as printed)."""


@dataclass(frozen=True)
class Cutting:
    """How samples are cut into curves and segments.

    Attributes
    ----------
    level
        Quantity whose curves are interpolated; None pools all curves into one. It is constant within a curve, or the pressure of step
        responses, whose curves stand at the pressure of their plateau (M2 figure 3h).
    cuts
        Segmentation of each segmented variable.
    pooled
        Quantity whose levels the curves have, where they are pooled into one surface all the same.
    """

    level: str | None
    cuts: Mapping[str, Cut]
    pooled: str | None = None


@dataclass(frozen=True)
class Fitting:
    """How the terms of a segment are chosen; candidates are text, in scaled coordinates."""

    dictionary: tuple[str, ...]
    scaling: Scale
    max_terms: int
    tolerance: float
    stop: Stop


@dataclass(frozen=True)
class Fusing:
    """How segment functions are joined, where the data still have a say.

    Attributes
    ----------
    joints
        What is settled; its extrapolation and its aligned variable are filled in when the curves are known.
    align, limits
        Where the aligned variable and the limits of the training domain come from.
    shrink
        Share of a backbone's residual that is carried to the middle between two levels; None asks left-out training levels.
    extrapolation
        Below and above, for every variable that is named. What is not named, or None, takes `beyond`, and where that is None the
        default: `continue` where every segment has one term, else `saturate`.
    """

    joints: Fusion
    align: Align
    limits: Limits
    shrink: float | None
    extrapolation: Mapping[str, tuple[Side | None, Side | None]]
    beyond: Side | None


@dataclass(frozen=True)
class Recipe:
    """The choices of a MAPMORE model of one `target` (M2 section 4.4 has the paper's), step by step."""

    target: str
    cutting: Cutting
    fitting: Fitting
    fusing: Fusing
