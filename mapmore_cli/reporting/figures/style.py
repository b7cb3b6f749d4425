"""What all figures share: sizes, colours, labels, thinning for the eye."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import accumulate
from logging import LogRecord, getLogger
from typing import Any

import numpy as np
from matplotlib import colormaps, rc_context, rcParams, rcParamsDefault
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex
from matplotlib.font_manager import FontProperties, fontManager
from matplotlib.lines import Line2D
from matplotlib.mathtext import MathTextParser
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.reporting.inputs import INTERVAL, SINGLE, FigureStyle, ReportInputs
from mapmore_cli.reporting.table import title_of

DOUBLE = 7.16
"""Width of two columns of a journal page, inches."""

SMALLER = 1.0
"""By how many points titles, ticks and legends are smaller than labels."""

DOTS_A_CURVE = 180
INTERVAL_ALPHA = 0.15
SOME_DOTS = " Dots are some of the samples, the extremes among them."

RC: dict[Any, Any] = {
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # not looked for: no labels stand above the axes
    "axes.xmargin": 0.02,
    "figure.facecolor": "white",
    "legend.frameon": False,
    "legend.columnspacing": 1.4,
    "legend.handlelength": 2.2,
    "lines.linewidth": 1.1,
    "svg.fonttype": "none",  # text stays text: searchable, and small
    "text.parse_math": False,  # a `$` in a name is a `$`
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
}

BACKEND = ("backend", "backend_fallback")
"""What shows windows: not asked for."""


@contextmanager
def figure_style(style: FigureStyle | None = None) -> Iterator[None]:
    """Set the look of all figures over Matplotlib's own defaults: a user's matplotlibrc must not
    change a report.

    A character that the layout font lacks is no fault: as text in SVG, it is drawn with the
    reader's fonts.
    """
    style = style or FigureStyle()
    large, small = (
        ["axes.labelsize", "font.size"],
        ["axes.titlesize", "legend.fontsize", "xtick.labelsize", "ytick.labelsize"],
    )
    sizes: dict[Any, Any] = {
        **dict.fromkeys(large, style.size),
        **dict.fromkeys(small, style.size - SMALLER),
    }
    fonts: dict[Any, Any] = {"font.family": [*([style.font] if style.font else []), "sans-serif"]}
    # `rcdefaults` sets all, and first reads the style sheets, which takes longer than to draw a
    # figure
    changed = {
        key: value
        for key, value in rcParamsDefault.items()
        if key not in BACKEND and rcParams[key] != value
    }
    with (
        _no_word_of_absent_fonts(),
        warnings.catch_warnings(),
        rc_context({**changed, **RC, **sizes, **fonts}),
    ):
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


@contextmanager
def _no_word_of_absent_fonts() -> Iterator[None]:
    """Silence Matplotlib's line for every letter group in another font: the user has been told once
    (`faults_of`).
    """

    def keep(record: LogRecord) -> bool:
        return not record.getMessage().startswith(
            ("findfont: Font family", "Ignoring unknown font")
        )

    loggers = [getLogger(f"matplotlib.{name}") for name in ("font_manager", "backends.backend_pgf")]
    for logger in loggers:
        logger.addFilter(keep)
    try:
        yield
    finally:
        for logger in loggers:
            logger.removeFilter(keep)


def has_font(name: str) -> bool:
    """Whether this machine has a font of that name."""
    return name in {font.name for font in fontManager.ttflist}


def wrong_formula(label: str) -> str | None:
    """Return what is wrong with the formula in a label; None where nothing is.

    How deep it may be nested before Matplotlib's recursion ends depends on who draws, so that less
    is allowed here.
    """
    steps = [_BRACES.get(token, 0) for token in re.findall(r"\\left|\\right|\\.|[{}]", label)]
    if (depth := max(accumulate(steps), default=0)) > DEEPEST_FORMULA:
        return f"nested {depth} levels deep, and {DEEPEST_FORMULA} can be drawn"
    try:
        MathTextParser("path").parse(label)
    except Exception as fault:
        return (str(fault).strip().splitlines() or [type(fault).__name__])[-1]
    return None


DEEPEST_FORMULA = 10
_BRACES = {"{": 1, "\\left": 1, "}": -1, "\\right": -1}


def small() -> float:
    """Size of small letters, as those of the ticks, in points; to be asked while a figure is
    drawn.
    """
    return FontProperties(size=rcParams["xtick.labelsize"]).get_size_in_points()


BLACK, GREY, LIGHT = "#000000", "#6e6e6e", "#b8b8b8"
ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE = (
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
"""Okabe and Ito's colours, which colour-blind readers tell apart; their yellow is too pale for a
line on white.
"""

DOT: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 3}


@dataclass(frozen=True)
class ModelStyle:
    """How one model looks in every figure."""

    colour: str
    dashes: Any
    width: float
    marker: str
    zorder: float

    @property
    def line(self) -> dict[str, Any]:
        """What `plot` is told of its line."""
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "linewidth": self.width,
            "zorder": self.zorder,
        }


OWN_STYLE = ModelStyle(VERMILLION, "-", 1.6, "o", 3.0)
"""Solid and wide, under the thinner dashed lines of the others, so that both are seen where they
coincide.
"""
_OTHERS = (
    ModelStyle(BLUE, (0, (5, 2)), 1.1, "s", 4.0),
    ModelStyle(GREEN, (0, (6, 1.5, 1, 1.5)), 1.1, "^", 4.0),
    ModelStyle(PURPLE, (0, (1.2, 1.2)), 1.3, "D", 4.0),
    ModelStyle(ORANGE, (0, (3, 1)), 1.1, "v", 4.0),
    ModelStyle(SKY, (0, (5, 1, 1, 1, 1, 1)), 1.1, "P", 4.0),
    ModelStyle(GREY, (0, (8, 2)), 1.1, "X", 4.0),
)


def model_styles(models: Sequence[str], palette: Sequence[str] = ()) -> dict[str, ModelStyle]:
    """One style a model: the first, the run's own, always the same; the others in turn, names that
    come again left out.

    A `palette` replaces the colours, that of the run's own model first.
    """
    looks = {
        name: OWN_STYLE if i == 0 else _OTHERS[(i - 1) % len(_OTHERS)]
        for i, name in enumerate(dict.fromkeys(models))
    }
    if not palette:
        return looks
    return {
        name: replace(look, colour=palette[i % len(palette)])
        for i, (name, look) in enumerate(looks.items())
    }


def shortened(text: str, length: int) -> str:
    """Return the text, its middle left out where it is longer than `length`."""
    if len(text) <= length:
        return text
    head = (length - 1) // 2
    return f"{text[:head]}…{text[head + 1 - length :]}"


def two_lines(text: str, length: int) -> str:
    """Return the text in two lines where it is longer than `length`, broken after a separator if it
    has one; longer ones are shortened.
    """
    if len(text) <= length:
        return text
    text = shortened(text, 2 * length)
    cut = max(text.rfind(mark, 0, length) for mark in "_-./ ,") + 1
    if cut <= 0 or len(text) - cut > length:
        cut = length
    return f"{text[:cut]}\n{text[cut:]}"


def columns_for(count: int) -> int:
    """How many panels to put side by side: up to three, without a nearly empty last row."""
    return 2 if count == 4 else min(count, 3)


def width_for(count: int) -> float:
    """Width of a figure of `count` panels, inches: one column of a journal page, or two."""
    return SINGLE if count == 1 else DOUBLE


def places(inputs: ReportInputs, ids: Sequence[str], most: int) -> list[int]:
    """Which of the curves or recordings of these ids are drawn: those that were asked for, else at
    most so many, evenly spread.
    """
    if inputs.asked:
        return [place for place, one in enumerate(ids) if one in inputs.asked]
    return spread(len(ids), most)


def some_curves(inputs: ReportInputs, numbers: Sequence[int], most: int) -> list[int]:
    """Which of the curves of these numbers in the dataset are drawn, likewise."""
    return [
        numbers[i] for i in places(inputs, [inputs.dataset.curves[i].id for i in numbers], most)
    ]


def some_of(shown: int, count: int, what: str) -> str:
    """Return a sentence that says what was left out; nothing where all is shown."""
    return "" if shown == count else f" {shown} of {count} {what} are drawn, evenly spread."


def level_colours(count: int) -> list[str]:
    """Blues for ordered curves, from pale (but not too pale for white paper) to dark: they stay
    apart from the model's own colour.
    """
    return [
        to_hex(colour)
        for colour in colormaps["Blues"](
            np.linspace(0.45, 1.0, count) if count > 1 else np.array([0.8])
        )
    ]


def best_of(shown: int, count: int) -> str:
    """Return a sentence about the models that lines are drawn of; nothing where all are."""
    return (
        ""
        if shown == count
        else (
            f" Of {count} models, the run's own and the {shown - 1} others with the least "
            "error are drawn."
        )
    )


def extent(values: Sequence[Array]) -> tuple[float, float]:
    """Return the least and the greatest of some values, which an axis is to show whatever else is
    drawn.
    """
    every = np.concatenate(values)
    return float(np.nanmin(every)), float(np.nanmax(every))


def beyond_scale(models: Sequence[str]) -> str:
    """Return a sentence about the models that leave the panels; nothing where all are held."""
    return f" Too far off for the scale: {', '.join(map(title_of, models))}." if models else ""


def heading(quantity: Quantity) -> str:
    """Return the heading of a quantity's column among the numbers of a panel."""
    return f"{quantity.name} [{quantity.unit}]"


def key(label: str, **look: Any) -> Line2D:
    """Return the entry of a legend."""
    return Line2D([], [], label=label, **look)


def plain_logarithm(axis: Axis, subs: Sequence[float] | None = None) -> None:
    """Scale an axis by logarithms, labelled with plain numbers as 0.5, 1, 2; `subs` are the
    labelled multiples of the powers of ten.
    """
    (axis.axes.set_xscale if axis is axis.axes.xaxis else axis.axes.set_yscale)("log")
    if subs is not None:
        axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def label_rows(ax: Axes, names: Sequence[str], below: float = 0.4, above: float = 0.6) -> None:
    """Name the rows 0, 1, ... of a panel from its top down, with so much room below the last and
    above the first.
    """
    ax.set_yticks(range(len(names)), names)
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(names) - below, -above)


def write_beside(ax: Axes, row: float, text: str, distance: float) -> None:
    """Write at the right of a panel, so many points beside it."""
    beside: dict[str, Any] = {
        "xycoords": ("axes fraction", "data"),
        "textcoords": "offset points",
        "va": "center",
        "fontsize": small(),
    }
    ax.annotate(text, (1.0, row), (distance, 0), **beside)


def zero_line(ax: Axes) -> None:
    """Draw a thin line at an error of zero."""
    ax.axhline(0.0, color=GREY, linewidth=0.5, zorder=0)


def draw_interval(ax: Axes, x: Array, ends: tuple[Array, Array], colour: str) -> None:
    """Shade what lies between two ends, (n,) each."""
    ax.fill_between(x, *ends, color=colour, alpha=INTERVAL_ALPHA, linewidth=0, zorder=1)


def interval_key(colour: str) -> Patch:
    """Return what the legend shows for it."""
    return Patch(color=colour, alpha=INTERVAL_ALPHA, linewidth=0, label=f"{INTERVAL:.0%} interval")


def interval_words(inputs: ReportInputs) -> str:
    """Return what the caption says of it, where there is one."""
    left_out = inputs.left_out
    if left_out is None:
        return ""
    return (
        f" The band holds a sample of a new curve with a probability of {INTERVAL:.0%}, by "
        f"left-out {left_out.kind} of training data."
    )


def draw_band(ax: Axes, x: Array, y: Array, color: str, **look: Any) -> None:
    """Draw `y` over sorted `x` as a line; of many samples the mean, with their range as a pale
    band.
    """
    line = band(x, y)
    if not line.drawn_whole:
        ax.fill_between(line.x, line.low, line.high, color=color, alpha=0.15, linewidth=0, zorder=1)
    ax.plot(line.x, line.mean, color=color, **look)


def thinned(sizes: Sequence[int]) -> str:
    """Say how curves of so many samples are drawn; nothing where every sample is drawn."""
    if max(sizes) <= DOTS_A_CURVE:
        return ""
    lines = (
        " Lines are means over short stretches, pale bands the range of the samples."
        if max(sizes) > MOST_ON_A_LINE
        else ""
    )
    return SOME_DOTS + lines


MOST_ON_A_LINE = 600
"""A line of more samples than this is drawn as the mean and the range over `STRETCHES` stretches of
the axis.
"""

STRETCHES = 150
IN_A_STRETCH = 5


def envelope(y: Array, limit: int) -> IntArray:
    """Row numbers that draw a trace with at most `limit` points: the lowest and the highest sample
    of each of `limit // 2` runs.

    All rows where there are no more than `limit`.
    """
    n = len(y)
    if n <= limit:
        return np.arange(n)
    size = -(-n // (limit // 2))
    runs = -(-n // size)
    padded = np.concatenate([y, np.full(runs * size - n, np.nan)]).reshape(runs, size)
    missing = np.isnan(padded)
    first = np.arange(runs) * size
    lowest = first + np.argmin(np.where(missing, np.inf, padded), axis=1)
    highest = first + np.argmax(np.where(missing, -np.inf, padded), axis=1)
    return np.unique(np.concatenate([lowest, highest]))


def cloud(x: Array, y: Array, limit: int) -> IntArray:
    """Row numbers of at most `limit` dots: from each of `limit // 5` stretches of x, five samples
    of evenly spaced rank in y.

    All finite rows where there are no more than `limit`.
    """
    rows = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if len(rows) <= limit:
        return rows
    stretch = _stretches(x[rows], max(limit // IN_A_STRETCH, 1))
    rows = rows[np.lexsort((y[rows], stretch))]
    ends = np.cumsum(np.bincount(stretch))
    chosen = [
        rows[start + i]
        for start, end in zip([0, *ends[:-1]], ends, strict=True)
        if end > start
        for i in spread(int(end - start), IN_A_STRETCH)
    ]
    return np.unique(np.array(chosen, dtype=np.int64))


@dataclass(frozen=True)
class Band:
    """A line over x with the range of the samples behind each of its points, each `(m,)`."""

    x: Array
    mean: Array
    low: Array
    high: Array

    @property
    def drawn_whole(self) -> bool:
        """True where every point of the line is a sample."""
        return self.low is self.mean


def band(x: Array, y: Array) -> Band:
    """`y` over sorted `x`, averaged over those equal stretches of x that hold any where there are
    more than `MOST_ON_A_LINE` samples.
    """
    if len(x) <= MOST_ON_A_LINE:
        return Band(x, y, y, y)
    rows = np.flatnonzero(np.isfinite(y))
    stretch = _stretches(x, STRETCHES)[rows]
    starts = np.flatnonzero(np.diff(stretch, prepend=-1))
    count = np.diff(starts, append=len(rows))
    x_mean, y_mean = (np.add.reduceat(values[rows], starts) / count for values in (x, y))
    return Band(
        x_mean, y_mean, np.minimum.reduceat(y[rows], starts), np.maximum.reduceat(y[rows], starts)
    )


def _stretches(x: Array, count: int) -> IntArray:
    """Return number, from 0, of the stretch that each sample lies in."""
    low, high = float(x.min()), float(x.max())
    if high <= low:
        return np.zeros(len(x), dtype=np.int64)
    return np.clip(((x - low) * (count / (high - low))).astype(np.int64), 0, count - 1)


def spread(count: int, limit: int) -> list[int]:
    """At most `limit` of `count` numbers, evenly spread, the first and the last among them."""
    if count <= limit:
        return list(range(count))
    return sorted({int(i) for i in np.linspace(0, count - 1, limit).round()})
