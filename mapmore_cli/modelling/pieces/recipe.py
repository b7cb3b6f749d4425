"""Define the settings with which MAPMORE makes a model from curves: the sections `segment` and
`fuse` of a spec, and the recipe, which contains all settings.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Annotated, Literal

from annotated_types import Gt, Interval, Len

from mapmore_cli.domain.declared import (
    Beyond,
    Contradiction,
    Difference,
    Either,
    OfKey,
    Settings,
    of_sibling,
)
from mapmore_cli.domain.joining import Joining
from mapmore_cli.modelling.selection import Fit

USES = {
    "even": ("count", "min_samples"),
    "breakpoints": ("at", "min_samples"),
    "gradient": ("count",),
    "optimal": ("count", "min_samples"),
}
"""Keys of each method; the first is required."""

CELLS = 20
"""Number of cells in the grid of `optimal`."""


@dataclass(frozen=True)
class Cuts(Settings):
    """Rule that cuts the range of one variable into segments. The key `method` is one of these
    words:

    - `even` makes segments of equal width. Neighbouring segments are joined until each has at least
      `min_samples` samples.
    - `breakpoints` makes segments between the boundaries in `at`. Neighbouring segments are joined
      as with `even`.
    - `gradient` puts boundaries where the slope of the target changes most. Neighbouring boundaries
      are at least a tenth of the range of the curve apart. Therefore, there may be fewer segments
      than `count`.
    - `optimal` tries boundaries on a grid of 20 equal cells, and chooses the boundaries with which
      the fits have the smallest error.

    - `method`: One of the words above. Example: `even`
    - `count`: Number of segments. All methods need it, except `breakpoints`, which refuses it. More
      segments follow the curve more closely, but overfit sooner. Example: `4`
    - `at`: Inner boundaries, for `breakpoints` only. Example: `[0.05, 0.1]`
    - `min_samples`: Smallest number of samples in a segment; 10 by default for `optimal`, and
      refused for `gradient`. Example: `20`
    """

    method: Literal["even", "breakpoints", "gradient", "optimal"]
    count: Annotated[int, Interval(ge=1, le=1000)] | None = None
    at: Annotated[Sequence[OfKey], Len(1)] | None = None
    min_samples: Annotated[int, Interval(ge=1)] | None = None

    @property
    def segments(self) -> int:
        """Number of segments, `count`. It must not be None; the methods that use it require it."""
        assert self.count is not None
        return self.count

    @property
    def least(self) -> int:
        """Number of samples that each segment must contain at least."""
        return self.min_samples or (10 if self.method == "optimal" else 0)

    @property
    def joins(self) -> bool:
        """Return True if segments with too few samples are joined with their neighbours."""
        return self.method in ("even", "breakpoints")

    def __post_init__(self) -> None:
        """Raise an error if the method does not use a given key, or if it needs a key that is
        missing.
        """
        needed = USES[self.method][0]
        if getattr(self, needed) is None:
            example = "count: 4" if needed == "count" else "at: [0.05, 0.1]"
            raise Contradiction(
                f"method `{self.method}` needs `{needed}`",
                f"add it, for example `{example}`",
                "method",
            )
        for other in fields(self)[1:]:
            if other.name not in USES[self.method] and getattr(self, other.name) is not None:
                raise Contradiction(
                    f"method `{self.method}` does not use `{other.name}`",
                    f"remove `{other.name}`",
                    other.name,
                )
        if self.at is not None and any(after <= before for before, after in pairwise(self.at)):
            raise Contradiction(
                "the breakpoints do not increase", f"write `at: {sorted(set(self.at))}`", "at"
            )
        if self.method == "optimal" and self.segments > CELLS:
            message = f"{self.count} segments do not fit on a grid of {CELLS} cells"
            raise Contradiction(message, "lower `count`", "count")


@dataclass(frozen=True)
class CutByDirection(Settings):
    """Separate segments for rising and falling motion.

    - `of`: The rate whose sign decides. Example: `strain_rate`
    - `dead_band`: Largest absolute rate that is treated as no motion; the last direction is then
      kept. Example: `0.002`
    """

    of: str
    dead_band: Annotated[float, Gt(0), of_sibling("of", Difference)]


Cut = Cuts | CutByDirection
"""How one variable is cut into segments."""

Segmented = Annotated[Cuts | CutByDirection | Literal["none", "levels"], Either(key="dead_band")]
"""How one variable is cut into segments, or a word for the level quantity: `none` or `levels`."""

WordOrValue = Annotated[Beyond | OfKey, Either()]


@dataclass(frozen=True)
class BelowAbove(Settings):
    """Extrapolation of one variable below and above the measured range. For each side, give a word,
    or the value that replaces the variable on this side (M2 eq 12).

    - `below`: Extrapolation below the lower limit. Example: `saturate`
    - `above`: Extrapolation above the upper limit. Example: `zero`
    """

    below: WordOrValue | None = None
    above: WordOrValue | None = None


@dataclass(frozen=True, kw_only=True)
class Fuse(Joining):
    """Rules for joining the functions of the segments (M2 eq 9-12). A model with memory has no
    segments. Therefore, the keys of this section are refused for such a model.

    - `extrapolation`: What the model does outside the range of each curve (M2 eq 12): one word for
      all variables, or a mapping from each variable to a word or to `{below, above}`. The default
      is `continue` for segments of one term, and `saturate` otherwise. Example: `{strain: {above:
      zero}}`
    """

    extrapolation: (
        Annotated[Beyond | dict[str, Annotated[Beyond | BelowAbove, Either()]], Either()] | None
    ) = None

    def beyond(self, name: str) -> tuple[Beyond | float | None, Beyond | float | None]:
        """Return the extrapolation of a variable below and above its limits; None if the spec gives
        none.
        """
        sides = (
            self.extrapolation.get(name)
            if isinstance(self.extrapolation, Mapping)
            else self.extrapolation
        )
        return (sides.below, sides.above) if isinstance(sides, BelowAbove) else (sides, sides)


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Settings of a MAPMORE model of one `target` (M2 section 4.4 lists the settings of the paper).

    - `dictionary`: candidate terms as text, in scaled coordinates.
    - `cuts`: segmentation of each segmented variable.
    - `level`: quantity whose curves are interpolated; None pools all curves into one. It is
      constant within a curve; for step responses, it is the pressure, and the level of a curve is
      the pressure of its plateau (M2 figure 3h).
    - `bounds`: smallest and largest coefficient of each term, by its text, in the unit of the
      target.
    - `pooled`: quantity whose levels the curves have although they are pooled into one surface.
    """

    target: str
    dictionary: tuple[str, ...]
    cuts: Mapping[str, Cut] = field(default_factory=dict)
    level: str | None = None
    pooled: str | None = None
    fit: Fit = field(default_factory=Fit)
    fuse: Fuse = field(default_factory=Fuse)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
