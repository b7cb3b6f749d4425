"""Diagrams of the pages that explain mapmore; `concept_figures.py` computes what they draw."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch, Rectangle

QUESTION, ANSWER = "#fff3d6", "#dbe9f6"
CHOICES = (
    (
        "Does the output depend only on\nthe present values of the inputs?",
        "no",
        "Model with memory\nfriction: play, stop; creep: slow;\nringing: resonance; other: lags",
    ),
    (
        "Was one input held constant during\neach recording (levels)?",
        "no",
        "One surface over all inputs\nsegment: {pressure: none}",
    ),
    (
        "Does a known formula describe\nthe curves at least roughly?",
        "yes",
        "Formula plus pieces\nmodel: {backbone: sarosi}",
    ),
    (
        "Do you want to choose segments\nand terms yourself?",
        "no",
        "Structure search\nno dictionary, no model",
    ),
    (
        "You have curves at levels, no formula,\nand you want to decide yourself:",
        "",
        "Pieces (segments)\nsegment, dictionary, fit, fuse",
    ),
)
"""Question, the answer that leads to the right, and the model that stands there."""


def box(axes: Any, place: tuple[float, float], text: str, color: str, width: float) -> None:
    """Draw a text in a rounded box around a point."""
    height = 3.4 + 1.9 * text.count("\n")
    corner = place[0] - width / 2, place[1] - height / 2
    style = "round,pad=0.6"
    axes.add_patch(FancyBboxPatch(corner, width, height, style, fc=color, ec="0.4", linewidth=0.8))
    axes.text(*place, text, ha="center", va="center", fontsize=8)


def arrow(axes: Any, start: tuple[float, float], end: tuple[float, float], word: str) -> None:
    """Draw an arrow with the answer beside it."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "0.3"})
    middle = np.add(start, end) / 2
    axes.text(middle[0] + 0.6, middle[1] + 0.3, word, fontsize=8, style="italic")


def blank(width: float, height: float) -> tuple[Figure, Any]:
    """Return a figure of this size in inches, and axes over all of it in tenths of an inch."""
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, 10 * width), ylim=(0, 10 * height))
    axes.axis("off")
    return figure, axes


def decision_tree(_numbers: dict[str, list[str]]) -> Figure:
    """Draw which model answers which question; `which-model.md` says the same in words."""
    figure, axes = blank(7.2, 5.2)
    for place, (question, word, answer) in enumerate(CHOICES):
        y = 47 - 10.2 * place
        box(axes, (17, y), question, QUESTION, 29)
        box(axes, (54, y), answer, ANSWER, 29)
        arrow(axes, (32.3, y), (38.5, y), word)
        if place < len(CHOICES) - 1:
            other = {"no": "yes", "yes": "no"}[word]
            arrow(axes, (17, y - 3.6), (17, y - 6.9), other)
    return figure


def block(
    axes: Any, place: tuple[float, float], name: str, ports: tuple[Sequence[str], str]
) -> None:
    """Draw a block of a diagram with its inputs at the left and its output at the right."""
    inputs, output = ports
    axes.add_patch(Rectangle(place, 22, 9, fc="white", ec="0.2", linewidth=1.2))
    axes.text(place[0] + 11, place[1] + 4.5, name, ha="center", va="center", fontsize=9)
    axes.text(place[0] + 11, place[1] - 1.6, "C Caller", ha="center", fontsize=8, color="0.4")
    for y, word in zip((6.3, 2.7), inputs, strict=True):
        axes.text(place[0] + 0.7, place[1] + y, word, va="center", fontsize=7)
    axes.text(place[0] + 21.3, place[1] + 4.5, output, ha="right", va="center", fontsize=7)


def c_caller(_numbers: dict[str, list[str]]) -> Figure:
    """Draw a diagram with the two C Caller blocks that `export-simulink.md` adds."""
    figure, axes = blank(6.6, 3.0)
    blocks = (((25, 18), "muscle_force", "force"), ((25, 4), "muscle_valid", "valid"))
    for place, name, output in blocks:
        block(axes, place, name, (("pressure", "strain"), output))
    for y, word in ((24.3, "pressure [kPa]"), (20.7, "strain [1]")):
        axes.text(1, y, word, va="center", fontsize=8)
    for x, top, down in ((17, 24.3, 10.3), (20, 20.7, 6.7)):
        axes.plot((x, x), (top, down), color="0.2", linewidth=0.9)
        axes.plot(x, top, "o", color="0.2", markersize=3)
        arrow(axes, (12.5, top), (25, top), "")
        arrow(axes, (x, down), (25, down), "")
    for y, word in ((22.5, "force [N]"), (8.5, "1 inside the training\nrange, 0 outside")):
        arrow(axes, (47, y), (51.5, y), "")
        axes.text(52, y, word, va="center", fontsize=8)
    return figure


def campaign_page(numbers: dict[str, list[str]]) -> Figure:
    """Draw the page of a campaign: its table, and the dots of each run."""
    runs, models = numbers["name"], [name for name in numbers if name != "name"]
    errors = {name: np.array(numbers[name], dtype=float) for name in models}
    ratios = [np.exp(np.mean(np.log(errors[name] / errors["sarosi"]))) for name in models]
    figure, axes = blank(7.6, 4.4)
    axes.add_patch(FancyBboxPatch((1.5, 1.5), 73, 41, "round,pad=0.6", fc="white", ec="0.5"))
    axes.text(2.5, 39.6, "Both campaigns of the year", fontsize=12, weight="bold")
    axes.text(2.5, 36.6, "NRMSE of every run and model, in per cent", fontsize=8)
    rows = [("run", *models)]
    rows += [(run, *(f"{errors[name][k]:.3g}" for name in models)) for k, run in enumerate(runs)]
    rows += [("ratio, geometric mean", *(f"{ratio:.3g}" for ratio in ratios))]
    for row, cells in enumerate(rows):
        weight = "bold" if row == 0 else "normal"
        for column, cell in enumerate(cells):
            x, side = (22.5 + 8.5 * column, "right") if column else (2.5, "left")
            color = "#1f5fa8" if column == 0 and 0 < row < len(rows) - 1 else "black"
            look = {"ha": side, "color": color, "weight": weight, "fontsize": 8}
            axes.text(x, 33.6 - 2.3 * row, cell, **look)
    below = figure.add_axes((0.13, 0.155, 0.6, 0.36))
    others = [name for name in models if name != "mapmore"]
    best = np.min([errors[name] for name in others], axis=0)
    dots = {"mapmore": errors["mapmore"], "sarosi": errors["sarosi"], "best of the others": best}
    looks = (("o", "#1f77b4", 6), ("s", "#d62728", 6), ("o", "none", 12))
    for (name, found), (marker, color, size) in zip(dots.items(), looks, strict=True):
        below.plot(
            *(found, runs, marker),
            label=name,
            color=color,
            markersize=size,
            markeredgecolor="0.3",
        )
    below.set(xlabel="NRMSE (%)", ylim=(-0.6, len(runs) - 0.4), xlim=(0, None))
    below.invert_yaxis()
    below.legend(fontsize=7, bbox_to_anchor=(1.02, 1), loc="upper left")
    return figure


NOTES = (
    "Verdict: the error on data that the model has not seen, and the best competitor.",
    "The held-out curve: dots are measured, lines are models.",
    "Error (predicted minus measured): random scatter is good, a shape is not.",
    "Scores: compare the models on held-out data, not on training data.",
    "Further down: equations, segments, terms, and the whole spec.",
)


def annotated_page(numbers: dict[str, list[str]]) -> Figure:
    """Draw the parts of a run's page with the numbers that `first-model.md` explains."""
    strain, measured, *models = (np.array(cells, dtype=float) for cells in numbers.values())
    names, colors = list(numbers)[2:], ("#1f77b4", "#d62728", "#2ca02c")
    scale = np.abs(measured).max()
    nrmse = [100 * np.sqrt(np.mean((model - measured) ** 2)) / scale for model in models]
    figure, axes = blank(7.6, 6.2)
    axes.add_patch(FancyBboxPatch((1.5, 1.5), 47, 59, "round,pad=0.6", fc="white", ec="0.5"))
    axes.text(2.5, 58.2, "muscle: force model", fontsize=12, weight="bold")
    verdict = (
        f"mapmore predicts force with an NRMSE of {nrmse[0]:.3g} % on the held-out data; "
        f"the best competitor (Sárosi) reaches {nrmse[1]:.3g} %: mapmore is better."
    )
    axes.text(2.5, 56.6, textwrap.fill(verdict, 66), fontsize=8, va="top")
    above = figure.add_axes((0.095, 0.53, 0.5, 0.29))
    below = figure.add_axes((0.095, 0.37, 0.5, 0.13), sharex=above)
    above.plot(strain[::6], measured[::6], "k.", markersize=3, label="measured, 350 kPa")
    for name, model, color in zip(names, models, colors, strict=False):
        above.plot(strain, model, color=color, linewidth=1, label=name)
        below.plot(strain, model - measured, color=color, linewidth=1)
    below.axhline(0, color="0.5", linewidth=0.6)
    above.set_ylabel("force [N]")
    below.set(xlabel="strain", ylabel="error [N]")
    above.legend(fontsize=7)
    above.tick_params(labelbottom=False)
    axes.text(2.5, 17.5, "model", fontsize=8, weight="bold")
    axes.text(18, 17.5, "data", fontsize=8, weight="bold")
    axes.text(36, 17.5, "NRMSE [%]", fontsize=8, weight="bold", ha="right")
    for row, (name, error) in enumerate(zip(names, nrmse, strict=True)):
        y = 15.5 - 2 * row
        axes.text(2.5, y, name, fontsize=8)
        axes.text(18, y, "validate (held out)", fontsize=8)
        axes.text(36, y, f"{error:.2f}", fontsize=8, ha="right")
    axes.text(2.5, 5.2, "The model in physical units · Segments · Terms · Notes, spec", fontsize=8)
    marks = ((46, 55.5), (46, 47), (46, 27), (46, 14), (46, 5.6))
    for number, (place, note) in enumerate(zip(marks, NOTES, strict=True), 1):
        axes.text(
            *place,
            str(number),
            ha="center",
            va="center",
            color="white",
            weight="bold",
            bbox={"boxstyle": "circle", "fc": "#444444", "ec": "none"},
        )
        text = textwrap.fill(note, 32)
        axes.text(51, place[1], text, fontsize=8.5, va="center")
    return figure
