"""The ticks of an axis, their numbers and its label as one artist.

A tick of Matplotlib's own is three lines and two texts, of which a figure shows one each at most. To make them, to lay them out and to draw
them took more than half the time of a page. Here the marks of an axis are one line, and its numbers are one text, set and drawn for each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.artist import Artist
from matplotlib.axis import Axis, XAxis, YAxis
from matplotlib.backend_bases import RendererBase
from matplotlib.lines import Line2D
from matplotlib.markers import TICKDOWN, TICKLEFT, MarkerStyle
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator
from matplotlib.transforms import Bbox, ScaledTranslation

from mapmore_cli.domain.arrays import Array, BoolArray

POINTS = 72
"""Points an inch. Figures are measured with as many dots an inch, so that lengths are points."""

ROUNDING = 1e-10
"""Share of an axis by which a tick may lie beyond its end."""


def _look(axis: XAxis | YAxis, what: str) -> Any:
    """How ticks look on axes of this direction: a value of the style."""
    settings: Any = rcParams
    return settings[f"{axis.axis_name}tick.{what}"]


def name_ticks(axis: Axis, places: Sequence[float], names: Sequence[str]) -> None:
    """Ticks at these places with these names, in place of numbers."""
    axis.set_major_locator(FixedLocator(places))
    axis.set_major_formatter(FixedFormatter(names))


class Ticks(Artist):
    """What stands below some axes or at their left, drawn in place of the axis, which goes on to say where ticks are and what they say.

    Numbers stand at major ticks alone. Of `tick_params`, `length`, `labelbottom` and `labelleft` are obeyed.

    Attributes
    ----------
    axis
        The x or the y axis.
    below
        Whether it is the x axis.
    length
        Of a major tick, points.
    """

    def __init__(self, axis: XAxis | YAxis) -> None:
        super().__init__()
        self.axis, self.below = axis, axis.axis_name == "x"
        ax, own = axis.axes, dict[str, Any](axis.get_tick_params())
        self.length = float(own.get("length", _look(axis, "major.size")))
        self._numbered = bool(own.get("labelbottom" if self.below else "labelleft", True))
        self._numbers: list[tuple[float, str]] = []
        self._marks = self._line("major", self.length)
        self._minor = None if isinstance(axis.get_minor_locator(), NullLocator) else self._line("minor", _look(axis, "minor.size"))
        place = ax.get_xaxis_text1_transform if self.below else ax.get_yaxis_text1_transform
        transform, upright, sideways = place(self.length + _look(axis, "major.pad"))
        size, colour = _look(axis, "labelsize"), _look(axis, "color")
        self._number = Text(va=upright, ha=sideways, transform=transform, fontsize=size, color=colour)
        self._number.set_figure(ax.figure)
        self.set(clip_on=False, zorder=axis.get_zorder())
        ax.add_artist(self)
        axis.set_visible(False)

    def _line(self, which: str, length: float) -> Line2D:
        """A mark at each of some ticks."""
        ax, marker = self.axis.axes, MarkerStyle(TICKDOWN if self.below else TICKLEFT)
        transform = ax.get_xaxis_transform() if self.below else ax.get_yaxis_transform()
        width, colour = _look(self.axis, f"{which}.width"), _look(self.axis, "color")
        marks = Line2D([], [], linestyle="none", marker=marker, markersize=length, markeredgewidth=width, color=colour)
        marks.set(transform=transform, figure=ax.figure)
        return marks

    def decide(self) -> None:
        """Choose the ticks for the size and the range that the axes have now."""
        places, formatter = self.axis.get_majorticklocs(), self.axis.get_major_formatter()
        shown = self._shown(places)
        numbers = formatter.format_ticks(places.tolist()) if self._numbered else [""] * len(places)
        self._numbers = [(float(places[i]), numbers[i]) for i in np.flatnonzero(shown) if numbers[i]]
        self.axis.get_offset_text().set_text(formatter.get_offset() if self._numbered else "")
        self._marks.set_data(*self._at(places[shown]))
        if self._minor is not None:
            between = self.axis.get_minorticklocs()
            self._minor.set_data(*self._at(between[self._shown(between)]))

    def measured(self, renderer: RendererBase) -> Bbox:
        """What the axes cover with these numbers, in dots; their factor is put above the axis, or at its right end below the numbers."""
        factor, ax = self.axis.get_offset_text(), self.axis.axes
        inner = ax.get_window_extent()
        outer = Bbox.union([inner, *(number.get_window_extent(renderer) for number in self._each_number())])
        if factor.get_text():
            away = outer.y0 - inner.y0 - self.axis.OFFSETTEXTPAD if self.below else self.axis.OFFSETTEXTPAD
            transform = ax.transAxes + ScaledTranslation(0.0, away / POINTS, ax.figure.dpi_scale_trans)
            factor.set(transform=transform, position=(1.0, 0.0) if self.below else (0.0, 1.0))
        return outer

    def _shown(self, places: Array) -> BoolArray:
        """Which places lie on the axis."""
        transform = self.axis.get_transform()
        low, high = sorted(transform.transform(self.axis.get_view_interval()))
        at, beyond = transform.transform(places), ROUNDING * (high - low)
        shown: BoolArray = (low - beyond <= at) & (at <= high + beyond)
        return shown

    def _at(self, along: Array) -> tuple[Array, Array]:
        across = np.zeros(len(along))
        return (along, across) if self.below else (across, along)

    def _each_number(self) -> Iterator[Text]:
        """The text, as it is for one number after the other."""
        for place, words in self._numbers:
            self._number.set_text(words)
            self._number.set_position((place, 0.0) if self.below else (0.0, place))
            yield self._number

    def get_window_extent(self, renderer: RendererBase | None = None) -> Bbox:
        """What numbers, factor and label cover, in dots."""
        texts = [text for text in (self.axis.get_offset_text(), self.axis.get_label()) if text.get_text()]
        boxes = [text.get_window_extent(renderer) for text in chain(texts, self._each_number())]
        return Bbox.union(boxes) if boxes else Bbox.null()

    def draw(self, renderer: RendererBase) -> None:
        """Draw the marks, the numbers, their factor and the label."""
        for marks in (self._marks, self._minor):
            if marks is not None:
                marks.draw(renderer)
        for number in self._each_number():
            number.draw(renderer)
        self.axis.get_offset_text().draw(renderer)
        self.axis.get_label().draw(renderer)
        self.stale = False
