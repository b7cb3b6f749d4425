"""Record drawing calls on axes, and write them as SVG without Matplotlib.

Matplotlib would take most of the processor time of a run to draw the figures of the page. The class
`Sketch` therefore has those methods of Matplotlib's `Axes` that the figures of this package call.
All other calls raise AttributeError or TypeError; the figure is then drawn by Matplotlib. Lengths
are in points, and positions are in the units of the data.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeGuard

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.reporting.figures.axis import Axis, Place
from mapmore_cli.reporting.figures.colours import Shades, hex_of
from mapmore_cli.reporting.figures.contours import outlines_above
from mapmore_cli.reporting.figures.elements import (
    ANCHORS,
    SHAPES,
    box,
    face,
    line_svg,
    path,
    text,
)

MARGINS = {"x": 0.02, "y": 0.05}
"""Fraction of the range of the data by which an axis extends beyond the data at each end."""

Side = Literal["x", "y"]
Svg = Callable[[Place, Place], str]
"""Function that returns the SVG element of one drawn object. Its two arguments are functions that
convert x and y from the units of the data to points.
"""


@dataclass
class Sketch:
    """Axes with methods of Matplotlib's `Axes`.

    - `size`: font size of the labels of ticks, points.
    - `marks`, `beside`: what is drawn inside the axes, and what may extend beyond them.
    - `keys`: appearance of each entry of the legend, by its label.
    - `right`: free space to the right of the axes, points.
    - `share`: height relative to the other axes of the panel.
    """

    size: float
    xaxis: Axis = field(default_factory=lambda: Axis(MARGINS["x"]))
    yaxis: Axis = field(default_factory=lambda: Axis(MARGINS["y"]))
    marks: list[tuple[float, Svg]] = field(default_factory=list)
    beside: list[tuple[float, Svg]] = field(default_factory=list)
    keys: dict[str, dict[str, Any]] = field(default_factory=dict)
    right: float = 0.0
    share: float = 1.0

    @property
    def figure(self) -> Sketch:
        """The sketch itself. Matplotlib draws a colour bar by a method of the figure to which the
        axes belong; here, the sketch has this method.
        """
        return self

    def _add(self, svg: Svg, zorder: float, label: str = "", **look: Any) -> None:
        self.marks.append((zorder, svg))
        if label and not label.startswith("_"):
            self.keys.setdefault(label, look)

    # What is drawn
    # ----------------------------------------------------------------------------------------------

    def plot(self, *args: Any, scales: bool = True, zorder: float = 2.0, **look: Any) -> None:
        """Draw a line, dots or both. The axes are extended to include all points only if `scales`
        is True.
        """
        values = [np.asarray(arg, dtype=np.float64) for arg in args if not isinstance(arg, str)]
        marker = next((arg for arg in args if isinstance(arg, str) and arg in SHAPES), None)
        if marker:
            look = {"marker": marker, "linestyle": "none"} | look
        elif isinstance(args[-1], str):
            look = {"linestyle": args[-1]} | look
        x, y = values if len(values) == 2 else (np.arange(len(values[0]), dtype=float), values[0])
        x, y = np.broadcast_arrays(np.atleast_1d(x), np.atleast_1d(y))
        if scales:
            self.xaxis.hold(x)
            self.yaxis.hold(y)
        look.pop("clip_on", None)
        label = look.pop("label", "")

        def svg(across: Place, up: Place) -> str:
            return line_svg(across(x), up(y), look)

        self._add(svg, zorder, label, **look)

    def fill_between(
        self,
        x: Array,
        low: Any,
        high: Any,
        *,
        color: Any,
        alpha: float,
        label: str = "",
        **look: Any,
    ) -> None:
        """Shade the area between two lines."""
        ends = (np.asarray(end, dtype=np.float64) for end in (low, high))
        low, high = (np.broadcast_to(end, x.shape) for end in ends)
        rows = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        self.xaxis.hold(x)
        self.yaxis.hold([low, high])

        def svg(across: Place, up: Place) -> str:
            outlines = "".join(
                f"{path(across([*x[run], *x[run][::-1]]), up([*low[run], *high[run][::-1]]))}Z"
                for run in runs
                if len(run)
            )
            return f'<path d="{outlines}" fill="{hex_of(color)}" fill-opacity="{alpha:g}"/>'

        self._add(svg, look.get("zorder", 1.0), label, facecolor=color, alpha=alpha)

    def axvspan(self, low: float, high: float, *, color: Any, **look: Any) -> None:
        """Shade a range of x from the bottom to the top of the axes."""
        self.xaxis.hold([low, high])

        def svg(across: Place, up: Place) -> str:
            left, right = across([low, high])
            ends = up(self.yaxis.ends)
            return box(left, ends.min(), right, ends.max(), f'fill="{hex_of(color)}"')

        self._add(svg, look.get("zorder", 1.0), look.get("label", ""), facecolor=color)

    def axhline(self, at: float, **look: Any) -> None:
        """Draw a horizontal line across the axes."""
        self._through(self.yaxis, at, look)

    def axvline(self, at: float, **look: Any) -> None:
        """Draw a vertical line across the axes."""
        self._through(self.xaxis, at, look)

    def _through(self, axis: Axis, at: float, look: dict[str, Any]) -> None:
        axis.hold(at)

        def svg(across: Place, up: Place) -> str:
            if axis is self.yaxis:
                return line_svg(across(self.xaxis.ends), up([at, at]), look)
            return line_svg(across([at, at]), up(self.yaxis.ends), look)

        self._add(svg, look.get("zorder", 2.0))

    def vlines(self, x: Array, low: float, high: Array, **look: Any) -> None:
        """Draw vertical lines from `low` to `high` at each `x`."""
        gaps = np.full(len(x), np.nan)
        stems = np.column_stack([np.full(len(x), low), high, gaps]).ravel()
        self.plot(np.repeat(x, 3), stems, **look)

    def barh(self, at: float, width: float, height: float, **look: Any) -> None:
        """Draw a horizontal bar that starts at zero."""
        self.xaxis.hold([0.0, width])
        self.yaxis.hold([at - height / 2, at + height / 2])

        def svg(across: Place, up: Place) -> str:
            (left, right), ends = across([0.0, width]), up([at - height / 2, at + height / 2])
            return box(left, ends.min(), right, ends.max(), face(look))

        self._add(svg, 1.0)

    def scatter(
        self,
        x: Array,
        y: Array,
        area: float,
        values: Array,
        *,
        cmap: str,
        vmin: float,
        vmax: float,
        edgecolors: str,
        linewidths: float,
    ) -> Shades:
        """Draw dots coloured by values."""
        self.xaxis.hold(x)
        self.yaxis.hold(y)
        shades, radius = Shades(cmap, np.linspace(vmin, vmax, 65)), math.sqrt(area) / 2
        colours, rim = shades.of(values), "" if edgecolors == "none" else hex_of(edgecolors)

        def svg(across: Place, up: Place) -> str:
            circles = "".join(
                f'<circle cx="{left:.1f}" cy="{top:.1f}" r="{radius:.2g}" fill="{colour}"/>'
                for left, top, colour in zip(across(x), up(y), colours, strict=True)
            )
            stroke = f' stroke="{rim}" stroke-width="{linewidths:g}"' if rim else ""
            return f'<g class="map"{stroke}>{circles}</g>'

        self._add(svg, 3.0)
        return shades

    def contourf(self, x: Array, y: Array, z: Array, *, levels: Array, cmap: str) -> Shades:
        """Fill the areas between neighbouring `levels` of `z`. `x`, `y` and `z`, (m, n) each, are
        given on a grid. All points in a row of the grid have the same `y`.
        """
        known = np.isfinite(z)
        self.xaxis.hold(x[known])
        self.yaxis.hold(y[known])
        shades, heights = Shades(cmap, levels), y[:, 0]

        def svg(across: Place, up: Place) -> str:
            bands = []
            for level, colour in zip(levels[:-1], shades.of(levels[:-1]), strict=True):
                outlines = "".join(
                    f"{path(across(at), up(height))}Z"
                    for at, height in outlines_above(x, heights, z, level)
                )
                if outlines:
                    bands.append(f'<path d="{outlines}" fill="{colour}"/>')
            return f'<g class="map">{"".join(bands)}</g>'

        self._add(svg, 0.0)
        return shades

    def colorbar(self, shades: Shades, *, label: str, **_look: Any) -> None:
        """Draw a colour bar at the right of these axes."""
        axis = Axis(0.0, limits=(float(shades.levels[0]), float(shades.levels[-1])), most=6)
        room = max(map(len, axis.labels().values()), default=0) * 0.55 * self.size
        self.right = 14 + room + 2 * self.size

        def svg(across: Place, up: Place) -> str:
            ends = up(self.yaxis.ends)
            place = axis.scale(ends.max(), ends.min())
            left = float(max(across(self.xaxis.ends))) + 8
            colours = shades.of((shades.levels[:-1] + shades.levels[1:]) / 2)
            edges = place(shades.levels)
            bars = [
                box(left, top, left + 8, bottom, f'fill="{colour}"')
                for bottom, top, colour in zip(edges[:-1], edges[1:], colours, strict=True)
            ]
            words = [
                text(words, left + 11, float(place(at)) + self.size * 0.35, self.size)
                for at, words in axis.labels().items()
            ]
            middle, at = float(np.mean(ends)), left + 14 + room + self.size
            name = text(label, at, middle, self.size, "middle", turned=True)
            return f'<g class="map">{"".join(bars)}</g>{"".join(words)}{name}'

        self.beside.append((0.0, svg))

    def annotate(
        self,
        words: str,
        place: tuple[Any, Any],
        offset: tuple[int, int],
        *,
        xycoords: tuple[str, str] = ("data", "data"),
        ha: str = "left",
        va: str = "baseline",
    ) -> None:
        """Write a text at an offset, in points, from a position. `xycoords` says for x and y
        whether the position is in the units of the data or in fractions of the axes. If the text
        begins at the right end of the axes, space is reserved for it.
        """
        shares = [coordinates != "data" for coordinates in xycoords]
        if shares[0] and place[0] == 1.0:
            self.right = max(self.right, offset[0] + 0.55 * self.size * len(words))

        def svg(across: Place, up: Place) -> str:
            points = []
            for axis, scale, at, share in zip(
                (self.xaxis, self.yaxis), (across, up), place, shares, strict=True
            ):
                start, stop = scale(axis.ends)
                points.append(start + at * (stop - start) if share else float(scale(at)))
            below = self.size * {"top": 0.8, "center": 0.35}.get(va, 0.0)
            top = points[1] - offset[1] + below
            return text(words, points[0] + offset[0], top, self.size, ANCHORS[ha])

        self.beside.append((0.0, svg))

    # Axis ranges

    def get_xlim(self) -> tuple[float, float]:
        """Return the ends of the horizontal axis."""
        return self.xaxis.ends

    def set_xlim(self, left: float | None = None, right: float | None = None) -> None:
        """Set one end of the horizontal axis, or both."""
        self.xaxis.set_ends(left, right)

    def set_ylim(self, bottom: float | None = None, top: float | None = None) -> None:
        """Set one end of the vertical axis, or both."""
        self.yaxis.set_ends(bottom, top)

    def set_xticks(self, at: Iterable[float], names: Sequence[str] | None = None) -> None:
        """Set the positions and the labels of the ticks of the horizontal axis."""
        self.xaxis.set_ticks(at, names)

    def set_yticks(self, at: Iterable[float], names: Sequence[str] | None = None) -> None:
        """Set the positions and the labels of the ticks of the vertical axis."""
        self.yaxis.set_ticks(at, names)

    def tick_params(self, axis: Side, length: float) -> None:
        """Do nothing: the length of ticks is always the same here. The method exists because `Axes`
        has it.
        """


def is_sketch(ax: object) -> TypeGuard[Sketch]:
    """Return True for a `Sketch`, and False for axes of Matplotlib."""
    return isinstance(ax, Sketch)
