"""Everything that MAPMORE has to be told to turn curves into a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mapmore_cli.domain.models import Side


@dataclass(frozen=True)
class Even:
    """`count` segments of one width."""

    count: int


@dataclass(frozen=True)
class Breakpoints:
    """Segments between given inner boundaries."""

    at: tuple[float, ...]


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


@dataclass(frozen=True)
class Recipe:
    """The choices of a MAPMORE model (M2 section 4.4 has the paper's).

    Attributes
    ----------
    target
        Column that is modelled.
    level
        Quantity whose curves are interpolated; None pools all curves into one. It is constant within a curve, or the pressure of step
        responses, whose curves stand at the pressure of their plateau (M2 figure 3h).
    cuts
        Segmentation of each segmented variable.
    dictionary
        Candidate terms as text, in scaled coordinates.
    levels
        Interpolation between the curves: `linear` or `pchip`.
    align
        `none`, or `threshold`: curves are interpolated between points at the same place relative to their thresholds.
    shrink
        Share of a backbone's residual that is carried to the middle between two levels; None asks left-out training levels.
    extrapolation
        Below and above, for every variable that is named. What is not named, or None, takes `beyond`, and where that is None the
        default: `continue` where every segment has one term, else `saturate`.
    """

    target: str
    level: str | None
    cuts: Mapping[str, Cut]
    dictionary: tuple[str, ...]
    scaling: str = "unit_square"
    max_terms: int = 1
    tolerance: float = 1e-4
    stop: str = "tolerance"
    transition: str = "linear"
    z_s: float = 0.25
    levels: str = "linear"
    align: str = "none"
    shrink: float | None = None
    extrapolation: Mapping[str, tuple[Side | None, Side | None]] = field(default_factory=dict)
    beyond: Side | None = None
