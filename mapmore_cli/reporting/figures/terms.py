"""How each segment's terms were chosen: what they leave unexplained, and what the runner-up would
have left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.fits import SegmentFit
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.inputs import ReportInputs

MOST_SEGMENTS, MOST_SPOKEN = 40, 12
LETTERS = 80
"""Letters beside the axis in a figure of two columns' width."""
MARKS = style.DOT | {"markersize": 4}
LEAST = 1e-6
"""Unexplained shares in per cent below this one are drawn at it."""


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
    rival = [
        chosen.err_all[step, second] if second >= 0 else np.nan
        for step, second in enumerate(chosen.runner_up)
    ]
    return TermSteps(
        fit.id, ", ".join(fit.terms), left, before - 100 * np.array(rival, dtype=float)
    )


def whole_curves(fits: Sequence[SegmentFit], most: int) -> list[SegmentFit]:
    """Return the segments of some curves, evenly spread, so that there are about `most` of them."""
    curves = list(dict.fromkeys(fit.curve for fit in fits))
    if len(fits) <= most:
        return list(fits)
    chosen = {curves[i] for i in style.spread(len(curves), max(2, most * len(curves) // len(fits)))}
    return [fit for fit in fits if fit.curve in chosen]


def draw_terms(ax: Axes, segments: Sequence[TermSteps], colour: str) -> None:
    """Draw one row a segment: a filled dot for every chosen term, an open one for its runner-up,
    the names at the right.
    """
    left_room, right_room = _room(ax, segments)
    margins = [
        [*one.left, np.nan, one.left[-1], one.left_by_runner_up[-1], np.nan] for one in segments
    ]
    ax.plot(*_in_rows(margins), color=style.LIGHT, linewidth=0.8, zorder=1)
    ax.plot(
        *_in_rows([one.left_by_runner_up for one in segments]),
        zorder=2,
        **MARKS | {"color": style.GREY, "markerfacecolor": "white"},
    )
    ax.plot(*_in_rows([one.left for one in segments]), color=colour, zorder=3, **MARKS)
    for row, segment in enumerate(segments):
        style.write_beside(ax, row, style.shortened(segment.terms, right_room), 6)
    style.plain_logarithm(ax.xaxis)
    low, high = np.log10(ax.get_xlim())
    ax.set_xlim(10.0 ** np.floor(low), 10.0 ** np.ceil(high))
    style.label_rows(ax, [style.shortened(segment.segment, left_room) for segment in segments])


def _in_rows(shares: Sequence[Values]) -> tuple[Array, Array]:
    """Shares of each segment as x and y in its row."""
    return np.maximum(np.concatenate(shares), LEAST), np.repeat(
        np.arange(len(shares)), [len(values) for values in shares]
    )


def _room(ax: Axes, segments: Sequence[TermSteps]) -> tuple[int, int]:
    """Letters that the names of the segments may have at the left, and their terms at the right;
    what the terms leave is the names'.
    """
    figure = ax.get_figure(root=True)
    width = style.DOUBLE if figure is None else float(figure.get_figwidth())
    letters = int(LETTERS * width / style.DOUBLE)
    longest = max(len(segment.terms) for segment in segments)
    left = max(letters * 2 // 5, letters - longest)
    return left, letters - min(left, max(len(segment.segment) for segment in segments))


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure for all segments; none where the model has no segments."""
    fits = inputs.fit.pieces
    segments = [term_steps(fit) for fit in whole_curves(fits, MOST_SEGMENTS) if fit.terms]
    if not segments:
        return []
    own = style.model_styles([inputs.own], inputs.style.palette)[inputs.own].colour
    handles = (
        style.key("chosen term", color=own, **MARKS),
        style.key("its runner-up", color=style.GREY, markerfacecolor="white", **MARKS),
    )
    caption = (
        "What the chosen terms (named at the right, in the order of selection) leave "
        "unexplained in every segment, and what the runner-up "
        "of each step would have left: the distance is the margin of the "
        f"choice.{style.some_of(len(segments), len(fits), 'segments')}"
    )
    spoken = "; ".join(
        f"{segment.segment}: {segment.terms}, {segment.left[-1]:.2g} % left"
        for segment in segments[:MOST_SPOKEN]
    )
    panel = Panel(
        "",
        lambda axes: draw_terms(axes[0], segments, own),
        "Sum of squares left unexplained (%)",
        ("",),
        _data(segments),
    )
    grid = Grid(width=style.DOUBLE, height=0.3 + 0.17 * len(segments))
    return [
        Drawing(
            "terms",
            caption,
            f"Unexplained sum of squares by segment. {spoken}.",
            (panel,),
            grid,
            handles,
        )
    ]


def _data(segments: Sequence[TermSteps]) -> dict[str, Values]:
    steps = [(segment, step) for segment in segments for step in range(len(segment.left))]
    return {
        "segment": [segment.segment for segment, _ in steps],
        "terms": [segment.terms for segment, _ in steps],
        "step": [step + 1 for _, step in steps],
        "left unexplained [%]": [float(segment.left[step]) for segment, step in steps],
        "left by the runner-up [%]": [
            float(segment.left_by_runner_up[step]) for segment, step in steps
        ],
    }
