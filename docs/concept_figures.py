"""Draw the pictures of the pages that explain mapmore: `python docs/concept_figures.py [NAME ...]`.

Each picture is drawn from numbers that stand beside it, as `figures/overfitting.csv` beside
`figures/overfitting.svg`. The SVG file carries a fingerprint of these numbers and of the function
that draws them, by which a test sees whether the picture is older than either. The diagrams without
numbers are in `concept_diagrams.py`.
"""

from __future__ import annotations

import csv
import hashlib
import inspect
import json
import os
import runpy
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import yaml
from concept_diagrams import annotated_page, decision_tree
from matplotlib.figure import Figure
from pages import DOCS, write_rows, write_tables

import mapmore_cli as mm
from mapmore_cli.pipeline.example import write_example
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
MEASURED, OURS, OTHER, THIRD = "0.15", "#1f77b4", "#d62728", "#2ca02c"

Numbers = Mapping[str, Sequence[float] | Sequence[str]]


@dataclass(frozen=True)
class Picture:
    """A picture: how its numbers are computed in an empty folder, and how they are drawn."""

    numbers: Callable[[Path], Numbers]
    draw: Callable[[dict[str, list[str]]], Figure]


def example(folder: Path) -> dict[str, Any]:
    """Write the example study into a folder and return its spec."""
    write_example(folder / "muscle")
    spec: dict[str, Any] = yaml.safe_load((folder / "muscle" / "study.yaml").read_text("utf-8"))
    return spec


def fitted(folder: Path, spec: Mapping[str, Any], **sections: Any) -> Any:
    """Fit the example with some sections replaced and without competitors."""
    data = {key: spec["data"][key] for key in ("columns", "levels", "split", "cycles")}
    names = ("segment", "dictionary", "fit", "fuse", "muscle")
    settings: dict[str, Any] = {name: spec[name] for name in names if name in spec}
    settings["validate"] = {"simple": False, "against": []}
    files: list[Any] = sorted(str(path) for path in (folder / "muscle").glob("load_cycle_*.csv"))
    with warnings.catch_warnings(action="ignore"):  # of points beyond the data, which are drawn
        return mm.fit(files, **{**data, **settings, **sections})


def errors_by_terms(folder: Path) -> Numbers:
    """Compute training and held-out NRMSE in per cent of one polynomial of 1 to 10 terms."""
    spec, rows = example(folder), []
    for count in range(1, 11):
        model = fitted(
            folder,
            spec,
            segment={"pressure": "none"},
            dictionary=[{"polynomial": {"of": ["strain", "pressure"], "order": 3}}],
            fit={"max_terms": count, "tolerance": 1e-12},
            fuse=None,
        )
        found = {row["split"]: row["nrmse"] for row in model.scores if row["curve"] == "all"}
        rows.append((count, 100 * found["train"], 100 * found["validate"]))
    return named("terms train validate", rows)


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


def beyond(folder: Path) -> Numbers:
    """Compute the force at 350 kPa over the strain, within the data and beyond, in three ways."""
    spec = example(folder)
    strain = np.linspace(0, 0.35, 71)
    found = []
    for word in ("continue", "saturate", "zero"):
        model = fitted(folder, spec, fuse={**spec["fuse"], "extrapolation": word})
        with warnings.catch_warnings(action="ignore"):
            found.append(model(pressure=np.full_like(strain, 350), strain=strain))
        outside = model.outside_range(pressure=np.full_like(strain, 350), strain=strain)
    rows = np.column_stack([strain, *found, outside])
    return named("strain continue saturate zero outside", rows.tolist())


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


def loops(folder: Path) -> Numbers:
    """Compute measured and predicted displacement of the record of `models-with-memory.md`."""
    page = (DOCS / "models-with-memory.md").read_text(encoding="utf-8")
    script = page[page.index("# creep/record.py") :].partition("```")[0]
    (folder / "creep").mkdir()
    (folder / "creep" / "record.py").write_text(script, encoding="utf-8")
    here = Path.cwd()
    os.chdir(folder)
    try:
        runpy.run_path("creep/record.py")
    finally:
        os.chdir(here)
    record = np.loadtxt(folder / "creep" / "record.csv", delimiter=",", skiprows=1).T
    table = dict(zip(("time", "pressure", "displacement"), record, strict=True))
    polynomial = {"polynomial": {"of": ["pressure"], "order": 1}}
    slow = {"slow": {"of": ["pressure"], "tau": [0.5, 1, 2, 4]}}
    play = {"play": {"of": ["pressure"], "widths": [0.05, 0.1, 0.2]}}
    found = [
        mm.fit(
            table,
            target={"column": "displacement"},
            units={"displacement": "mm"},
            split={"validate": {"last": 0.5}},
            dictionary=families,
            fit={"max_terms": 4},
        ).predict(table)
        for families in ([polynomial], [polynomial, play], [polynomial, slow, play])
    ]
    rows = np.column_stack([*record, *found])[400:]
    return named("time pressure displacement static play play_and_slow", rows.tolist())


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


def band(folder: Path) -> Numbers:
    """Compute the force at 350 kPa with its 95 % interval, and the held-out samples."""
    spec = example(folder)
    both = ["load_cycle_*.csv", "autumn/load_cycle_*.csv"]
    for key, value in (("name", "sure"), ("validate", {"intervals": True, "simple": False})):
        spec[key] = value
    spec["data"]["files"] = both
    spec["report"] = {"figures": []}
    path = folder / "muscle" / "sure.yaml"
    path.write_text(yaml.safe_dump(spec), encoding="utf-8")
    with warnings.catch_warnings(action="ignore"):
        run = mm.run(path, folder / "runs")
    rows = []
    for strain in np.linspace(0, 0.24, 49):
        low, high = run.model.interval(0.95, pressure=350.0, strain=float(strain))
        rows.append((strain, run.model(pressure=350.0, strain=float(strain)), low, high))
    return named("strain force low high", rows)


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


def candidates(folder: Path) -> Numbers:
    """Search the example; return parameters and errors in per cent of each candidate.

    The held-out error is known for the chosen candidate and for those that are competitors too.
    """
    example(folder)
    with warnings.catch_warnings(action="ignore"):
        run = mm.run(folder / "muscle" / "search.yaml", folder / "runs")
    found = json.loads((run.run_dir / "search.json").read_text(encoding="utf-8"))
    held_out = {
        row["model"]: row["nrmse"]
        for row in run.scores
        if (row["split"], row["curve"]) == ("validate", "all")
    }
    rows = []
    for place, row in enumerate(found["tried"]):
        chosen = place == found["chosen"]
        model = "m2_settings" if row["family"] == "papers" else row["words"].split()[-1]
        error = held_out.get("mapmore" if chosen else model, np.nan)
        if row["family"] != "black box":
            rows.append(
                (row["words"], row["parameters"], 100 * row["error"], 100 * error, float(chosen))
            )
    return named("name parameters error held_out chosen", sorted(rows, key=lambda row: row[2]))


def draw_candidates(numbers: dict[str, list[str]]) -> Figure:
    """Draw error over number of parameters; the chosen candidate is filled."""
    parameters, errors, _, chosen = columns({k: numbers[k] for k in list(numbers)[1:]})
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


def held_out_curve(folder: Path) -> Numbers:
    """Run the example; return the held-out curve, and the model with its competitors on it."""
    example(folder)
    with warnings.catch_warnings(action="ignore"):
        run = mm.run(folder / "muscle" / "study.yaml", folder / "runs")
    table = folder / "fit.csv"
    words = ("figure", run.run_dir, "fit", "--curve", "350", "-o", folder / "fit.svg")
    command = [sys.executable, "-m", "mapmore_cli", *map(str, words), "--data", str(table)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    with table.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    keys = ("strain [1]", "force [N]", "mapmore [N]", "sarosi [N]", "polynomial_2 [N]")
    found = [[float(row[key]) for key in keys] for row in rows]
    return named("strain measured mapmore sarosi polynomial_2", found)


def outer_level(folder: Path) -> Numbers:
    """Hold out the highest pressure; return its curve and what two models predict there."""
    spec = example(folder)
    split = {"validate": {"pressure": [500]}}
    pieces = fitted(folder, spec, split=split)
    formula = {"type": "literature", "name": "sarosi"}
    sections = {"segment": None, "dictionary": None, "fit": None, "fuse": None}
    sarosi = fitted(folder, spec, split=split, model=formula, **sections)
    (curve,) = pieces.held_out
    inputs = {name: curve.columns[name] for name in ("pressure", "strain")}
    with warnings.catch_warnings(action="ignore"):
        rows = zip(
            inputs["strain"],
            curve.columns["force"],
            pieces(**inputs),
            sarosi(**inputs),
            strict=True,
        )
    return named("strain measured segments sarosi", [[float(x) for x in row] for row in rows])


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


def named(names: str, rows: Sequence[Sequence[Any]]) -> Numbers:
    """Return rows as columns with these names."""
    return dict(zip(names.split(), zip(*rows, strict=True), strict=True))


def columns(numbers: dict[str, list[str]]) -> list[np.ndarray]:
    """Return the columns of a file as arrays."""
    return [np.array([float(cell) for cell in cells]) for cells in numbers.values()]


PICTURES = {
    "annotated-page": Picture(held_out_curve, annotated_page),
    "which-model": Picture(lambda _: {}, decision_tree),
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
    return table(
        "Structures that were tried",
        ("structure", "parameters", "left-out error [%]", "held-out error [%]", "taken"),
        [
            (name, count, _short(error), _short(held_out), "yes" if float(chosen) else "")
            for name, count, error, held_out, chosen in rows
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
    source = inspect.getsource(PICTURES[name].draw)
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
