"""Write elements of SVG as text: lines, markers, boxes and words. Lengths and positions are in
points.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.reporting.figures.colours import hex_of

DASHES = {"-": (), "--": (3.7, 1.6), "-.": (6.4, 1.6, 1, 1.6), ":": (1, 1.65)}
"""Lengths of dashes and gaps, in widths of their line."""

SHAPES = {
    "o": "",
    "s": "M-1-1H1V1H-1Z",
    "^": "M0-1 1 1H-1Z",
    "v": "M0 1 1-1H-1Z",
    "D": "M0-1.3 1.3 0 0 1.3-1.3 0Z",
    "x": "M-1-1 1 1M-1 1 1-1",
    "X": "M-1-1 1 1M-1 1 1-1",
    "P": "M-1 0H1M0-1V1",
}
"""Outlines of markers with a radius of one; a circle is an element of its own."""

ANCHORS = {"left": "start", "center": "middle", "right": "end"}


def path(x: Sequence[float] | Array, y: Sequence[float] | Array) -> str:
    """Return the data of a path through points, with a gap at NaN."""
    commands, gap = [], True
    for left, top in zip(np.asarray(x).tolist(), np.asarray(y).tolist(), strict=True):
        if math.isfinite(left) and math.isfinite(top):
            commands.append(f"{'M' if gap else 'L'}{left:.1f} {top:.1f}")
            gap = False
        else:
            gap = True
    return "".join(commands)


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
    """Return SVG elements that draw a marker at each place."""
    radius, shape = look.get("markersize", 6) / 2, SHAPES[marker]
    filled = hex_of(look.get("markerfacecolor", colour))
    edge = look.get("markeredgewidth", 1.0)
    stroke = f' stroke="{colour}" stroke-width="{edge:g}"' if edge else ""
    places = [
        (left, top)
        for left, top in zip(x.tolist(), y.tolist(), strict=True)
        if math.isfinite(left) and math.isfinite(top)
    ]
    if not (shape or stroke):  # dots without a shape are one path whose points have round ends
        dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in places)
        return (
            f'<path d="{dots}" stroke="{filled}" stroke-width="{2 * radius:g}" '
            'stroke-linecap="round"/>'
        )
    if not shape:
        one = "".join(f'<circle cx="{a:.1f}" cy="{b:.1f}" r="{radius:g}"/>' for a, b in places)
    else:
        one = "".join(
            f'<path transform="translate({a:.1f} {b:.1f})scale({radius:g})" d="{shape}"/>'
            for a, b in places
        )
        thin = edge or (0.6 if marker in "xXP" else 0.0)
        stroke = f' stroke="{colour}" stroke-width="{thin / radius:.2g}"' if thin else ""
    return f'<g fill="{filled}"{stroke}>{one}</g>'


def box(left: float, top: float, right: float, bottom: float, look: str) -> str:
    """Return the SVG element of a rectangle."""
    size = f'width="{right - left:.2f}" height="{bottom - top:.2f}"'
    return f'<rect x="{left:.2f}" y="{top:.2f}" {size} {look}/>'


def face(look: dict[str, Any]) -> str:
    """Return the SVG attributes of the face of a bar. A hatched bar gets a pale colour."""
    edge = hex_of(look["edgecolor"])
    inside = look["facecolor"] if look["hatch"] is None else look["edgecolor"]
    opacity = "" if look["hatch"] is None else ' fill-opacity=".18"'
    return f'fill="{hex_of(inside)}"{opacity} stroke="{edge}" stroke-width=".8"'


def text(
    words: str, x: float, y: float, size: float, anchor: str = "start", turned: bool = False
) -> str:
    """Return the SVG elements of a text at a position, one for each line. If `turned`, the text
    runs upwards.
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
