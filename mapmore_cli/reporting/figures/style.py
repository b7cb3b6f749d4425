"""Define the appearance of all figures: the settings of Matplotlib, the colours, and the lines of
models.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import accumulate
from logging import ERROR, getLogger
from typing import Any

import numpy as np

from mapmore_cli.reporting.figures.colours import colour_at
from mapmore_cli.reporting.inputs import FigureStyle

RC: dict[Any, Any] = {
    "axes.linewidth": 0.6,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlelocation": "left",
    # no tick labels stand above the axes, so titles need not be moved to avoid them
    "axes.titley": 1.0,
    "axes.xmargin": 0.02,
    "figure.facecolor": "white",
    "legend.frameon": False,
    "legend.columnspacing": 1.4,
    "legend.handlelength": 2.2,
    "lines.linewidth": 1.1,
    # texts are not converted to outlines, so that they can be searched and the file is small
    "svg.fonttype": "none",
    "text.parse_math": False,  # a `$` in a name does not begin a formula
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
}


PLAIN = FigureStyle()
"""Default appearance of figures."""


@contextmanager
def figure_style(style: FigureStyle = PLAIN) -> Iterator[None]:
    """Set the appearance of all figures that are drawn in this context. It begins with Matplotlib's
    own defaults, because the matplotlibrc of a user must not change a report.

    Two messages of Matplotlib are suppressed. One is about characters that the font lacks: text in
    SVG is drawn with the fonts of the reader. The other is about a missing font: the user has
    already been warned of it.
    """
    from matplotlib import rc_context, rcParamsDefault

    sizes: dict[Any, Any] = dict.fromkeys(("axes.labelsize", "font.size"), style.size)
    small = ("axes.titlesize", "legend.fontsize", "xtick.labelsize", "ytick.labelsize")
    sizes |= dict.fromkeys(small, style.size - 1.0)
    sizes["font.family"] = [*([style.font] if style.font else []), "sans-serif"]
    defaults = {key: value for key, value in rcParamsDefault.items() if "backend" not in key}
    log = getLogger("matplotlib")
    level = log.level
    log.setLevel(ERROR)
    try:
        with warnings.catch_warnings(), rc_context({**defaults, **RC, **sizes}):
            warnings.filterwarnings("ignore", message="Glyph .* missing from")
            yield
    finally:
        log.setLevel(level)


def has_font(name: str) -> bool:
    """Return True if this machine has a font with this name."""
    from matplotlib.font_manager import fontManager

    return name in {font.name for font in fontManager.ttflist}


def wrong_formula(label: str) -> str | None:
    """Return what is wrong with a formula in a label, or None if the formula is valid.

    Matplotlib parses nested formulas by recursion, and Python limits the depth of recursion. The
    deeper the calls of the caller, the fewer levels remain for the formula. Therefore, only
    `DEEPEST_FORMULA` levels are allowed, which are possible for every caller.
    """
    from matplotlib.mathtext import MathTextParser

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

BLACK, GREY, LIGHT, SHADE = "#000000", "#6e6e6e", "#b8b8b8", "#f0f0f0"
ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE = (
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
"""Colours of Okabe and Ito, which colour-blind readers can distinguish. Their yellow is left out,
because it is too pale for a line on white.
"""


@dataclass(frozen=True)
class ModelStyle:
    """Appearance of the line and the dots of one model, the same in every figure."""

    colour: str
    dashes: object
    width: float
    marker: str
    zorder: float = 4.0

    @property
    def line(self) -> dict[str, Any]:
        """Keyword arguments with which Matplotlib's `plot` draws this line."""
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "linewidth": self.width,
            "zorder": self.zorder,
        }


OWN_STYLE = ModelStyle(VERMILLION, "-", 1.6, "o", 3.0)
"""Style of the run's own model: a solid, wide line under the thinner dashed lines of the other
models, so that both can be seen if they coincide.
"""
_OTHERS = (
    ModelStyle(BLUE, (0, (5, 2)), 1.1, "s"),
    ModelStyle(GREEN, (0, (6, 1.5, 1, 1.5)), 1.1, "^"),
    ModelStyle(PURPLE, (0, (1.2, 1.2)), 1.3, "D"),
    ModelStyle(ORANGE, (0, (3, 1)), 1.1, "v"),
    ModelStyle(SKY, (0, (5, 1, 1, 1, 1, 1)), 1.1, "P"),
    ModelStyle(GREY, (0, (8, 2)), 1.1, "X"),
)


def model_styles(models: Sequence[str], palette: Sequence[str] = ()) -> dict[str, ModelStyle]:
    """Return the style of each model. The first model is the run's own; it always has the same
    style. The other models get the remaining styles one after the other. Repeated names are
    ignored.

    The colours of a `palette` replace the colours of the styles; the first is for the run's own
    model.
    """
    styles: dict[str, ModelStyle] = {}
    for i, name in enumerate(dict.fromkeys(models)):
        look = OWN_STYLE if i == 0 else _OTHERS[(i - 1) % len(_OTHERS)]
        colour = palette[i % len(palette)] if palette else look.colour
        styles[name] = replace(look, colour=colour)
    return styles


def level_colours(count: int) -> list[str]:
    """Return `count` shades of blue for ordered curves, from pale to dark. The palest can still be
    seen on white paper, and none is the colour of the run's own model.
    """
    return [colour_at("Blues", share) for share in np.linspace(1.0, 0.45, count)][::-1]
