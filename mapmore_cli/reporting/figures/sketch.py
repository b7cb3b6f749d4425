"""Record drawing calls on axes and write them as SVG, without Matplotlib.

Matplotlib takes most of the processor time of a run for the figures of its page. `Sketch`
implements the methods of its axes that the figures of this package call. Other calls raise
AttributeError or TypeError, and Matplotlib then draws the figure. Lengths are in points, positions
are data.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, Literal, TypeGuard

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.reporting.figures.colours import colour_at, hex_of

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

MARGINS = {"x": 0.02, "y": 0.05}
"""Fraction of the data's range by which an axis is longer at each end."""

Side = Literal["x", "y"]
Svg = Callable[[Callable[[Any], Array], Callable[[Any], Array]], str]
"""Function that returns the element of a mark, from the functions that convert data to points."""


@dataclass
class Axis:
    """One axis: the range of its data, its length, and its ticks."""

    margin: float
    low: float = math.inf
    high: float = -math.inf
    limits: tuple[float, float] | None = None
    logarithmic: bool = False
    subs: Sequence[float] = (1.0,)
    most: int = 5
    ticks: dict[float, str] | None = None

    def hold(self, values: Any) -> None:
        """Extend the range to contain values."""
        finite = np.asarray(values, dtype=np.float64)
        finite = finite[np.isfinite(finite) & ((finite > 0) | (not self.logarithmic))]
        if finite.size:
            self.low = min(self.low, float(finite.min()))
            self.high = max(self.high, float(finite.max()))

    @property
    def ends(self) -> tuple[float, float]:
        """Start and end of the axis."""
        if self.limits is not None:
            return self.limits
        if not self.low <= self.high:
            return 0.0, 1.0
        if self.logarithmic:
            margin = (self.high / self.low) ** self.margin if self.high > self.low else 2.0
            return self.low / margin, self.high * margin
        margin = self.margin * (self.high - self.low) or 0.05 * abs(self.low) or 1.0
        return self.low - margin, self.high + margin

    def scale(self, start: float, stop: float) -> Callable[[Any], Array]:
        """Return a function that converts values to points between two positions of the sheet."""
        low, high = self.ends

        def place(values: Any) -> Array:
            values = np.asarray(values, dtype=np.float64)
            if self.logarithmic:
                values, ends = np.log(np.maximum(values, 1e-300)), (math.log(low), math.log(high))
            else:
                ends = (low, high)
            shares: Array = (values - ends[0]) / (ends[1] - ends[0])
            return start + shares * (stop - start)

        return place

    def labels(self) -> dict[float, str]:
        """Return the ticks within the axis, each with its label."""
        low, high = sorted(self.ends)
        if self.ticks is not None:
            return {at: words for at, words in self.ticks.items() if low <= at <= high}
        if self.logarithmic:
            powers = 10.0 ** np.arange(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
            every = sorted(power * sub for power in powers for sub in self.subs)
            return {at: f"{at:g}" for at in every if low <= at <= high}
        ticks = nice_ticks(low, high, self.most)
        step = ticks[1] - ticks[0] if len(ticks) > 1 else 1.0
        digits = max(0, -math.floor(math.log10(step) + 1e-9) + (f"{step:e}"[2] == "5"))
        if digits > 5 or max(map(abs, ticks), default=0) >= 1e6:
            return {at: f"{at:g}" for at in ticks}
        return {at: f"{at:.{digits}f}".replace("-", "\N{MINUS SIGN}") for at in ticks}


def nice_ticks(low: float, high: float, most: int) -> list[float]:
    """Return at most `most` + 1 multiples of 1, 2, 2.5 or 5 times a power of ten within a range."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return [low]
    power = 10.0 ** math.floor(math.log10(span / most))
    step = next(step for step in (1, 2, 2.5, 5, 10, 20) if span / (step * power) <= most) * power
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [number * step for number in range(first, last + 1)]


def levels_of(low: float, high: float, most: int) -> list[float]:
    """Return round numbers at even distances, about `most`, which extend just outside a range."""
    ticks = nice_ticks(low, high, most)
    step = ticks[1] - ticks[0] if len(ticks) > 1 else (high - low) or 1.0
    before = [ticks[0] - step] if ticks[0] > low else []
    return [*before, *ticks, *([ticks[-1] + step] if ticks[-1] < high else [])]


@dataclass
class Sketch:
    """Axes with the methods of Matplotlib's `Axes`. `size` is the size of letters on ticks, `right`
    the space to the right, and `share` the relative height in the panel.
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
    def transAxes(self) -> str:  # noqa: N802  # as Matplotlib calls it
        """Name of the coordinates that are fractions of the axes."""
        return "axes"

    @property
    def figure(self) -> Sketch:
        """The sketch itself, which also draws colour bars."""
        return self

    def _add(self, svg: Svg, zorder: float, label: str = "", **look: Any) -> None:
        self.marks.append((zorder, svg))
        if label and not label.startswith("_"):
            self.keys.setdefault(label, look)

    # What is drawn
    # ----------------------------------------------------------------------------------------------

    def plot(self, *args: Any, scales: bool = True, zorder: float = 2.0, **look: Any) -> None:
        """Draw a line, dots or both. The axes do not grow unless it `scales`."""
        values = [np.asarray(one, dtype=np.float64) for one in args if not isinstance(one, str)]
        marker = next((one for one in args if isinstance(one, str) and one in SHAPES), None)
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

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            return line_svg(across(x), up(y), look)

        self._add(svg, zorder, label, **look)

    def fill_between(
        self,
        x: Array,
        low: Any,
        high: Any,
        *,
        color: Any,
        alpha: float = 1.0,
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

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            outlines = "".join(
                f"{path(across([*x[run], *x[run][::-1]]), up([*low[run], *high[run][::-1]]))}Z"
                for run in runs
                if len(run)
            )
            return f'<path d="{outlines}" fill="{hex_of(color)}" fill-opacity="{alpha:g}"/>'

        self._add(svg, look.get("zorder", 1.0), label, facecolor=color, alpha=alpha)

    def axvspan(self, low: float, high: float, *, color: Any, **look: Any) -> None:
        """Shade from the bottom to the top."""
        self.xaxis.hold([low, high])

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            left, right = across([low, high])
            ends = up(self.yaxis.ends)
            return box(left, ends.min(), right, ends.max(), f'fill="{hex_of(color)}"')

        self._add(svg, look.get("zorder", 1.0), look.get("label", ""), facecolor=color)

    def axhline(self, at: float, **look: Any) -> None:
        """Draw a line from the left to the right."""
        self._through(self.yaxis, at, look)

    def axvline(self, at: float, **look: Any) -> None:
        """Draw a line from the bottom to the top."""
        self._through(self.xaxis, at, look)

    def _through(self, axis: Axis, at: float, look: dict[str, Any]) -> None:
        axis.hold(at)

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            if axis is self.yaxis:
                return line_svg(across(self.xaxis.ends), up([at, at]), look)
            return line_svg(across([at, at]), up(self.yaxis.ends), look)

        self._add(svg, look.get("zorder", 2.0))

    def vlines(self, x: Array, low: float, high: Array, **look: Any) -> None:
        """Draw stems from `low` to `high`."""
        gaps = np.full(len(x), np.nan)
        stems = np.column_stack([np.full(len(x), low), high, gaps]).ravel()
        self.plot(np.repeat(x, 3), stems, **look)

    def barh(self, at: float, width: float, height: float, **look: Any) -> None:
        """Draw a bar to the right from zero."""
        self.xaxis.hold([0.0, width])
        self.yaxis.hold([at - height / 2, at + height / 2])

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
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
        edgecolors: str = "none",
        linewidths: float = 0.3,
    ) -> Shades:
        """Draw dots coloured by values."""
        self.xaxis.hold(x)
        self.yaxis.hold(y)
        shades, radius = Shades(cmap, np.linspace(vmin, vmax, 65)), math.sqrt(area) / 2
        colours, rim = shades.of(values), "" if edgecolors == "none" else hex_of(edgecolors)

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            circles = "".join(
                f'<circle cx="{left:.1f}" cy="{top:.1f}" r="{radius:.2g}" fill="{colour}"/>'
                for left, top, colour in zip(across(x), up(y), colours, strict=True)
            )
            stroke = f' stroke="{rim}" stroke-width="{linewidths:g}"' if rim else ""
            return f'<g class="map"{stroke}>{circles}</g>'

        self._add(svg, 3.0)
        return shades

    def contourf(self, x: Array, y: Array, z: Array, *, levels: Array, cmap: str) -> Shades:
        """Fill the cells around the points of a grid, (m, n) each, by the band that contains
        `z`.
        """
        self.xaxis.hold(x)
        self.yaxis.hold(y)
        shades, across_of, up_of = Shades(cmap, levels), x[0], y[:, 0]
        half_x, half_y = ((one[1] - one[0]) / 2 for one in (across_of, up_of))

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            boxes = []
            for row, height in zip(z, up_of, strict=True):
                top, bottom = up([height + half_y, height - half_y])
                colours = [*shades.of(row)]
                starts = [0, *(i for i in range(1, len(row)) if colours[i] != colours[i - 1])]
                for start, stop in zip(starts, [*starts[1:], len(row)], strict=True):
                    if colours[start]:
                        ends = (across_of[start] - half_x, across_of[stop - 1] + half_x)
                        left, right = across(ends)
                        boxes.append(box(left, top, right, bottom, f'fill="{colours[start]}"'))
            return f'<g class="map" shape-rendering="crispEdges">{"".join(boxes)}</g>'

        self._add(svg, 0.0)
        return shades

    def colorbar(self, shades: Shades, *, label: str, **_look: Any) -> None:
        """Draw a colour bar at the right of these axes."""
        axis = Axis(0.0, limits=(float(shades.levels[0]), float(shades.levels[-1])), most=6)
        room = max(map(len, axis.labels().values()), default=0) * 0.55 * self.size
        self.right = 14 + room + 2 * self.size

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
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

    def text(self, x: float, y: float, words: str, *, ha: str, va: str, **_look: Any) -> None:
        """Write a text at fractions of the axes."""

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            (start, stop), (bottom, end) = across(self.xaxis.ends), up(self.yaxis.ends)
            left, top = start + x * (stop - start), bottom + y * (end - bottom)
            below = self.size * {"top": 0.8, "center": 0.35}.get(va, 0.0)
            return text(words, left, top + below, self.size, ANCHORS[ha])

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
        """Write a text at an offset in points from a place, whose first coordinate may be a
        fraction of the axes.
        """
        share = xycoords[0] != "data"
        if share:
            self.right = max(self.right, offset[0] + 0.55 * self.size * len(words))

        def svg(across: Callable[[Any], Array], up: Callable[[Any], Array]) -> str:
            ends = across(self.xaxis.ends)
            left = ends[0] + place[0] * (ends[1] - ends[0]) if share else float(across(place[0]))
            below = self.size * {"top": 0.8, "center": 0.35}.get(va, 0.0)
            top = float(up(place[1])) - offset[1] + below
            return text(words, left + offset[0], top, self.size, ANCHORS[ha])

        self.beside.append((0.0, svg))

    # Length of the axes

    def get_xlim(self) -> tuple[float, float]:
        """Return the ends of the horizontal axis."""
        return self.xaxis.ends

    def set_xlim(self, left: float | None = None, right: float | None = None) -> None:
        """Set one end of the horizontal axis, or both."""
        _set_ends(self.xaxis, left, right)

    def set_ylim(self, bottom: float | None = None, top: float | None = None) -> None:
        """Set one end of the vertical axis, or both."""
        _set_ends(self.yaxis, bottom, top)

    def set_xticks(self, at: Iterable[float], names: Sequence[str] | None = None) -> None:
        """Set where the ticks of the horizontal axis are, and their names."""
        _set_ticks(self.xaxis, at, names)

    def set_yticks(self, at: Iterable[float], names: Sequence[str] | None = None) -> None:
        """Set where the ticks of the vertical axis are, and their names."""
        _set_ticks(self.yaxis, at, names)

    def tick_params(self, axis: Side, length: float) -> None:
        """Accept the length of ticks, which are always short here."""


def is_sketch(ax: object) -> TypeGuard[Sketch]:
    """Return True for axes of a quick drawing, False for Matplotlib's."""
    return isinstance(ax, Sketch)


@dataclass(frozen=True)
class Shades:
    """Colours of the bands between levels, (n,), from a map."""

    cmap: str
    levels: Array

    def of(self, values: Any) -> list[str]:
        """Return the colours of values; an empty text for NaN."""
        bands = len(self.levels) - 1
        places = np.clip(np.searchsorted(self.levels, values, side="right") - 1, 0, bands - 1)
        shares = places / max(bands - 1, 1)
        known = np.isfinite(values)
        return [
            colour_at(self.cmap, share) if finite else ""
            for share, finite in zip(shares, known, strict=True)
        ]


ANCHORS = {"left": "start", "center": "middle", "right": "end"}


def _set_ends(axis: Axis, low: float | None, high: float | None) -> None:
    known = axis.ends
    axis.limits = (known[0] if low is None else low, known[1] if high is None else high)


def _set_ticks(axis: Axis, at: Iterable[float], names: Sequence[str] | None) -> None:
    places = [float(one) for one in at]
    words = [f"{one:g}" for one in places] if names is None else names
    axis.hold(places)
    axis.ticks = dict(zip(places, words, strict=True))


# Elements of SVG
# --------------------------------------------------------------------------------------------------


def path(x: Array, y: Array) -> str:
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
    """Return a line, its markers, or both."""
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
    """Return a marker at each place."""
    radius, shape = look.get("markersize", 6) / 2, SHAPES[marker]
    filled = hex_of(look.get("markerfacecolor", colour))
    edge = look.get("markeredgewidth", 1.0)
    stroke = f' stroke="{colour}" stroke-width="{edge:g}"' if edge else ""
    places = [
        (left, top)
        for left, top in zip(x.tolist(), y.tolist(), strict=True)
        if math.isfinite(left) and math.isfinite(top)
    ]
    if not (shape or stroke):  # a single path whose round line ends are the points
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
    """Return a rectangle."""
    size = f'width="{right - left:.2f}" height="{bottom - top:.2f}"'
    return f'<rect x="{left:.2f}" y="{top:.2f}" {size} {look}/>'


def face(look: dict[str, Any]) -> str:
    """Return the appearance of a bar's face; a hatched one is pale."""
    edge = hex_of(look["edgecolor"])
    inside = look["facecolor"] if look["hatch"] is None else look["edgecolor"]
    opacity = "" if look["hatch"] is None else ' fill-opacity=".18"'
    return f'fill="{hex_of(inside)}"{opacity} stroke="{edge}" stroke-width=".8"'


def text(
    words: str, x: float, y: float, size: float, anchor: str = "start", turned: bool = False
) -> str:
    """Return words at a position, each of their lines; if `turned`, they run upwards."""
    turn = f' transform="rotate(-90 {x:.1f} {y:.1f})"' if turned else ""
    lines = xml_text(words).split("\n")
    first = y - (len(lines) - 1) * size * 1.15 if turned else y
    spans = "".join(
        f'<tspan x="{x:.1f}" y="{first + row * size * 1.15:.1f}">{escape(line)}</tspan>'
        for row, line in enumerate(lines)
    )
    ends = "" if anchor == "start" else f' text-anchor="{anchor}"'
    return f'<text font-size="{size:g}"{ends}{turn}>{spans}</text>'
