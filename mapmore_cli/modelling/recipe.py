"""Everything that MAPMORE has to be told to turn curves into a model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from mapmore_cli.domain.models import Side


@dataclass(frozen=True)
class Cut:
    """How one variable is cut into segments: `even` into `count`, or `breakpoints` at the inner boundaries `at`."""

    method: str
    count: int = 1
    at: tuple[float, ...] = ()


@dataclass(frozen=True)
class Recipe:
    """The choices of a MAPMORE model (M2 section 4.4 has the paper's).

    Attributes
    ----------
    target
        Column that is modelled.
    level
        Quantity that is constant within a curve, whose curves are interpolated; None pools all curves into one.
    cuts
        Segmentation of each segmented variable.
    dictionary
        Candidate terms as text, in scaled coordinates.
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
    extrapolation: Mapping[str, tuple[Side | None, Side | None]] = field(default_factory=dict)
    beyond: Side | None = None
