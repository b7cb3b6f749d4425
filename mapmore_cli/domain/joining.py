"""How segment functions are joined (M2 eq 9-12), for the spec and the stored model."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

from annotated_types import Interval

from mapmore_cli.domain.arrays import Number
from mapmore_cli.domain.declared import Beyond, QuantityName, Settings

Side = Beyond | Number
"""Behaviour beyond one limit: `continue`, `continue_linear`, `saturate`, `zero`, or a value (M2 eq
12).
"""


class Transition(NamedTuple):
    """Course of a weight over a transition zone (M2 figure 5).

    - `words`: what is said of it, as `w = 3*t^2 - 2*t^3`.
    - `s`: s(t) for t in [0, 1], of the arithmetic that branches by `where` and of t; from 0 to 1,
      and `s(t) + s(1 - t) = 1`.
    """

    words: str
    s: Callable[[Any, Any], Any]


TRANSITIONS: Mapping[str, Transition] = {
    "linear": Transition("w = t", lambda _m, t: t),
    "quadratic": Transition(
        "w = 2*t^2 up to t = 1/2, then 1 - 2*(1 - t)^2",
        lambda m, t: m.where(t < 0.5, 2 * t**2, 1 - 2 * (1 - t) ** 2),
    ),
    "cubic": Transition("w = 3*t^2 - 2*t^3", lambda _m, t: 3 * t**2 - 2 * t**3),
}
"""Every transition by its name in a spec; a further one is a further row."""


@dataclass(frozen=True, kw_only=True)
class Joining(Settings):
    """How segment functions are joined, as the spec says it and the model keeps it (M2 eq 9-11).

    - `transition`: course of a weight over a transition zone (M2 figure 5), as `cubic`
    - `z_s`: how far a transition zone reaches to each side of a boundary, as a fraction of the
      segment, as `0.25`
    - `levels`: interpolation between curves: by triangles (`linear`), or keeping their shape
      (`pchip`), as `pchip`
    - `hold`: whether a segment function is held beyond its `samples` by more than `z_s` of their
      width; `none` is M2 eq 9-11, as `none`
    """

    transition: Annotated[
        Literal[tuple(TRANSITIONS)],  # type: ignore[valid-type]
        " or ".join(", ".join(f"`{name}`" for name in TRANSITIONS).rsplit(", ", 1)),
    ] = "linear"
    z_s: Annotated[
        float,
        Interval(ge=0, le=0.5),
        "half-width of a transition zone, as a fraction of the segment",
    ] = 0.25
    levels: Annotated[
        Literal["linear", "pchip"], "interpolation between curves, `linear` or `pchip`"
    ] = "linear"
    hold: Annotated[
        Literal["samples", "none"],
        "`samples` where segment functions are held beyond theirs, or `none`",
    ] = "samples"


@dataclass(frozen=True, kw_only=True)
class Fusion(Joining):
    """How the pieces are joined (M2 eq 9-12).

    `hold: samples` holds a segment function beyond its samples by more than `z_s` of their width,
    as far as transition zones reach there; `none` leaves it as it is (M2 eq 9-11 to the letter).

    `shrink` is the share g of the pieces on a backbone that is carried to the middle between two
    levels: `g + (1 - g)(1 - 2t)^2` at the place t between them.
    """

    extrapolation: Annotated[
        Mapping[QuantityName, tuple[Side, Side]],
        "behaviour below and above the limits of each input: a word, or the value it takes",
    ]
    shrink: Annotated[
        Number, "share of the pieces on a backbone that is carried to the middle between two levels"
    ] = 1.0
