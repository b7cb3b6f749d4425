"""How each segment's terms were chosen: what they leave unexplained, and what the runner-up would
have left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import SegmentFit
from mapmore_cli.reporting.figures.drawing import DOUBLE, Drawing, Layout, Panel, Values
from mapmore_cli.reporting.figures.panels import (
    DOT,
    evenly,
    key,
    label_rows,
    plain_logarithm,
    shorten,
    some_of,
    told_apart,
    write_beside,
)
from mapmore_cli.reporting.figures.style import GREY, LIGHT, model_styles
from mapmore_cli.reporting.inputs import ReportInputs

MOST_SEGMENTS = 40
RUNNER_UP = DOT | {"markersize": 4, "color": GREY, "markerfacecolor": "white"}


@dataclass(frozen=True)
class TermSteps:
    """One segment: per cent of the sum of squares left after each step `(k,)`, and with the step's
    runner-up instead (NaN: none).
    """

    segment: str
    terms: str
    left: Array
    left_by_runner_up: Array


def term_steps(fit: SegmentFit) -> TermSteps:
    """From the stored error reduction ratios of every candidate."""
    chosen = fit.selection
    left = 100 * (1 - np.cumsum(chosen.err))
    before = np.concatenate([[100.0], left[:-1]])
    errs = chosen.err_all[np.arange(len(left)), chosen.runner_up]
    rival = np.where(chosen.runner_up >= 0, errs, np.nan)
    return TermSteps(fit.id, ", ".join(fit.terms), left, before - 100 * rival)


def whole_curves(fits: Sequence[SegmentFit], most: int) -> list[SegmentFit]:
    """Return the segments of some curves, evenly spread, so that there are about `most` of them."""
    curves = list(dict.fromkeys(fit.curve for fit in fits))
    if len(fits) <= most:
        return list(fits)
    chosen = {curves[i] for i in evenly(len(curves), max(2, most * len(curves) // len(fits)))}
    return [fit for fit in fits if fit.curve in chosen]


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure for all segments; none where the model has no segments."""
    fits = inputs.fit.pieces
    segments = [term_steps(fit) for fit in whole_curves(fits, MOST_SEGMENTS) if fit.terms]
    if not segments:
        return []
    own = model_styles([inputs.own], inputs.style.palette)[inputs.own].colour
    sizes = [len(one.left) for one in segments]
    data: dict[str, Values] = {
        "segment": np.repeat([one.segment for one in segments], sizes),
        "terms": np.repeat([one.terms for one in segments], sizes),
        "step": np.concatenate([np.arange(size) + 1 for size in sizes]),
        "left unexplained [%]": np.concatenate([one.left for one in segments]),
        "left by the runner-up [%]": np.concatenate([one.left_by_runner_up for one in segments]),
    }
    caption = (
        "What the chosen terms (named at the right, in the order of selection) leave "
        "unexplained in every segment, and what the runner-up "
        "of each step would have left: the distance is the margin of the "
        f"choice.{some_of(len(segments), len(fits), 'segments')}"
    )
    handles = (
        key("chosen term", **DOT | {"markersize": 4, "color": own}),
        key("its runner-up", **RUNNER_UP),
    )
    on = partial(draw_terms, segments=segments, colour=own)
    panel = Panel("", on, "Sum of squares left unexplained (%)", ("",), data)
    grid = Layout(0.3 + 0.17 * len(segments), width=DOUBLE)
    return [Drawing("terms", caption, (panel,), grid, handles)]


def draw_terms(ax: Axes, segments: Sequence[TermSteps], colour: str) -> None:
    """Draw one row a segment: a filled dot for every chosen term, an open one for its runner-up,
    the names at the right.
    """
    for row, one in enumerate(segments):
        # a share of zero has no place on a logarithmic axis
        left, rival = np.maximum(one.left, 1e-6), np.maximum(one.left_by_runner_up, 1e-6)
        rows = np.full(len(left), row)
        ax.plot([*left, rival[-1]], [*rows, row], color=LIGHT, linewidth=0.8, zorder=1)
        ax.plot(rival, rows, zorder=2, **RUNNER_UP)
        ax.plot(left, rows, zorder=3, **DOT | {"markersize": 4, "color": colour})
        write_beside(ax, row, shorten(one.terms, 40))
    plain_logarithm(ax.xaxis)
    low, high = np.log10(ax.get_xlim())
    ax.set_xlim(10.0 ** np.floor(low), 10.0 ** np.ceil(high))
    label_rows(ax, told_apart([one.segment for one in segments], 40))
