"""The panels of a figure side by side as one SVG, drawn without Matplotlib."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.reporting.figures.drawing import Drawing, RenderedFigure, arranged, legend_columns
from mapmore_cli.reporting.figures.sketch import Sketch, box, face, line_svg, text
from mapmore_cli.reporting.inputs import FigureStyle
from mapmore_cli.reporting.table import title_of

POINTS = 72
LETTER = 0.55
"""Width of a letter, in sizes of the font."""

TICK = 2.5


def sketched(drawing: Drawing, style: FigureStyle) -> RenderedFigure | None:
    """Draw all panels of a figure as one SVG; None where a panel calls more of its axes than a
    `Sketch` has, or its words are formulas, so that Matplotlib has to draw it.
    """
    if drawing.grid.projection or any("$" in own for own in style.labels.values()):
        return None
    try:
        return _sketched(drawing, style)
    except (AttributeError, KeyError, TypeError):
        return None


def _sketched(drawing: Drawing, style: FigureStyle) -> RenderedFigure:
    plan, size, grid = arranged(drawing, style), style.size - 1, drawing.grid
    panels = [_filled(one.draw, len(grid.stack), plan.columns, size) for one in plan.panels]
    _share_axes(panels, plan.columns, grid.common_x, grid.common_y)
    keys: dict[str, dict[str, Any]] = {one.label: one.look for one in drawing.legend}
    for sheet in (sheet for panel in panels for sheet in panel if not drawing.legend):
        keys |= {label: look for label, look in sheet.keys.items() if label not in keys}
    width, legend, top = plan.width * POINTS, "", 2.0
    if keys:
        legend, top = _legend(keys, width, size)
    # what stands around the axes of a panel: titles, labels and ticks
    above = max(heading.count("\n") + 1 if heading else 0 for heading in plan.headings) * size * 1.2
    below = size + 3 + 1.3 * style.size
    row_height, cell = grid.height * POINTS, width / plan.columns
    parts = [legend]
    lefts = [
        max(_room_left(panel, one.y_labels, size) for panel, one in column)
        for column in (
            list(zip(panels, plan.panels, strict=True))[number :: plan.columns]
            for number in range(plan.columns)
        )
    ]
    for number, (panel, one, heading) in enumerate(
        zip(panels, plan.panels, plan.headings, strict=True)
    ):
        row, column = divmod(number, plan.columns)
        left, right = column * cell + lefts[column], (column + 1) * cell - 6
        right -= max(sheet.right for sheet in panel)
        start, stop = top + row * row_height + above + 4, top + (row + 1) * row_height - below - 4
        if heading:
            parts.append(text(heading, left, start - 4, size))
        gap = 7.0 if len(panel) > 1 else 0.0
        height = stop - start - gap * (len(panel) - 1)
        for place, (sheet, share) in enumerate(zip(panel, grid.stack, strict=True)):
            end = start + height * share / sum(grid.stack)
            label = one.y_labels[place] if place < len(one.y_labels) else ""
            if column and grid.common_y != "none":
                label = ""
            last = place == len(panel) - 1
            parts.append(_axes(sheet, (left, right, start, end), label, lefts[column], last))
            start = end + gap
        middle = (left + right) / 2
        parts.append(text(one.x_label, middle, stop + below, style.size, "middle"))
    rows = math.ceil(len(panels) / plan.columns)
    full = top + rows * row_height
    family = escape(f"{style.font}, sans-serif" if style.font else "sans-serif")
    svg = (
        f'<svg role="img" aria-label="{escape(xml_text(drawing.alt))}" '
        f'xmlns="http://www.w3.org/2000/svg" width="{width:g}pt" height="{full:g}pt" '
        f'viewBox="0 0 {width:g} {full:g}" font-family="{family}">{"".join(parts)}</svg>'
    )
    return RenderedFigure(drawing.name, drawing.caption, svg, plan.width)


def _filled(draw: Any, stack: int, columns: int, size: float) -> list[Sketch]:
    """Return the axes of a panel, drawn on, from top to bottom; they have one x axis."""
    sheets = [Sketch(size) for _ in range(stack)]
    for sheet in sheets:
        sheet.xaxis = sheets[0].xaxis
        sheet.xaxis.most = 5 if columns < 2 else 4
        sheet.yaxis.most = 6 if stack == 1 else 4
    draw(*sheets)
    return sheets


def _share_axes(panels: list[list[Sketch]], columns: int, all_x: bool, common_y: str) -> None:
    """Let axes be equally long that a figure's grid says are one."""
    sheets = [sheet for panel in panels for sheet in panel]
    if all_x:
        _make_equal([sheet.xaxis for sheet in sheets])
    rows = [panels[start : start + columns] for start in range(0, len(panels), columns)]
    for together in {"row": rows, "all": [panels], "none": []}[common_y]:
        for of_row in zip(*together, strict=True):
            _make_equal([sheet.yaxis for sheet in of_row])


def _make_equal(axes: Sequence[Any]) -> None:
    low, high = min(axis.low for axis in axes), max(axis.high for axis in axes)
    for axis in axes:
        axis.low, axis.high = low, high


def _room_left(panel: list[Sketch], labels: Sequence[str], size: float) -> float:
    """Return how many points the labels of a panel's y axes take."""
    words = [words for sheet in panel for words in sheet.yaxis.labels().values()]
    longest = max((len(line) for one in words for line in one.split("\n")), default=0)
    lines = max((label.count("\n") + 1 for label in labels if label), default=0)
    return LETTER * size * longest + 6 + lines * (size + 2.5)


def _axes(
    sheet: Sketch, frame: tuple[float, float, float, float], label: str, room: float, last: bool
) -> str:
    """Return one pair of axes with all that is drawn; `frame` is left, right, top and bottom."""
    left, right, top, bottom = frame
    across, up = sheet.xaxis.scale(left, right), sheet.yaxis.scale(bottom, top)
    marks = [svg(across, up) for _, svg in sorted(sheet.marks, key=lambda mark: mark[0])]
    view = f'x="{left:.1f}" y="{top:.1f}" width="{right - left:.1f}" height="{bottom - top:.1f}"'
    box_of = f'viewBox="{left:.1f} {top:.1f} {right - left:.1f} {bottom - top:.1f}"'
    parts = [f"<svg {view} {box_of}>{''.join(marks)}</svg>"]
    ticks, size = [f"M{left:.1f} {top:.1f}V{bottom:.1f}H{right:.1f}"], sheet.size
    for at, words in sheet.xaxis.labels().items():
        x = float(across(at))
        ticks.append(f"M{x:.1f} {bottom:.1f}v{TICK}")
        if last:
            parts.append(text(words, x, bottom + size + 3, size, "middle"))
    for at, words in sheet.yaxis.labels().items():
        y = float(up(at))
        ticks.append(f"M{left:.1f} {y:.1f}h-{TICK}")
        lines = words.count("\n")
        parts.append(text(words, left - 4, y + size * (0.35 + lines * 0.58), size, "end"))
    parts.append(f'<path d="{"".join(ticks)}" fill="none" stroke="#000" stroke-width=".6"/>')
    if label:
        lines = label.count("\n")
        x = left - room + size + lines * size * 1.15
        parts.append(text(label, x, (top + bottom) / 2, size + 1, "middle", turned=True))
    parts += [svg(across, up) for _, svg in sheet.beside]
    return "".join(parts)


def _legend(keys: dict[str, dict[str, Any]], width: float, size: float) -> tuple[str, float]:
    """Return the legend above the panels, and how high it is."""
    labels = [title_of(label) for label in keys]
    columns = legend_columns(labels, width / POINTS, size)
    step = min(width / columns, (max(map(len, labels)) * LETTER + 4.5) * size)
    parts = []
    for number, (label, look) in enumerate(zip(labels, keys.values(), strict=True)):
        row, column = divmod(number, columns)
        x, y = 4 + column * step, (row + 0.8) * size * 1.35
        if "facecolor" in look:
            inside = face({"edgecolor": "none", "hatch": None} | look)
            inside += f' fill-opacity="{look["alpha"]:g}"' if "alpha" in look else ""
            parts.append(box(x, y - size * 0.7, x + 2 * size, y, inside))
        else:
            ends = np.array([x, x + 2 * size]) if look.get("linestyle") != "none" else None
            at = np.full(1, y - size * 0.35)
            if ends is not None:
                parts.append(line_svg(ends, np.repeat(at, 2), look | {"marker": None}))
            dot = look | {"linestyle": "none"}
            parts.append(line_svg(np.array([x + size]), at, dot))
        parts.append(text(label, x + 2.5 * size, y, size))
    return "".join(parts), (math.ceil(len(labels) / columns) + 0.4) * size * 1.35
