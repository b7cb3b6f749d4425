"""The `fuse` section: how pieces are joined."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.spec.fields import Keyed, Number, OfKey, Section, Text, by_shape

ExtrapolationWord = Literal["continue", "continue_linear", "saturate", "zero"]
"""What happens beyond a limit (M2 eq 12)."""
WordOrValue = Annotated[Annotated[ExtrapolationWord, Text] | Annotated[OfKey, Number], by_shape]


class BelowAbove(Section):
    """Extrapolation of one variable on each side: a word, or the value that the variable takes (M2 eq 12)."""

    below: WordOrValue | None = None
    above: WordOrValue | None = None


Sides = Annotated[Annotated[ExtrapolationWord, Text] | Annotated[BelowAbove, Keyed], by_shape]


class Fuse(Section):
    """How pieces are joined (M2 eq 9-12).

    Transition zones reach `z_s` of a segment's width to each side of a boundary. Between levels, curves are interpolated by triangles
    (`levels: linear`) or keeping their shape (`pchip`), and with `align: threshold` between places that lie alike relative to their
    thresholds. `shrink` is the share of the residual on a backbone that is carried to the middle between two levels: `auto` asks left-out
    training levels, 1 carries all of it, 0 leaves the backbone alone there. `extrapolation` is a word for all variables, or a mapping from
    variable to word or `{below, above}`; without it, `continue` for one-term fits, else `saturate`.
    """

    transition: Literal["linear", "quadratic", "cubic"] = "linear"
    z_s: Annotated[float, Field(ge=0, le=0.5)] = 0.25
    levels: Literal["linear", "pchip"] = "linear"
    align: Literal["none", "threshold"] = "none"
    shrink: Annotated[Annotated[Literal["auto"], Text] | Annotated[Annotated[float, Field(ge=0, le=1)], Number], by_shape] = "auto"
    extrapolation: Annotated[Annotated[ExtrapolationWord, Text] | Annotated[dict[str, Sides], Keyed], by_shape] | None = None
