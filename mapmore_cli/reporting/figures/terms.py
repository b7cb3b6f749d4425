"""Draw how the terms of each segment were chosen. For each step of the selection, two parts of the
sum of squares are drawn: the part that the chosen terms leave unexplained, and the part that would
remain with the second-best term (the runner-up).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import SegmentFit
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel
from mapmore_cli.reporting.figures.panels import (
    DOT,
    evenly,
    label_rows,
    looks_of,
    plain_logarithm,
    raised,
    shorten,
    some_of,
    told_apart,
    write_beside,
)
from mapmore_cli.reporting.figures.style import GREY, LIGHT
from mapmore_cli.reporting.inputs import ReportInputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MOST_SEGMENTS = 40
CHOSEN = DOT | {"markersize": 4, "zorder": 3}
RUNNER_UP = DOT | {"markersize": 4, "zorder": 2, "color": GREY, "markerfacecolor": "white"}


def left_unexplained(fit: SegmentFit) -> tuple[Array, Array]:
    """Return two percentages of the sum of squares for each step of the selection, (k,) each. The
    first is the part that remains unexplained after the step. The second is the part that would
    remain if the second-best term (the runner-up) had been chosen; it is NaN without a runner-up.
    Both are computed from the stored error reduction ratios of all candidates.
    """
    chosen = fit.selection
    left = 100 * (1 - np.cumsum(chosen.err))
    errs = chosen.err_all[np.arange(len(left)), chosen.runner_up]
    rival = np.where(chosen.runner_up >= 0, errs, np.nan)
    return left, np.array([100.0, *left[:-1]]) - 100 * rival


def whole_curves(fits: Sequence[SegmentFit], most: int) -> list[SegmentFit]:
    """Return the segments of some curves, evenly spread over all curves, so that there are about
    `most` segments. A curve is returned with all of its segments or not at all.
    """
    curves = list(dict.fromkeys(fit.curve for fit in fits))
    if len(fits) <= most:
        return list(fits)
    chosen = {curves[i] for i in evenly(len(curves), max(2, most * len(curves) // len(fits)))}
    return [fit for fit in fits if fit.curve in chosen]


def draw(inputs: ReportInputs) -> list[Drawing]:
    """Return a figure with a row for each segment, or an empty list for a model without segments.
    In a row, each chosen term is a filled dot, and its runner-up is an open dot. The names of the
    chosen terms stand at the right.
    """
    every = inputs.fit.pieces
    fits = [fit for fit in whole_curves(every, MOST_SEGMENTS) if fit.terms]
    if not fits:
        return []
    steps = [left_unexplained(fit) for fit in fits]
    terms = [", ".join(fit.terms) for fit in fits]
    colour = looks_of(inputs)[inputs.own].colour

    def on(ax: Axes) -> None:
        for row, both in enumerate(steps):
            # a logarithmic axis cannot show zero
            left, rival = (np.maximum(shares, 1e-6) for shares in both)
            rows = np.full(len(left), row)
            ax.plot([*left, rival[-1]], [*rows, row], color=LIGHT, linewidth=0.8, zorder=1)
            ax.plot(left, rows, label="chosen term", color=colour, **CHOSEN)
            ax.plot(rival, rows, label="its runner-up", **RUNNER_UP)
            write_beside(ax, row, shorten(raised(terms[row]), 40))
        plain_logarithm(ax, "x")
        low, high = np.log10(ax.get_xlim())
        ax.set_xlim(10.0 ** np.floor(low), 10.0 ** np.ceil(high))
        label_rows(ax, told_apart([fit.id for fit in fits], 40))

    sizes = [len(fit.terms) for fit in fits]
    left, rival = map(np.concatenate, zip(*steps, strict=True))
    data = {
        "segment": np.repeat([fit.id for fit in fits], sizes),
        "terms": np.repeat(terms, sizes),
        "step": np.concatenate([np.arange(size) + 1 for size in sizes]),
        "left unexplained [%]": left,
        "left by the runner-up [%]": rival,
    }
    caption = (
        "What the chosen terms (named at the right, in the order of selection) leave "
        "unexplained in every segment, and what the runner-up "
        "of each step would have left: the distance is the margin of the "
        f"choice.{some_of(len(fits), len(every), 'segments')}"
    )
    panel = Panel("", on, "Sum of squares left unexplained (%)", ("",), data)
    return [Drawing("terms", caption, (panel,), Layout(0.3 + 0.17 * len(fits), width=DOUBLE))]
