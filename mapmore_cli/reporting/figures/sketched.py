"""Draw figures as SVG without Matplotlib, with a separate `<svg>` element for each panel."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.reporting.figures.drawing import Drawing, Panel, RenderedFigure, arranged
from mapmore_cli.reporting.figures.elements import box, face, line_svg, text
from mapmore_cli.reporting.figures.sketch import Sketch
from mapmore_cli.reporting.inputs import FigureStyle
from mapmore_cli.reporting.table import title_of

POINTS, SCREEN = 72, 1.8
"""Points per inch, and pixels of a screen for each point. Figures on a screen are larger than on
paper, because a screen is read from farther away.
"""

LETTER, WIDE = 0.62, 1.0
"""Width of a letter, and of the wide letters `mwMW`, as fractions of the font size."""

TICK = 2.5

SMALLEST = 9.2
"""Size in pixels of the smallest letters on a narrow screen. A panel that would be too wide with
such letters is scrolled.
"""


def sketched(drawing: Drawing, style: FigureStyle) -> RenderedFigure | None:
    """Draw a figure with a separate `<svg>` element for each panel and for each entry of its
    legend. On a narrow screen, the panels and the entries can then be arranged below each other.

    Return None if Matplotlib must draw the figure: it has three-dimensional axes, a panel calls
    methods that a `Sketch` lacks, or an axis label of the user contains a formula.
    """
    if drawing.grid.projection or any("$" in label for label in style.labels.values()):
        return None
    try:
        return _sketched(drawing, style)
    except (AttributeError, KeyError, TypeError):
        return None


def _sketched(drawing: Drawing, style: FigureStyle) -> RenderedFigure:
    plan, size, grid = arranged(drawing, style), style.size - 1, drawing.grid
    panels = [_filled(panel.draw, grid.stack, plan.columns, size) for panel in plan.panels]
    _share_axes(panels, plan.columns, grid.common_x, grid.common_y)
    keys: dict[str, dict[str, Any]] = {entry.label: entry.look for entry in drawing.legend}
    for sheet in (sheet for panel in panels for sheet in panel if not drawing.legend):
        keys |= {label: look for label, look in sheet.keys.items() if label not in keys}
    above = max(heading.count("\n") + 1 if heading else 0 for heading in plan.headings) * size * 1.2
    room = [
        _room_left(panel, planned.y_labels, size)
        for panel, planned in zip(panels, plan.panels, strict=True)
    ]
    width, height = plan.width * POINTS / plan.columns, grid.height * POINTS
    entries, start = _legend([_entry(*key, style) for key in keys.items()], plan.width, style)
    parts = [f'<div class="keys">{entries}</div>'] if entries else []
    for number, (planned, heading) in enumerate(zip(plan.panels, plan.headings, strict=True)):
        left = max(room[number % plan.columns :: plan.columns])
        inside = _panel(panels[number], planned, heading, (left, above + 4, width, height), style)
        alt = drawing.caption if number == 0 else ""
        alt = f"{alt} {planned.reach if planned.data else ''}".strip() or planned.title
        named = f'class="panel" role="img" aria-label="{escape(xml_text(alt))}"'
        row, column = divmod(number, plan.columns)
        place = (column * width, start + row * height, width, height)
        parts.append(_svg(inside, place, style, named))
    total = start + (row + 1) * height
    whole = {
        "viewBox": f"0 0 {plan.width * POINTS:.1f} {total:.1f}",
        "width": round(plan.width * POINTS * SCREEN, 1),
        "height": round(total * SCREEN, 1),
    }
    attributes = f"style=\"--columns: {plan.columns}\" data-place='{json.dumps(whole)}'"
    svg = f'<div class="panels" {attributes}>{"".join(parts)}</div>'
    return RenderedFigure(drawing.name, drawing.caption, svg, plan.width, plan.columns)


def _legend(
    entries: Sequence[tuple[str, float]], width: float, style: FigureStyle
) -> tuple[str, float]:
    """Return the SVG elements of a legend, and the height of the legend in points. If an entry does
    not fit into the `width` of the figure, in inches, it begins a new line.
    """
    parts, x, y, line = [], 0.0, 0.0, 1.4 * (style.size - 1)
    for inside, wide in entries:
        if x > 0 and x + wide > width * POINTS:
            x, y = 0.0, y + line
        parts.append(_svg(inside, (x, y, wide, line), style, 'class="key"'))
        x += wide + 6
    return "".join(parts), y + line if entries else 0.0


def _svg(
    inside: str, place: tuple[float, float, float, float], style: FigureStyle, attributes: str
) -> str:
    """Return an `<svg>` element with the contents `inside`. `place` is its position in the whole
    figure, in points: left, top, width and height. The limits of its width keep the letters
    readable on narrow and on wide pages, and as large as in the other figures.
    """
    family = escape(f"{style.font}, sans-serif" if style.font else "sans-serif")
    where = dict(
        zip(("x", "y", "width", "height"), (round(number, 1) for number in place), strict=True)
    )
    _, _, width, height = place
    ends = f"min-width: {width * SMALLEST / (style.size - 1):.0f}px; "
    ends += f"max-width: {width * SCREEN:.0f}px"
    return (
        f'<svg {attributes} xmlns="http://www.w3.org/2000/svg" width="{width * SCREEN:.1f}" '
        f'height="{height * SCREEN:.1f}" viewBox="0 0 {width:.1f} {height:.1f}" '
        f'font-family="{family}" style="{ends}" data-place=\'{json.dumps(where)}\'>{inside}</svg>'
    )


def _panel(
    sheets: list[Sketch],
    panel: Panel,
    heading: str,
    frame: tuple[float, float, float, float],
    style: FigureStyle,
) -> str:
    """Return the SVG of a panel, with its title above it and the label of its x axis below it.
    `frame`, in points, holds the space to the left of the axes, the space above them, and the width
    and the height of the whole panel.
    """
    left, start, width, height = frame
    size, right = style.size - 1, width - 6 - max(sheet.right for sheet in sheets)
    below = size + 3 + 1.3 * style.size
    stop, gap = height - below - 4, 7
    parts = [text(heading, left, start - 4, size)] if heading else []
    shares = [sheet.share for sheet in sheets]
    axes_height = stop - start - gap * (len(sheets) - 1)
    for place, sheet in enumerate(sheets):
        end = start + axes_height * sheet.share / sum(shares)
        label = panel.y_labels[place] if place < len(panel.y_labels) else ""
        parts.append(_axes(sheet, (left, right, start, end), label, left, place == len(sheets) - 1))
        start = end + gap
    parts.append(text(panel.x_label, (left + right) / 2, stop + below, style.size, "middle"))
    return "".join(parts)


def _filled(draw: Any, stack: Sequence[float], columns: int, size: float) -> list[Sketch]:
    """Draw a panel on new axes, and return these axes from top to bottom. They share the x axis."""
    sheets = [Sketch(size) for _ in stack]
    for sheet, share in zip(sheets, stack, strict=True):
        sheet.share, sheet.xaxis = share, sheets[0].xaxis
        sheet.xaxis.most = 5 if columns < 2 else 4
        sheet.yaxis.most = 6 if len(stack) == 1 else 4
    draw(*sheets)
    return sheets


def _share_axes(panels: list[list[Sketch]], columns: int, all_x: bool, common_y: str) -> None:
    """Give equal ranges to axes of different panels: to all x axes if `all_x` is True, and to the y
    axes of each row or of all panels, as `common_y` says.
    """
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
    """Return the space, in points, that the labels to the left of a panel need: the labels of the
    ticks and of the y axes.
    """
    words = [words for sheet in panel for words in sheet.yaxis.labels().values()]
    longest = max((_width(line) for label in words for line in label.split("\n")), default=0.0)
    lines = max((label.count("\n") + 1 for label in labels if label), default=0)
    return size * longest + 6 + lines * (size + 2.5)


def _width(words: str) -> float:
    """Return the estimated width of a text as a multiple of its font size."""
    return sum(WIDE if letter in "mwMW" else LETTER for letter in words)


def _axes(
    sheet: Sketch, frame: tuple[float, float, float, float], label: str, room: float, last: bool
) -> str:
    """Return the SVG of axes with everything that is drawn on them. `frame` holds their left,
    right, upper and lower end, in points.
    """
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


def _entry(label: str, look: dict[str, Any], style: FigureStyle) -> tuple[str, float]:
    """Return the SVG of one entry of the legend, and its width in points."""
    label, size = title_of(label), style.size - 1
    y = size
    if "facecolor" in look:
        inside = face({"edgecolor": "none", "hatch": None} | look)
        inside += f' fill-opacity="{look["alpha"]:g}"' if "alpha" in look else ""
        mark = box(1, y - size * 0.7, 1 + 2 * size, y, inside)
    else:
        at = y - size * 0.35
        line = look | {"marker": None}
        ends = np.array([1, 1 + 2 * size])
        mark = line_svg(ends, np.full(2, at), line)
        mark += line_svg(np.array([1 + size]), np.full(1, at), look | {"linestyle": "none"})
    width = (_width(label) + 4.5) * size
    inside = mark + text(label, 1 + 2.5 * size, y, size)
    return inside, width
