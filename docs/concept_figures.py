"""Draw the pictures of the pages that explain mapmore: `python docs/concept_figures.py [NAME ...]`.

Each picture is drawn from numbers that stand beside it, as `figures/overfitting.csv` beside
`figures/overfitting.svg`. The SVG file carries a fingerprint of these numbers and of the function
that draws them, by which a test sees whether the picture is older than either. The diagrams with
boxes are in `concept_diagrams.py`, the computations in `concept_numbers.py`.
"""

from __future__ import annotations

import csv
import hashlib
import inspect
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from concept_diagrams import annotated_page, c_caller, campaign_page, decision_tree
from concept_numbers import (
    Numbers,
    band,
    beyond,
    campaign,
    candidates,
    errors_by_terms,
    held_out_curve,
    loops,
    outer_level,
)
from joint_diagram import joint
from matplotlib.figure import Figure
from pages import DOCS, write_rows, write_tables

from mapmore_cli.reporting.table import Column, Table

FIGURES = DOCS / "figures"
LOOK: dict[Any, Any] = {
    "svg.hashsalt": "mapmore",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}
OURS, OTHER, THIRD = "#1f77b4", "#d62728", "#2ca02c"


@dataclass(frozen=True)
class Picture:
    """A picture: how its numbers are computed in an empty folder, and how they are drawn."""

    numbers: Callable[[Path], Numbers]
    draw: Callable[[dict[str, list[str]]], Figure]


def draw_overfitting(numbers: dict[str, list[str]]) -> Figure:
    """Draw both errors over the number of terms."""
    terms, train, held_out = columns(numbers)
    figure = Figure(figsize=(5.6, 3.1), layout="constrained")
    axes = figure.add_subplot()
    axes.semilogy(terms, train, "o-", color=OURS, label="training data (80, 200, 500 kPa)")
    axes.semilogy(terms, held_out, "s--", color=OTHER, label="held-out data (350 kPa)")
    best = int(np.argmin(held_out))
    axes.annotate(
        "smallest held-out error",
        (terms[best], held_out[best]),
        (terms[best] - 2.6, held_out[best] * 3.2),
        arrowprops={"arrowstyle": "->"},
    )
    axes.annotate(
        "overfitting",
        (terms[-1], held_out[-1]),
        (terms[-1] - 2.4, held_out[-1] * 0.75),
        arrowprops={"arrowstyle": "->"},
    )
    axes.set(xlabel="number of terms", ylabel="NRMSE [%]", xticks=terms, yticks=[1, 3, 10, 30])
    axes.set_yticks([], minor=True)
    axes.set_yticklabels(["1", "3", "10", "30"])
    axes.legend(loc="upper left", bbox_to_anchor=(0.08, 1.0))
    return figure


def draw_beyond(numbers: dict[str, list[str]]) -> Figure:
    """Draw the three forces, with the range beyond the data shaded."""
    strain, *forces, outside = columns(numbers)
    figure = Figure(figsize=(5.6, 3.1), layout="constrained")
    axes = figure.add_subplot()
    first = strain[np.argmax(outside > 0)]
    axes.axvspan(first, strain[-1], color="0.9", label="outside_range: true")
    axes.axhline(0, color="0.5", linewidth=0.8)
    for word, force, line, color in zip(
        ("continue", "saturate", "zero"),
        forces,
        ("-", "--", ":"),
        (OTHER, OURS, THIRD),
        strict=True,
    ):
        axes.plot(strain, force, line, color=color, label=f"extrapolation: {word}")
    at = int(np.argmin(np.abs(strain - 0.3)))
    axes.plot(strain[at], forces[0][at], "o", color=OTHER)
    axes.annotate(
        f"{forces[0][at]:.0f} N at a strain of 0.3".replace("-", "\N{MINUS SIGN}"),
        (strain[at], forces[0][at]),
        (0.19, -52),
        arrowprops={"arrowstyle": "->"},
    )
    axes.set(xlabel="strain", ylabel="force at 350 kPa [N]", ylim=(-80, 220), xlim=(0.08, 0.35))
    axes.legend(loc="upper right")
    return figure


def draw_loops(numbers: dict[str, list[str]]) -> Figure:
    """Draw the held-out loops of three models beside the measured ones."""
    _, pressure, measured, *found = columns(numbers)
    figure = Figure(figsize=(7.6, 2.9), layout="constrained")
    titles = ("static", "with play", "with play and slow")
    for place, (title, model) in enumerate(zip(titles, found, strict=True)):
        axes = figure.add_subplot(1, 3, place + 1)
        axes.plot(pressure, measured, color="0.65", linewidth=3, label="measured")
        axes.plot(pressure, model, color=OTHER, linewidth=1, label="model")
        axes.set(title=title, xlabel="pressure [kPa]")
    figure.axes[0].set_ylabel("displacement [mm]")
    figure.axes[0].legend(loc="upper left")
    return figure


def draw_band(numbers: dict[str, list[str]]) -> Figure:
    """Draw the prediction within its interval."""
    strain, force, low, high = columns(numbers)
    figure = Figure(figsize=(5.6, 3.1), layout="constrained")
    axes = figure.add_subplot()
    axes.fill_between(strain, low, high, color=OURS, alpha=0.25, linewidth=0, label="95 % interval")
    axes.plot(strain, force, color=OURS, label="prediction at 350 kPa")
    axes.set(xlabel="strain", ylabel="force [N]")
    axes.legend()
    return figure


def draw_candidates(numbers: dict[str, list[str]]) -> Figure:
    """Draw error over number of parameters; the chosen candidate is filled."""
    names = ("parameters", "error", "chosen")
    parameters, errors, chosen = columns({name: numbers[name] for name in names})
    figure = Figure(figsize=(6.4, 3.3), layout="constrained")
    axes = figure.add_subplot()
    axes.semilogy(parameters, errors, "o", color=OURS, markerfacecolor="white")
    axes.plot(parameters[chosen > 0], errors[chosen > 0], "o", color=OURS, label="taken")
    shown = set()
    for name, x, y in zip(numbers["name"], parameters, errors, strict=True):
        short = name.partition(",")[0].removeprefix("formula ")
        if short not in shown:
            shown.add(short)
            axes.annotate(short, (x, y), (6, 2), textcoords="offset points", fontsize=8)
    axes.set(xlabel="number of parameters", ylabel="left-out error [%]", xlim=(0, 36))
    axes.set_yticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
    axes.set_yticks([], minor=True)
    axes.legend()
    return figure


def draw_outer_level(numbers: dict[str, list[str]]) -> Figure:
    """Draw the measured curve and both predictions."""
    strain, measured, pieces, sarosi = columns(numbers)
    figure = Figure(figsize=(5.6, 3.1), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(strain[::5], measured[::5], "k.", markersize=4, label="measured at 500 kPa")
    axes.plot(strain, pieces, "--", color=OTHER, label="segments, trained up to 350 kPa")
    axes.plot(strain, sarosi, color=OURS, label="Sárosi's formula, trained up to 350 kPa")
    axes.set(xlabel="strain", ylabel="force [N]")
    axes.legend()
    return figure


def columns(numbers: dict[str, list[str]]) -> list[np.ndarray]:
    """Return the columns of a file as arrays."""
    return [np.array([float(cell) for cell in cells]) for cells in numbers.values()]


PICTURES = {
    "annotated-page": Picture(held_out_curve, annotated_page),
    "which-model": Picture(lambda _: {}, decision_tree),
    "c-caller": Picture(lambda _: {}, c_caller),
    "campaign-page": Picture(campaign, campaign_page),
    "joint": Picture(lambda _: {}, joint),
    "overfitting": Picture(errors_by_terms, draw_overfitting),
    "beyond-the-data": Picture(beyond, draw_beyond),
    "memory-loops": Picture(loops, draw_loops),
    "interval-band": Picture(band, draw_band),
    "search-candidates": Picture(candidates, draw_candidates),
    "outer-level": Picture(outer_level, draw_outer_level),
}


def table_of_terms() -> Table:
    """Return training and held-out error by number of terms."""
    rows = zip(*read_numbers("overfitting").values(), strict=True)
    return table(
        "Errors of one polynomial by number of terms",
        ("terms", "training [%]", "held out [%]"),
        [(terms, _short(train), _short(held_out)) for terms, train, held_out in rows],
    )


def table_of_candidates() -> Table:
    """Return the candidates of the search, the best first."""
    rows = zip(*read_numbers("search-candidates").values(), strict=True)
    headings = (
        *("structure", "parameters", "left-out error [%]", "levels left out [%]"),
        *("above the best [%]", "held-out error [%]", "taken"),
    )
    return table(
        "Structures that were tried",
        headings,
        [
            (name, count, *map(_short, errors), "yes" if float(chosen) else "")
            for name, count, *errors, chosen in rows
        ],
    )


def table_of_outer_level() -> Table:
    """Return the errors of both models at the pressure that is held out."""
    _, measured, *models = columns(read_numbers("outer-level"))
    errors = [np.sqrt(np.mean((model - measured) ** 2)) for model in models]
    rows = [
        (name, f"{error:.3g}", f"{100 * error / np.abs(measured).max():.3g}")
        for name, error in zip(("segments", "sarosi"), errors, strict=True)
    ]
    return table("Errors at 500 kPa", ("model", "RMSE [N]", "NRMSE [%]"), rows)


TABLES = {
    "overfitting": ("how-good", "overfitting", table_of_terms),
    "outer-level": ("limits", "outer", table_of_outer_level),
    "search-candidates": ("structure-search", "candidates", table_of_candidates),
}
"""Page, name and maker of the table that shows the numbers of a picture."""


def table(title: str, headings: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of texts."""
    return Table("", title, tuple(map(Column, headings)), tuple(map(tuple, rows)))


def _short(cell: str) -> str:
    return "–" if cell == "nan" else f"{float(cell):.3g}"


def read_numbers(name: str) -> dict[str, list[str]]:
    """Return the numbers of a picture by column, as they stand in its file."""
    path = FIGURES / f"{name}.csv"
    if not path.exists():
        return {}
    with path.open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    return {key: [row[place] for row in rows] for place, key in enumerate(head)}


def fingerprint(name: str) -> str:
    """Return what the picture has to carry: a digest of its numbers and of what draws it."""
    draw = PICTURES[name].draw
    file = Path(inspect.getfile(draw))
    whole = file.name == "concept_diagrams.py"  # whose functions share constants
    source = file.read_text(encoding="utf-8") if whole else inspect.getsource(draw)
    return hashlib.sha256(f"{read_numbers(name)}{source}".encode()).hexdigest()


def write(name: str) -> None:
    """Compute the numbers of a picture, write them, and draw it."""
    picture = PICTURES[name]
    with tempfile.TemporaryDirectory() as folder:
        numbers = picture.numbers(Path(folder))
    if numbers:
        cells = [[_text(cell) for cell in row] for row in zip(*numbers.values(), strict=True)]
        write_rows(FIGURES / f"{name}.csv", [list(numbers), *cells])
    with mpl.rc_context(LOOK):
        figure = picture.draw(read_numbers(name))
        place = FIGURES / f"{name}.svg"
        figure.savefig(place, metadata={"Date": None, "Description": fingerprint(name)})
    if name in TABLES:
        page, title, make = TABLES[name]
        write_tables(DOCS / f"{page}.md", {title: make})


def _text(cell: float | str) -> str:
    return cell if isinstance(cell, str) else f"{float(cell):.6g}"


if __name__ == "__main__":
    for wanted in sys.argv[1:] or PICTURES:
        write(wanted)
