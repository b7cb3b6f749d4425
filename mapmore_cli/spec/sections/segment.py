"""The `segment` section: how variables are cut."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from mapmore_cli.spec.fields import OfKey, Section, contradiction, of_sibling


class Cuts(Section):
    """How one variable is cut into segments.

    `even` needs `count`; `breakpoints` needs the inner boundaries, `at`; `gradient` puts `count - 1` boundaries where the slope of the
    target changes most, seen through a `window` (a tenth of each curve's range) and `separation` apart (the window); `optimal` puts them
    where the fits of the segments leave the least, on a `grid` of equal cells (20) with `min_samples` in each segment (10).
    """

    method: Literal["even", "breakpoints", "gradient", "optimal"]
    count: Annotated[int, Field(ge=1)] | None = None
    at: Annotated[list[OfKey], Field(min_length=1)] | None = None
    window: Annotated[OfKey, Field(gt=0)] | None = None
    separation: Annotated[OfKey, Field(gt=0)] | None = None
    grid: Annotated[int, Field(ge=1, le=200)] | None = None
    min_samples: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _whole(self) -> Cuts:
        needed = "at" if self.method == "breakpoints" else "count"
        if getattr(self, needed) is None:
            example = "count: 4" if needed == "count" else "at: [0.05, 0.1]"
            raise contradiction(f"method `{self.method}` needs `{needed}`", f"add it, as `{example}`", "method")
        useful = {"gradient": {"window", "separation"}, "optimal": {"grid", "min_samples"}}.get(self.method, set()) | {"method", needed}
        for other in type(self).model_fields:
            if other not in useful and getattr(self, other) is not None:
                raise contradiction(f"method `{self.method}` has no use for `{other}`", f"remove `{other}`", other)
        if self.at is not None and any(after <= before for before, after in pairwise(self.at)):
            raise contradiction("the breakpoints do not increase", f"write `at: {sorted(set(self.at))}`", "at")
        if self.method == "optimal" and self.count is not None and self.count > (self.grid or self.count):
            raise contradiction(
                f"{self.count} segments do not fit on a grid of {self.grid} cells", "raise `grid`, or lower `count`", "grid"
            )
        return self


class Directions(Section):
    """Segments for rise and fall: by the sign of the rate `of` a quantity, with a `dead_band` in which the last direction holds."""

    of: str
    dead_band: Annotated[float, Field(gt=0), of_sibling("of")]
