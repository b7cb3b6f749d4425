"""Where the panels of a figure stand: their labels are measured, and the panels share what is left of the page.

All panels are equally wide, and as high as their place in a stack says. Matplotlib's constrained layout comes to nearly the same, but has
every label measured some ten times and the figure drawn twice, which took most of the time of a report.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator
from matplotlib.transforms import Bbox

from mapmore_cli.reporting.figures.style import fonts_may_lack_glyphs

POINTS = 72
"""Points an inch. Figures have as many dots an inch, so that what is measured are points."""

RENDERER = RendererBase()
"""Measures letters; one for all figures, because Matplotlib remembers by renderer what it has measured."""

PAD = 3.0
"""Points around a panel with its labels, and around the legend."""

LEAST = 12.0
"""Points that a panel is wide and high even where its labels leave less."""

NEAR = 0.15
"""Change of a panel's size up to which its ticks stay those that were measured."""

Places = Mapping[tuple[int, int], Axes]
"""Axes by row and column."""


@dataclass(frozen=True)
class _Around:
    """Points that labels take around some axes; how far off the labels of the axes are; how far a factor above an axis lifts the title."""

    left: float
    right: float
    below: float
    above: float
    x_off: float = 0.0
    y_off: float = 0.0
    lift: float = 0.0


def arrange(figure: Figure, places: Places, heights: Sequence[float]) -> None:
    """Place the axes below the legend, in rows of these relative heights, and align the labels of each column."""
    with fonts_may_lack_glyphs():
        legends = sum(legend.get_window_extent(RENDERER).height + 2 * PAD for legend in figure.legends)
        size = _place(figure, places, heights, {at: _guessed(ax) for at, ax in places.items()}, legends)
        for _ in range(2):
            around = {at: _measured(ax) for at, ax in places.items()}
            before, size = size, _place(figure, places, heights, around, legends)
            if np.allclose(before, size, rtol=NEAR):
                break
    for (row, column), ax in places.items():
        stand_off = max(one.y_off for (_, other), one in around.items() if other == column)
        _hold(ax, around[row, column], stand_off)


def _guessed(ax: Axes) -> _Around:
    """What labels of the usual length take, so that ticks are measured on axes of nearly their last size."""
    numbers = [axis.get_tick_params().get(side, True) for axis, side in ((ax.xaxis, "labelbottom"), (ax.yaxis, "labelleft"))]
    below, left = (34.0 * bool(label) or 14.0 * shown for label, shown in zip((ax.get_xlabel(), ax.get_ylabel()), numbers, strict=True))
    return _Around(left, 6.0, below, 12.0 * bool(ax.get_title(loc="left")))


def _measured(ax: Axes) -> _Around:
    """What stands around the axes where they are."""
    inner = ax.get_window_extent()
    texts = [*ax.texts, *([legend] if (legend := ax.get_legend()) else [])]
    outer = Bbox.union([inner, ax.get_tightbbox(RENDERER, bbox_extra_artists=texts, for_layout_only=True) or inner])
    factor = ax.yaxis.get_offset_text()
    lift = factor.get_window_extent(RENDERER).y1 - inner.y1 if factor.get_text() and ax.get_title(loc="left") else 0.0
    return _Around(
        left=inner.x0 - outer.x0,
        right=outer.x1 - inner.x1,
        below=inner.y0 - outer.y0,
        above=outer.y1 - inner.y1 + lift,
        x_off=inner.y0 - ax.xaxis.label.get_position()[1] if ax.get_xlabel() else 0.0,
        y_off=inner.x0 - ax.yaxis.label.get_position()[0] if ax.get_ylabel() else 0.0,
        lift=lift,
    )


def _place(
    figure: Figure, places: Places, heights: Sequence[float], around: Mapping[tuple[int, int], _Around], legends: float
) -> tuple[float, float]:
    """Give every axes its place; the width of all, and the height of one of height 1, in points."""
    width, height = (float(inches) * POINTS for inches in figure.get_size_inches())
    rows, columns = range(len(heights)), range(1 + max(column for _, column in places))
    left, right = (
        np.array([max(getattr(one, side) for (_, at), one in around.items() if at == column) + PAD for column in columns])
        for side in ("left", "right")
    )
    above, below = (
        np.array([max(getattr(one, side) for (at, _), one in around.items() if at == row) + PAD for row in rows])
        for side in ("above", "below")
    )
    wide = max((width - left.sum() - right.sum()) / len(columns), LEAST)
    high = max((height - legends - above.sum() - below.sum()) / sum(heights), LEAST / min(heights))
    starts = np.concatenate([[0.0], np.cumsum(left + right + wide)])[:-1] + left
    ends = height - legends - np.concatenate([[0.0], np.cumsum(above + below + high * np.array(heights))])[:-1] - above
    for (row, column), ax in places.items():
        tall = high * heights[row]
        ax.set_position((starts[column] / width, (ends[row] - tall) / height, wide / width, tall / height))
    return wide, high


def _hold(ax: Axes, around: _Around, stand_off: float) -> None:
    """Keep the ticks and labels as they were measured, so that drawing need not measure them again."""
    inner = ax.get_window_extent()
    for axis in (ax.xaxis, ax.yaxis):
        _hold_ticks(axis)
    if ax.get_xlabel():
        ax.xaxis.set_label_coords(0.5, -around.x_off / inner.height)
    if ax.get_ylabel():
        ax.yaxis.set_label_coords(-stand_off / inner.width, 0.5)
    if around.lift:
        ax.set_title(ax.get_title(loc="left"), loc="left", y=1.0 + around.lift / inner.height)


def _hold_ticks(axis: Axis) -> None:
    if isinstance(axis.get_major_locator(), MaxNLocator):
        axis.set_major_locator(FixedLocator(axis.get_majorticklocs().tolist()))
