"""Axes for small multiples: pairs of a high and a low panel, as many side by side as can be read."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mapmore_cli.reporting.figures.style import DOUBLE, SINGLE


@dataclass(frozen=True)
class Pair:
    """A panel with a lower one under it; `first` where it stands at the left of its row, and has the labels of the y axes."""

    top: Axes
    bottom: Axes
    first: bool


def columns_for(count: int) -> int:
    """How many panels to put side by side: up to three, without a nearly empty last row."""
    return 2 if count == 4 else min(count, 3)


def width_for(count: int) -> float:
    """Width of a figure of `count` panels, inches: one column of a journal page, or two."""
    return SINGLE if count == 1 else DOUBLE


def pairs(figure: Figure, count: int, heights: tuple[float, float], common_x: bool = True) -> Iterator[Pair]:
    """`count` pairs, the y axes common within a row and the x axes within a pair, or within all; their numbers stand below a pair."""
    columns = columns_for(count)
    rows = math.ceil(count / columns)
    axes = figure.subplots(2 * rows, columns, height_ratios=[*heights] * rows, sharex=common_x, sharey="row", squeeze=False)
    for number in range(rows * columns):
        row, column = divmod(number, columns)
        top, bottom = axes[2 * row, column], axes[2 * row + 1, column]
        if number >= count:
            top.remove()
            bottom.remove()
            continue
        if not common_x:
            bottom.sharex(top)
        top.tick_params(labelbottom=False)
        bottom.tick_params(labelbottom=True)
        bottom.locator_params(axis="x", nbins=5 if columns < 2 else 4)
        yield Pair(top, bottom, first=column == 0)


def label_pair(pair: Pair, x: str, top: str, bottom: str) -> None:
    """Label the lower x axis, and the y axes of a row's first pair."""
    pair.bottom.set_xlabel(x)
    if pair.first:
        pair.top.set_ylabel(top)
        pair.bottom.set_ylabel(bottom)
