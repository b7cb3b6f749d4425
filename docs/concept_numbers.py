"""Compute the numbers of the pictures that `concept_figures.py` draws, each in an empty folder."""

from __future__ import annotations

import csv
import json
import os
import runpy
import subprocess
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pages import DOCS

import mapmore_cli as mm
from mapmore_cli.pipeline.example import write_example

Numbers = Mapping[str, Sequence[float] | Sequence[str]]
"""Columns by name."""


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


def candidates(folder: Path) -> Numbers:
    """Search the example; return the parameters of each candidate, its errors in per cent, and how
    far it is above the best.

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
            errors = (100 * row["error"], 100 * row["parts"], 100 * row["excess"], 100 * error)
            rows.append((row["words"], row["parameters"], *errors, float(chosen)))
    names = "name parameters error levels above held_out chosen"
    return named(names, sorted(rows, key=lambda row: row[4]))


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


CAMPAIGN = """\
schema_version: 1
campaign: year
base: study.yaml
relative_to: sarosi
runs:
  - {name: spring, set: {data.files: ["load_cycle_*.csv"]}}
  - {name: autumn, set: {data.files: ["autumn/load_cycle_*.csv"]}}
"""
"""The campaign of `many.md`."""


def campaign(folder: Path) -> Numbers:
    """Run the campaign of `many.md`; return the held-out NRMSE of its models in per cent."""
    example(folder)
    path = folder / "muscle" / "campaign.yaml"
    path.write_text(CAMPAIGN, encoding="utf-8")
    command = [sys.executable, "-m", "mapmore_cli", "batch", str(path), "-q", "--jobs", "1"]
    command += ["--runs", str(folder / "runs")]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    models, rows = ("mapmore", "sarosi", "polynomial_2", "plane", "quadratic", "cubic"), []
    for name in ("spring", "autumn"):
        table = json.loads((folder / "runs" / name / "scores.json").read_text("utf-8"))
        errors = {
            row["model"]: 100 * row["nrmse"]
            for row in table["scores"]
            if (row["split"], row["curve"]) == ("validate", "all")
        }
        rows.append((name, *(errors[model] for model in models)))
    return named(" ".join(("name", *models)), rows)


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


def named(names: str, rows: Sequence[Sequence[Any]]) -> Numbers:
    """Return rows as columns with these names."""
    return dict(zip(names.split(), zip(*rows, strict=True), strict=True))
