"""Write elements of SVG as text: lines, markers, boxes and words. Lengths and positions are in
points.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import lru_cache
from html import escape
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.reporting.figures.colours import hex_of

DASHES = {"-": (), "--": (3.7, 1.6), "-.": (6.4, 1.6, 1, 1.6), ":": (1, 1.65)}
"""Lengths of dashes and gaps, as multiples of the width of the line."""

CROSS = "-1,-1 1,1 nan,nan -1,1 1,-1"
SHAPES = {
    "o": "",
    "s": "-1,-1 1,-1 1,1 -1,1 -1,-1",
    "^": "0,-1 1,1 -1,1 0,-1",
    "v": "0,1 1,-1 -1,-1 0,1",
    "D": "0,-1.3 1.3,0 0,1.3 -1.3,0 0,-1.3",
    "x": CROSS,
    "X": CROSS,
    "P": "-1,0 1,0 nan,nan 0,-1 0,1",
}
"""Corners of markers with a radius of one. NaN separates strokes. A circle has no corners."""

ANCHORS = {"left": "start", "center": "middle", "right": "end"}


def path(x: Sequence[float] | Array, y: Sequence[float] | Array, dots: bool = False) -> str:
    """Return the attribute `d` of an SVG path: lines through points, with a gap at NaN. If `dots`
    is True, the path has a dot at each point instead of lines.

    Every point after the first is written as a step from the point before it, because a step takes
    half as many characters as a position. Rounding errors of steps do not add up, because positions
    are rounded to tenths of a point before steps are computed.
    """
    commands: list[str] = []
    before, gap = None, False
    for place in np.rint(10 * np.column_stack([x, y])).tolist():
        if not (math.isfinite(place[0]) and math.isfinite(place[1])):
            gap = True
        elif before is None:
            commands.append("M" + _step(*place))
            before, gap = place, False
        elif gap or dots or place != before:
            letter = "m" if gap or dots else "l"
            commands.append(letter + _step(place[0] - before[0], place[1] - before[1]))
            before, gap = place, False
    return "".join(f"{command}h0" for command in commands) if dots else "".join(commands)


def _step(across: float, up: float) -> str:
    """Return a step in x and y as text. Both arguments are in tenths of a point. A space separates
    the two numbers unless the second begins with a minus sign.
    """
    top = _tenths(up)
    return _tenths(across) + ("" if top.startswith("-") else " ") + top


@lru_cache(4096)  # most steps are short, so the same numbers occur often
def _tenths(count: float) -> str:
    """Return a number, given in tenths, as a decimal number without a zero before the point: 3 as
    `.3`.
    """
    return re.sub(r"^(-?)0\.", r"\1.", f"{count / 10 + 0.0:.1f}".removesuffix(".0"))


def line_svg(x: Array, y: Array, look: dict[str, Any]) -> str:
    """Return the SVG elements of a line, of its markers, or of both."""
    colour, style, width = (
        hex_of(look.get("color", "#000000")),
        look.get("linestyle", "-"),
        look.get("linewidth", 1.1),
    )
    parts = []
    if style != "none":
        lengths = DASHES[style] if isinstance(style, str) else style[1]
        dashes = " ".join(f"{length * width:.1f}" for length in lengths)
        stroke = f'stroke="{colour}" stroke-width="{width:g}"'
        stroke += f' stroke-dasharray="{dashes}"' if dashes else ""
        parts.append(f'<path d="{path(x, y)}" fill="none" {stroke}/>')
    if marker := look.get("marker"):
        parts.append(markers(x, y, marker, colour, look))
    return "".join(parts)


def markers(x: Array, y: Array, marker: str, colour: str, look: dict[str, Any]) -> str:
    """Return SVG elements that draw a marker at each point. Circles with an edge are separate
    elements; all other markers form a single path.
    """
    radius, shape = look.get("markersize", 6) / 2, SHAPES[marker]
    filled = hex_of(look.get("markerfacecolor", colour))
    edge = look.get("markeredgewidth", 1.0) or (0.6 if marker in "xXP" else 0.0)
    stroke = f' stroke="{colour}" stroke-width="{edge:g}"' if edge else ""
    places = np.column_stack([x, y])
    places = places[np.isfinite(places).all(axis=1)]
    if shape:
        corners = [corner.split(",") for corner in f"{shape} nan,nan".split()]
        outlines = places[:, None] + radius * np.array(corners, dtype=np.float64)
        return f'<path d="{path(*outlines.reshape(-1, 2).T)}" fill="{filled}"{stroke}/>'
    if not edge:  # a line of length zero with round ends is a dot; of equal dots, one is drawn
        left, top = np.unique(np.round(places, 1), axis=0).T
        return (
            f'<path d="{path(left, top, dots=True)}" stroke="{filled}" '
            f'stroke-width="{2 * radius:g}" stroke-linecap="round"/>'
        )
    circles = (f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{radius:g}"/>' for a, b in places.tolist())
    return f'<g fill="{filled}"{stroke}>{"".join(circles)}</g>'


def box(left: float, top: float, right: float, bottom: float, look: str) -> str:
    """Return the SVG element of a rectangle."""
    size = f'width="{right - left:.2f}" height="{bottom - top:.2f}"'
    return f'<rect x="{left:.2f}" y="{top:.2f}" {size} {look}/>'


def face(look: dict[str, Any]) -> str:
    """Return the SVG attributes with which a bar is filled and outlined. A hatched bar gets a pale
    colour.
    """
    edge = hex_of(look["edgecolor"])
    inside = look["facecolor"] if look["hatch"] is None else look["edgecolor"]
    opacity = "" if look["hatch"] is None else ' fill-opacity=".18"'
    return f'fill="{hex_of(inside)}"{opacity} stroke="{edge}" stroke-width=".8"'


def text(
    words: str, x: float, y: float, size: float, anchor: str = "start", turned: bool = False
) -> str:
    """Return the SVG element of a text at a position, with a part for each line of the text. If
    `turned` is True, the text runs upwards.
    """
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    lines = words.split("\n")
    first = y - (len(lines) - 1) * size * 1.15 if turned else y
    spans = "".join(
        f'<tspan x="{x:.1f}" y="{first + row * size * 1.15:.1f}">{escape(xml_text(line))}</tspan>'
        for row, line in enumerate(lines)
    )
    ends = "" if anchor == "start" else f' text-anchor="{anchor}"'
    return f'<text font-size="{size:g}"{ends}{turn}>{spans}</text>'
