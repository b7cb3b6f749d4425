"""Draw the elements of panels (lines, dots, bands and labels), and write sentences that occur in
several captions.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.signals.sampling import envelope
from mapmore_cli.modelling.validation.intervals import INTERVAL, interval_limits
from mapmore_cli.reporting.figures.sketch import is_sketch
from mapmore_cli.reporting.figures.style import GREY, ModelStyle, model_styles
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import title_of

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

MOST_PANELS = 6
"""Largest number of panels of curves in one figure. If there are more curves, some are left out."""

DOTS = 200
POINTS, SKETCHED = 2000, 600
"""Largest number of dots for the samples of a curve; and largest number of points of a line over
time, in figures by Matplotlib (`POINTS`) and in a `Sketch` (`SKETCHED`). If there are more, some
are left out.
"""

STRETCHES = 150
"""Number of equal parts of the x axis for drawing a long line. If a part has more than four samples
on average, the mean and the range of the samples in each part are drawn.
"""

PALE = 0.15
DOT: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3}

# Lines and dots
# --------------------------------------------------------------------------------------------------


def draw_line(ax: Axes, x: Array, y: Array, sets_scale: bool = True, **look: Any) -> None:
    """Draw a line or dots. The axes are extended to include all points only if `sets_scale` is
    True.
    """
    if is_sketch(ax):
        ax.plot(x, y, scales=sets_scale, **look)
    elif sets_scale:
        ax.plot(x, y, **look)
    else:
        from matplotlib.lines import Line2D

        ax.add_artist(Line2D(x, y, **look))


def draw_dots(ax: Axes, x: Array, y: Array, most: int = DOTS, **look: object) -> None:
    """Draw samples as dots. If there are more than `most` samples, some are left out, but never the
    smallest and the largest `y`.
    """
    rows = cloud(y, most)
    draw_line(ax, x[rows], y[rows], **DOT | {"markeredgewidth": 0} | look)


def draw_trace(ax: Axes, x: Array, y: Array, **look: Any) -> None:
    """Draw a line over time. A long line is thinned so that its peaks remain."""
    rows = envelope(y, SKETCHED if is_sketch(ax) else POINTS)
    draw_line(ax, x[rows], y[rows], **look)


def draw_band(ax: Axes, x: Array, y: Array, **look: Any) -> None:
    """Draw `y` over sorted `x` as a line; if there are many samples, draw their mean as a line and
    their range as a pale band.
    """
    if len(x) > 4 * STRETCHES:
        x, y, low, high = band(x, y)
        shade_between(ax, x, (low, high), look["color"])
    draw_line(ax, x, y, **look)


def shade_between(
    ax: Axes, x: Array, ends: Iterable[Array], colour: object, label: str = ""
) -> None:
    """Shade the area between two curves, (n,) each, over x."""
    low, high = ends
    ax.fill_between(x, low, high, color=colour, alpha=PALE, linewidth=0, zorder=1, label=label)


def looks_of(inputs: ReportInputs) -> dict[str, ModelStyle]:
    """Return the appearance of every model, for figures that show all models. Models that other
    figures draw as lines come first, so that they look the same in all figures.
    """
    return model_styles([*inputs.lines, *inputs.models], inputs.style.palette)


def zero_line(ax: Axes) -> None:
    """Draw a thin line at an error of zero."""
    ax.axhline(0.0, color=GREY, linewidth=0.5, zorder=0)


def cloud(y: Array, limit: int) -> IntArray:
    """Return the row numbers of at most `limit` finite samples, evenly spread, with the smallest
    and the largest value among them.
    """
    rows = np.flatnonzero(np.isfinite(y))
    if len(rows) <= limit:
        return rows
    extremes = rows[[np.argmin(y[rows]), np.argmax(y[rows])]]
    return np.union1d(rows[evenly(len(rows), limit - 2)], extremes)


def band(x: Array, y: Array) -> tuple[Array, Array, Array, Array]:
    """Divide the range of sorted `x` into equal intervals. For every interval that contains
    samples, return the mean of `x` and the mean, smallest and largest `y`, (m,) each.
    """
    rows = np.flatnonzero(np.isfinite(y))
    edges = np.linspace(x[0], x[-1], STRETCHES + 1)[1:-1]
    starts = np.flatnonzero(np.diff(np.searchsorted(edges, x[rows], side="right"), prepend=-1))
    count = np.diff(starts, append=len(rows))
    x_mean, y_mean = (np.add.reduceat(values[rows], starts) / count for values in (x, y))
    low, high = (extreme.reduceat(y[rows], starts) for extreme in (np.minimum, np.maximum))
    return x_mean, y_mean, low, high


def evenly(count: int, limit: int) -> list[int]:
    """Return at most `limit` of the indices 0, ..., `count` - 1, evenly spread, with the first and
    the last among them.
    """
    return sorted({int(i) for i in np.linspace(0, count - 1, min(count, limit)).round()})


# Axes and labels
# --------------------------------------------------------------------------------------------------


def plain_logarithm(ax: Axes, side: Literal["x", "y"], subs: Sequence[float] = (1.0,)) -> None:
    """Give an axis a logarithmic scale with plain labels such as 0.5, 1, 2. `subs` are the
    multiples of the powers of ten that are labelled.
    """
    if is_sketch(ax):
        scaled = ax.xaxis if side == "x" else ax.yaxis
        scaled.logarithmic, scaled.subs = True, subs
        return
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis = ax.xaxis if side == "x" else ax.yaxis
    (ax.set_xscale if side == "x" else ax.set_yscale)("log")
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def label_rows(ax: Axes, names: Sequence[str]) -> None:
    """Label the horizontal rows 0, 1, ... of a panel with names, from the top to the bottom."""
    ax.set_yticks(range(len(names)), names)
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(names) - 0.45, -0.55)


def write_beside(ax: Axes, row: float, text: str) -> None:
    """Write a text to the right of a panel, at the height of a row."""
    write_at(ax, text, (1.0, row), (5, 0), xycoords=("axes fraction", "data"), va="center")


def write_at(
    ax: Axes, text: str, place: tuple[Any, Any], offset: tuple[int, int], **look: Any
) -> None:
    """Write a text in small letters at an offset, in points, from a position."""
    if not is_sketch(ax):
        from matplotlib import rcParams

        look |= {"textcoords": "offset points", "fontsize": rcParams["xtick.labelsize"]}
    ax.annotate(text, place, offset, **look)


@dataclass(frozen=True)
class Key:
    """An entry of a legend: a filled patch if it has a `facecolor`, otherwise a line with its
    markers.
    """

    label: str
    look: dict[str, Any]

    def artist(self) -> Artist:
        """Return the entry as an object that Matplotlib can draw in a legend."""
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        if "facecolor" in self.look:
            return Patch(label=self.label, **self.look)
        return Line2D([], [], label=self.label, **self.look)


def colour_bar(ax: Any, shades: Any, label: str, **look: Any) -> None:
    """Draw a colour bar to the right of the axes. The colour bar and the coloured areas `shades`
    get the name `map`, so that a dark page does not invert their colours.
    """
    bar = ax.figure.colorbar(shades, ax=ax, label=label, use_gridspec=False, **look)
    for part in () if is_sketch(ax) else (shades, bar.solids):
        part.set_gid("map")


def key(label: str, **look: Any) -> Key:
    """Return an entry of a legend with this label and appearance."""
    return Key(label, look)


def heading(quantity: Quantity) -> str:
    """Return the heading of the column of a quantity in the data of a panel, for example `force
    [N]`.
    """
    return f"{quantity.name} [{quantity.unit}]"


RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def raised(term: str) -> str:
    """Return a term with exponents as superscripts: `strain²` for `strain^2`."""
    return re.sub(r"\^(\d+)(?![\d.])", lambda power: power[1].translate(RAISED), term)


def shorten(text: str, length: int) -> str:
    """Return the text. If it is longer than `length`, letters in its middle are replaced by `…`."""
    if len(text) <= length:
        return text
    head = (length - 1) // 2
    return f"{text[:head]}…{text[head + 1 - length :]}"


def told_apart(names: Sequence[str], length: int) -> list[str]:
    """Return the names shortened to at most `length` letters, so that different names stay
    different.

    If a name is too long, words that are equal at the beginning or the end of all names are left
    out first, then letters in the middle. If different names become equal by this, all names begin
    with a number.
    """
    if len({*names}) < 2 or max(map(len, names)) <= length:
        return [shorten(name, length) for name in names]
    parts = [re.split(r"(?<=[^A-Za-z0-9])", name) for name in names]
    head, tail = _alike(parts), _alike([part[::-1] for part in parts])
    cut = ["".join(["…"[:head], *part[head : len(part) - tail], "…"[:tail]]) for part in parts]
    names_of_cut = [shorten(name, length) for name in cut]
    if len({*names_of_cut}) == len({*names}):
        return names_of_cut
    places = {name: f"{number}: " for number, name in enumerate(dict.fromkeys(names), 1)}
    numbers = [places[name] for name in names]
    return [n + shorten(name, length - len(n)) for n, name in zip(numbers, cut, strict=True)]


def _alike(parts: Sequence[Sequence[str]]) -> int:
    """Return the number of words that are equal at the beginning of all names. `parts` holds the
    words of each name. The last word of the shortest name is never counted, so that at least one
    word of every name remains.
    """
    same = [len({*column}) == 1 for column in zip(*parts, strict=False)]
    return [*same[:-1], False].index(False)


def titles(names: Sequence[str], length: int) -> list[str]:
    """Return the names as titles with lines of at most `length` letters. A title has at most two
    lines, or three if it cannot be broken well. Longer names are shortened so that different names
    stay different.
    """
    return [textwrap.fill(name, length) for name in told_apart(names, 2 * length)]


# Captions
# --------------------------------------------------------------------------------------------------


def places(inputs: ReportInputs, ids: Sequence[str], most: int = MOST_PANELS) -> list[int]:
    """Return the indices of the curves or recordings that are drawn: those that were requested,
    otherwise at most `most`, evenly spread.
    """
    if inputs.asked:
        return [place for place, id_ in enumerate(ids) if id_ in inputs.asked]
    return evenly(len(ids), most)


def some_curves(inputs: ReportInputs, numbers: Sequence[int], most: int = MOST_PANELS) -> list[int]:
    """Return the numbers of the curves that are drawn, out of `numbers`, by the same rule as
    `places`.
    """
    ids = [inputs.dataset.curves[i].id for i in numbers]
    return [numbers[i] for i in places(inputs, ids, most)]


def some_of(shown: int, count: int, things: str) -> str:
    """Return a sentence that says how many of `count` objects are drawn. Return an empty text if
    all of them are drawn.
    """
    return "" if shown == count else f" {shown} of {count} {things} are drawn, evenly spread."


def best_of(shown: int, count: int) -> str:
    """Return a sentence about the models that are drawn. Return an empty text if all models are
    drawn.
    """
    if shown == count:
        return ""
    others = "other" if shown == 2 else f"{shown - 1} others"
    return f" Of {count} models, the run's own and the best {others} are drawn."


def beyond_scale(models: Sequence[str]) -> str:
    """Return a sentence with the models whose errors are too large for the scale of the axes.
    Return an empty text if there are none.
    """
    return f" Too far off for the scale: {', '.join(map(title_of, models))}." if models else ""


def interval_words(inputs: ReportInputs) -> str:
    """Return sentences for a caption that explain the intervals. Return an empty text if the spec
    does not ask for intervals.
    """
    if inputs.left_out is None:
        return ""
    words = (
        f" The band contains a sample of a new curve with a probability of {INTERVAL:.0%}, "
        f"estimated from left-out {inputs.left_out.kind} of the training data."
    )
    limits = interval_limits(inputs.left_out)
    return words if limits is None else f"{words} But {limits}."


def thinned(sizes: Sequence[int]) -> str:
    """Return sentences that say how curves with these numbers of samples are thinned. Return an
    empty text if every sample is drawn.
    """
    words = SOME_DOTS if max(sizes) > DOTS else ""
    if max(sizes) > 4 * STRETCHES:
        words += " Lines are means over short stretches, pale bands the range of the samples."
    return words


SOME_DOTS = " Only some of the samples are drawn as dots, including the extremes."
