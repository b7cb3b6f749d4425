"""Diagram of the joint of `joint.md`: two muscles that pull at a pulley from both sides."""

from __future__ import annotations

import numpy as np
from concept_diagrams import blank
from matplotlib.figure import Figure
from matplotlib.patches import Arc, Circle, FancyBboxPatch, Rectangle

RADIUS, CENTRE = 6.0, (50.0, 13.0)


def joint(_numbers: dict[str, list[str]]) -> Figure:
    """Draw the pulley, the flexor above and the extensor below it, with the symbols of the page."""
    figure, axes = blank(6.8, 2.6)
    x, y = CENTRE
    axes.add_patch(Rectangle((2, 3), 1.5, 20, fc="0.7", ec="0.3"))
    axes.add_patch(Circle(CENTRE, RADIUS, fc="white", ec="0.2", linewidth=1.5))
    axes.plot(x, y, "o", color="0.2", markersize=4)
    for side, color, name, index in ((1, "#dbe9f6", "flexor", 1), (-1, "#fff3d6", "extensor", 2)):
        height = y + side * RADIUS
        axes.plot((3.5, x), (height, height), color="0.2", linewidth=1.2, zorder=0)
        corner = (8, height - 1.8)
        style = "round,pad=0.2,rounding_size=1.6"
        axes.add_patch(FancyBboxPatch(corner, 24, 3.6, style, fc=color, ec="0.3"))
        words = f"{name}: pressure $P_{index}$, strain $\\varepsilon_{index}$"
        axes.text(20, height, words, ha="center", va="center", fontsize=8)
        arrow = {"arrowstyle": "->", "color": "0.2", "linewidth": 1.5}
        axes.annotate("", (36, height), (44, height), arrowprops=arrow)
        axes.text(
            40, height + side * 1.6, f"force $F_{index}$", ha="center", va="center", fontsize=8
        )
    angle = np.radians(-35)
    rim = x + RADIUS * np.cos(angle), y + RADIUS * np.sin(angle)
    axes.plot((x, rim[0]), (y, rim[1]), color="0.4", linewidth=0.9)
    axes.text(x + 1.6, y - 3.6, "$r$", fontsize=9)
    axes.add_patch(Arc(CENTRE, 17, 17, theta1=-30, theta2=40, color="0.2", linewidth=1.2))
    end = np.radians(40)
    tip = x + 8.5 * np.cos(end), y + 8.5 * np.sin(end)
    axes.annotate("", tip, (tip[0] + 0.35, tip[1] - 0.4), arrowprops={"arrowstyle": "->"})
    axes.text(x + 9.4, y, "angle $\\theta$,\ntorque $\\tau$", va="center", fontsize=8)
    return figure
