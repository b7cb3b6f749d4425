"""Segments with the weights that join them, as M2's figures 5 and 6; and the way between the
training levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes

from mapmore_cli.domain.arrays import Array, IntArray
from mapmore_cli.domain.declared import Transition
from mapmore_cli.domain.models import Fusion, Pieces
from mapmore_cli.domain.recording import DIRECTION, Quantity
from mapmore_cli.modelling.pieces.definition import cell_weights, weight_of, zones
from mapmore_cli.modelling.pieces.segmentation import training_curves
from mapmore_cli.reporting.figures import style
from mapmore_cli.reporting.figures.drawing import Drawing, Grid, Panel, Values
from mapmore_cli.reporting.inputs import ReportInputs

LOOKS = (
    (style.BLUE, "o", "-"),
    (style.ORANGE, "s", "--"),
    (style.GREEN, "^", "-."),
    (style.PURPLE, "D", ":"),
)
"""Colour, marker and line of the segments, in turn."""
MOST_CURVES, DOTS_A_SEGMENT, GRID = 6, 30, 401


@dataclass(frozen=True)
class SegmentCurve:
    """One training curve along one segmented variable.

    `x`, `y` and `cell` (1-based place of the sample's segment) are `(n,)`; `boundaries` is `(count
    + 1,)`, both ends included.
    """

    id: str
    title: str
    x: Array
    y: Array
    cell: IntArray
    boundaries: Array


def segment_curves(inputs: ReportInputs, variable: int) -> list[SegmentCurve]:
    """Return the segmented curves along variable number `variable`; held-out samples are left
    out.
    """
    curves = {
        curve.id: curve
        for curve in training_curves(inputs.dataset.curves, by_level=inputs.model.level is not None)
    }
    panels = []
    for segmented in inputs.segmentation:
        curve = curves[segmented.curve]
        train = ~curve.held_out
        cell = np.zeros(curve.size, dtype=np.int64)
        for segment in segmented.segments:
            cell[segment.rows] = segment.cell[variable]
        x, y = (
            curve.columns[segmented.variables[variable]][train],
            curve.columns[inputs.fitted][train],
        )
        title = inputs.curve_label(curve)
        panels.append(
            SegmentCurve(segmented.curve, title, x, y, cell[train], segmented.boundaries[variable])
        )
    return panels


def draw_segments(ax: Axes, curve: SegmentCurve) -> None:
    """Draw the samples, coloured and marked by segment."""
    for place in range(1, len(curve.boundaries)):
        rows = np.flatnonzero(curve.cell == place)
        rows = rows[style.cloud(curve.x[rows], curve.y[rows], DOTS_A_SEGMENT)]
        colour, marker, _ = LOOKS[(place - 1) % len(LOOKS)]
        ax.plot(
            curve.x[rows],
            curve.y[rows],
            color=colour,
            marker=marker,
            linestyle="none",
            markersize=2.8,
            markeredgewidth=0,
        )


def draw_weights(ax: Axes, curve: SegmentCurve, transition: Transition, z_s: float) -> None:
    """Draw the weight of every segment along the variable, where it has any."""
    x = np.union1d(
        np.linspace(curve.boundaries[0], curve.boundaries[-1], GRID),
        np.concatenate(zones(curve.boundaries, z_s)),
    )
    for place, weight in enumerate(cell_weights(x, curve.boundaries, transition, z_s).T, start=1):
        colour, _, line = LOOKS[(place - 1) % len(LOOKS)]
        ax.plot(
            x, np.where(weight > 0, weight, np.nan), color=colour, linestyle=line, linewidth=1.2
        )
    ax.set_yticks([0, 0.5, 1])


def draw_zones(ax: Axes, boundaries: Array, z_s: float) -> None:
    """Draw boundaries as vertical lines, transition zones shaded (M2 eq 10 and 11)."""
    for start, end in zip(*zones(boundaries, z_s), strict=True):
        ax.axvspan(start, end, color="#ececec", linewidth=0, zorder=-1)
    for boundary in boundaries:
        ax.axvline(boundary, color=style.GREY, linewidth=0.5, zorder=0)


def draw(inputs: ReportInputs) -> list[Drawing]:
    """One figure a segmented variable, and one of the way between the levels."""
    pieces = inputs.model.pieces
    if pieces is None or not pieces.segments:
        return []
    cut = [
        _variable_figure(inputs, pieces.fusion, j, name)
        for j, name in enumerate(pieces.variables)
        if name != DIRECTION
    ]
    return [*cut, *level_figures(inputs)]


def _variable_figure(inputs: ReportInputs, fusion: Fusion, variable: int, name: str) -> Drawing:
    every = segment_curves(inputs, variable)
    shown = [every[i] for i in style.places(inputs, [curve.id for curve in every], MOST_CURVES)]
    panels = tuple(
        _panel(inputs, fusion, curve, inputs.dataset.quantities[name]) for curve in shown
    )
    grid = Grid(
        style.columns_for(len(panels)),
        style.width_for(len(panels)),
        2.2,
        (2.0, 0.8),
        common_y="row",
    )
    caption = (
        f"Training samples by segment of {name}, and the segments' weights within their curve "
        "below: boundaries as lines, transition zones "
        f"shaded ({fusion.transition} transitions, z_s = "
        f"{fusion.z_s:g}).{style.some_of(len(shown), len(every), 'curves')}"
    )
    spoken = "; ".join(
        f"{curve.title}: boundaries at {', '.join(f'{b:.3g}' for b in curve.boundaries)}"
        for curve in shown
    )
    stem = "segments" if variable == 0 else f"segments_{name}"
    return Drawing(stem, caption, f"Segments of {name}. {spoken}.", panels, grid)


def _panel(inputs: ReportInputs, fusion: Fusion, curve: SegmentCurve, along: Quantity) -> Panel:
    def on(axes: Sequence[Axes]) -> None:
        draw_segments(axes[0], curve)
        draw_weights(axes[1], curve, fusion.transition, fusion.z_s)
        for ax in axes:
            draw_zones(ax, curve.boundaries, fusion.z_s)

    target = inputs.dataset.quantities[inputs.fitted]
    weights = cell_weights(curve.x, curve.boundaries, fusion.transition, fusion.z_s).T
    data: dict[str, Values] = {
        style.heading(along): curve.x,
        style.heading(target): curve.y,
        "segment": curve.cell,
        **{f"weight of segment {place}": weight for place, weight in enumerate(weights, start=1)},
    }
    return Panel(
        curve.id,
        on,
        inputs.axis_label(along),
        (inputs.axis_label(target), "Weight (–)"),
        data,
        style.shortened(curve.title, 34),
    )


def level_figures(inputs: ReportInputs) -> list[Drawing]:
    """One figure where there are levels to interpolate between."""
    pieces = inputs.model.pieces
    if pieces is None or pieces.level is None or len(pieces.curves) < 2:
        return []
    if pieces.fusion.levels != "linear":  # the weights depend on the curves' values
        return []
    levels = np.array([curve.level for curve in pieces.curves], dtype=np.float64)
    level = inputs.dataset.quantities[pieces.level]
    return [_weights(pieces, inputs, level, levels)]


def _weights(pieces: Pieces, inputs: ReportInputs, level: Quantity, levels: Array) -> Drawing:
    x, weights = level_weights(pieces, levels)

    def on(axes: Sequence[Axes]) -> None:
        draw_levels(axes[0], levels, x, weights)
        axes[0].set_yticks([0, 0.5, 1])

    data: dict[str, Values] = {style.heading(level): x}
    data |= {
        f"weight of {value:g} {level.unit}": weight
        for value, weight in zip(levels, weights, strict=True)
    }
    caption = (
        f"Weights of the {len(levels)} training curves over {level.name}; a dot marks the "
        "level of each."
    )
    if (share := pieces.fusion.shrink) < 1.0:
        caption += (
            f" Midway between levels, {share:.0%} of what the pieces explain on the backbone "
            "is carried: the weights sum to less than one."
        )
    alt = f"Weights with their peaks at {', '.join(f'{value:g}' for value in levels)} {level.unit}."
    panel = Panel("", on, inputs.axis_label(level), ("Weight (–)",), data)
    return Drawing("segments_levels", caption, alt, (panel,), Grid(height=1.3))


def draw_levels(ax: Axes, levels: Array, x: Array, weights: Array) -> None:
    """Draw weights of the curves, `(levels, m)`, as the model has them at `x` between the levels
    and beyond the outer ones.
    """
    for colour, level, weight in zip(
        style.level_colours(len(levels)), levels, weights, strict=True
    ):
        ax.plot(x, weight, color=colour, linewidth=1.2)
        ax.plot([level], [1.0], color=colour, marker="o", markersize=3)


def level_weights(pieces: Pieces, levels: Array) -> tuple[Array, Array]:
    """Values of the level quantity `(m,)`, and the weight of every curve there `(levels, m)`, in
    the middle of the other inputs' ranges.
    """
    x = _level_grid(pieces, levels)
    middle = {
        name: np.full(len(x), np.mean([curve.limits[name] for curve in pieces.curves]))
        for name in pieces.curves[0].limits
    }
    columns = {**middle, str(pieces.level): x}
    return x, np.array(
        [
            weight_of(pieces, {segment.id for segment in curve.segments}, columns)
            for curve in pieces.curves
        ]
    )


def _level_grid(pieces: Pieces, levels: Array) -> Array:
    """Values of the level quantity, a little beyond the outer levels where the model is
    extrapolated, the levels among them.
    """
    below, above = pieces.fusion.extrapolation[str(pieces.level)]
    margin = 0.08 * (levels[-1] - levels[0])
    low = levels[0] - (margin if isinstance(below, str) else 0.0)
    high = levels[-1] + (margin if isinstance(above, str) else 0.0)
    return np.union1d(np.linspace(low, high, GRID), levels)
