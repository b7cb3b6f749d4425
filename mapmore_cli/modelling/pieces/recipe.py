"""What MAPMORE has to be told to turn curves into a model: the sections `segment` and `fuse`, and
the whole recipe.
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
"""Keys of each method; the first is needed."""

CELLS = 20
"""Cells of the grid of `optimal`."""


@dataclass(frozen=True)
class Cuts(Settings):
    """How one variable is cut into segments.

    - `even`: so many of equal width; `breakpoints`: at given places. Neighbours are joined until
      each holds `min_samples`.
    - `gradient`: where the slope of the target changes most, a tenth of each curve's range apart.
    - `optimal`: where the fits leave the least, on a grid of 20 equal cells.

    - `method`: one of these, as `even`
    - `count`: number of segments (not for `breakpoints`), as `4`
    - `at`: the inner boundaries of `breakpoints`, as `[0.05, 0.1]`
    - `min_samples`: samples that each segment holds at least (`optimal`: 10), as `20`
    """

    method: Literal["even", "breakpoints", "gradient", "optimal"]
    count: Annotated[int, Interval(ge=1, le=1000)] | None = None
    at: Annotated[Sequence[OfKey], Len(1)] | None = None
    min_samples: Annotated[int, Interval(ge=1)] | None = None

    @property
    def segments(self) -> int:
        """The `count`, of the methods that need it."""
        assert self.count is not None
        return self.count

    @property
    def least(self) -> int:
        """Samples that each segment holds at least."""
        return self.min_samples or (10 if self.method == "optimal" else 0)

    @property
    def joins(self) -> bool:
        """Whether segments with too few samples are joined to their neighbours."""
        return self.method in ("even", "breakpoints")

    def __post_init__(self) -> None:
        """Refuse keys that the method lacks or has no use for."""
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
            what = f"{self.count} segments do not fit on a grid of {CELLS} cells"
            raise Contradiction(what, "lower `count`", "count")


@dataclass(frozen=True)
class CutByDirection(Settings):
    """Segments for rise and fall.

    - `of`: the rate whose sign decides, as `strain_rate`
    - `dead_band`: rate up to which the last direction holds, as `0.002`
    """

    of: str
    dead_band: Annotated[float, Gt(0), of_sibling("of", Difference)]


Cut = Cuts | CutByDirection
"""How one variable is cut into segments."""

Segmented = Annotated[Cuts | CutByDirection | Literal["none", "levels"], Either(key="dead_band")]
"""A cut, or a word about the quantity of `levels`."""

WordOrValue = Annotated[Beyond | OfKey, Either()]


@dataclass(frozen=True)
class BelowAbove(Settings):
    """Extrapolation of one variable on each side: a word, or the value that the variable takes (M2
    eq 12).

    - `below`: below its limit, as `saturate`
    - `above`: above its limit, as `zero`
    """

    below: WordOrValue | None = None
    above: WordOrValue | None = None


@dataclass(frozen=True, kw_only=True)
class Fuse(Joining):
    """How pieces are joined (M2 eq 9-12).

    - `extrapolation`: what happens beyond each curve's ends (M2 eq 12): a word, or a mapping from
      variable to word or `{below, above}`; `continue` by default for one-term fits, else
      `saturate`, as `{strain: {above: zero}}`
    """

    extrapolation: (
        Annotated[Beyond | dict[str, Annotated[Beyond | BelowAbove, Either()]], Either()] | None
    ) = None

    def beyond(self, name: str) -> tuple[Beyond | float | None, Beyond | float | None]:
        """Return the extrapolation of a variable below and above its limits; None if nothing is
        said.
        """
        said = (
            self.extrapolation.get(name)
            if isinstance(self.extrapolation, Mapping)
            else self.extrapolation
        )
        return (said.below, said.above) if isinstance(said, BelowAbove) else (said, said)


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """The choices of a MAPMORE model of one `target` (M2 section 4.4 has the paper's).

    - `dictionary`: candidate terms as text, in scaled coordinates.
    - `cuts`: segmentation of each segmented variable.
    - `level`: quantity whose curves are interpolated; None pools all curves into one. It is
      constant within a curve, or the pressure of
      step responses, whose curves stand at the pressure of their plateau (M2 figure 3h).
    - `bounds`: least and greatest coefficient of terms, in the target's unit, by their text.
    - `pooled`: quantity whose levels the curves have, where they are pooled into one surface all
      the same.
    """

    target: str
    dictionary: tuple[str, ...]
    cuts: Mapping[str, Cut] = field(default_factory=dict)
    level: str | None = None
    pooled: str | None = None
    fit: Fit = field(default_factory=Fit)
    fuse: Fuse = field(default_factory=Fuse)
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
