"""Diagrams of the pages that explain mapmore; `concept_figures.py` computes what they draw."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

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
