"""Define the rules for joining segment functions (M2 eq 9-12): the keys of the section `fuse` of a
spec, and the rules that a model stores.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

from annotated_types import Interval

from mapmore_cli.domain.arrays import Number
from mapmore_cli.domain.declared import Beyond, QuantityName, Settings

Side = Beyond | Number
"""Behaviour outside one limit: `continue`, `continue_linear`, `saturate`, `zero`, or a value (M2 eq
12).
"""


class Transition(NamedTuple):
    """Rise of the weight of a segment function from 0 to 1 over a transition zone (M2 figure 5).

    - `words`: formula of the weight as text, for example `w = 3*t^2 - 2*t^3`.
    - `s`: function that returns the weight. Its second argument t runs from 0 to 1 over the zone,
      and `s(m, t) + s(m, 1 - t) = 1`. Its first argument `m` is the object with which equations are
      built; the function uses `m.where` instead of `if`.
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
"""Transitions by the name that a spec uses. To add a transition, add a row."""


@dataclass(frozen=True, kw_only=True)
class Joining(Settings):
    """Rules for joining segment functions, in the spec and in the model (M2 eq 9-11).

    - `transition`: How the weight of a segment function rises over a transition zone (M2 figure 5).
      With `linear`, the slope of the output jumps at the ends of the zone; with the other two, it
      is continuous. Example: `cubic`
    - `z_s`: Distance by which a transition zone reaches into each of two neighbouring segments, as
      a fraction of the width of this segment. A wider zone is smoother, but mixes the functions
      over a larger range. Example: `0.25`
    - `levels`: Interpolation between the curves of two levels: by straight lines (`linear`), or by
      a smooth curve that keeps the shape of the values (`pchip`). Example: `pchip`
    - `hold`: With `samples`, a segment function goes on outside its samples for `z_s` times the
      width of their range, and is constant beyond. With `none`, it goes on without a limit, as in
      M2 eq 9-11. Example: `none`
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
        "`samples` if segment functions are held outside their samples, or `none`",
    ] = "samples"


@dataclass(frozen=True, kw_only=True)
class Fusion(Joining):
    """Rules for joining segment functions that a model stores (M2 eq 9-12).

    With `hold: samples`, a segment function continues outside the range of its samples by `z_s`
    times the width of this range. Farther outside, it is constant. With `hold: none`, it continues
    without a limit, exactly as in M2 eq 9-11.

    `shrink` is a factor g for pieces that are added to a backbone: midway between two levels, they
    are multiplied by g. At the fraction t of the distance between the levels, they are multiplied
    by `g + (1 - g)(1 - 2t)^2`.
    """

    extrapolation: Annotated[
        Mapping[QuantityName, tuple[Side, Side]],
        "behaviour below and above the limits of each input: a word, or the value it takes",
    ]
    shrink: Annotated[Number, "factor of the pieces on a backbone midway between two levels"] = 1.0
