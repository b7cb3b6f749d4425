"""A small measured study and a model that can be reckoned by hand, for the tests of the command
line.
"""

import csv
import json
import re
import time
from pathlib import Path

import numpy as np
import yaml

from mapmore_cli.domain.fits import Scaling
from mapmore_cli.domain.models import CurveFunction, Fusion, Model, Pieces, SegmentFunction
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.validation.comparison import Comparison, CurveChange, TermChange

PROJECT = Path(__file__).resolve().parents[2]
CONFIGS = PROJECT / "configs"
BEGINS = (["example", "muscle"], ["run", "muscle/study.yaml", "-q"])
"""Commands with which most pages begin: they are done once for all tests."""


BAR, EPS = (
    grid.ravel()
    for grid in np.meshgrid([0.8, 1.5, 2.0, 2.5, 3.5], np.linspace(0, 0.2, 25), indexing="ij")
)
"""Pressures in bar and strains of a grid."""


SPEC = """\
schema_version: 1
name: {name}
data:
  files: ["{name}_*.csv"]
  columns: {{pressure: {{column: P, unit: kPa}}, strain: {{column: eps}}, force: {{column: F}}}}
  levels: {{of: pressure, at: {levels}}}
{split}target: static
segment: {{strain: {{method: even, count: 2}}}}
dictionary: [{{polynomial: {{of: [strain], order: 3}}}}]
validate: {{against: [polynomial_2]}}
report: {{figures: [], formats: [html, csv], published: {{source: a paper,
    nrmse: {{mapmore: 0.022}}}}}}
"""


def write_study(
    folder,
    name="bench",
    levels=(100, 200, 300),
    held_out=(200,),
    samples=40,
):
    """A spec with one recording for each pressure; the force is `2 P (1 - 3 eps) - 40`, slightly
    noisy.
    """
    rng = np.random.default_rng(5)
    for level in levels:
        strain = np.linspace(0.0, 0.05 + 0.0004 * level, samples)
        write_recording(
            folder,
            name,
            level,
            strain,
            2 * level * (1 - 3 * strain) - 40 + rng.normal(0, 0.3, strain.size),
        )
    spec = folder / f"{name}.yaml"
    split = f"  split: {{validate: {{pressure: {list(held_out)}}}}}\n" if held_out else ""
    spec.write_text(SPEC.format(name=name, levels=list(levels), split=split))
    return spec


def write_slow_study(folder, name):
    """A study whose segmentation takes many seconds, so that a test can end it at work."""
    spec = write_study(folder, name, samples=15_000)
    edit(spec, "method: even", "method: optimal")
    return spec


def wait_until(true, seconds=30.0):
    """Wait for something that another process does."""
    deadline = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


def write_recording(folder, name, level, strain, force):
    """The recording of one pressure."""
    lines = [f"{level},{e:.5f},{f:.3f}" for e, f in zip(strain, force, strict=True)]
    write_lines(folder / f"{name}_{level}.csv", "P,eps,F", *lines)


def write_lines(path, *lines):
    """A text file of these lines."""
    path.write_text("\n".join(lines) + "\n")


def page_of(run="bench"):
    """The page of a run in the folder of the test."""
    return Path("runs", run, "report", "index.html").read_text()


def write_columns(path, header, *columns, fmt="%.12g"):
    """A table of numbers."""
    rows = np.column_stack(columns)
    np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt=fmt)


def csv_rows(text):
    """The rows of a table by the names of its columns."""
    return list(csv.DictReader(text.splitlines()))


def options(*settings):
    """Settings as arguments of a command."""
    return [part for setting in settings for part in ("--set", setting)]


def by_place(document):
    """The scores of a document, or of the document in a file, by model, split and curve."""
    if isinstance(document, Path):
        document = json.loads(document.read_text())
    return {(row["model"], row["split"], row["curve"]): row for row in document["scores"]}


CURVES = (
    CurveChange(
        "p=1", 1.0, 50, 1.04, 0.6, 1.0, 2.0, -3.25, {"strain": 0.123456, "pressure": 1.0}, False
    ),
    CurveChange("p=2", 2.0, 50, 1.08, 0.4, 2.0, 4.0, 7.5, {"strain": 0.1, "pressure": 2.0}, False),
)
CHANGED = Comparison(
    "a", "b", "torque", "Nm", CURVES, 1.056, (1.05, 1.062), (1.052, 1.06), 0.001, None, 0.02, 0.006,
    (TermChange("p=1/1", "strain", 1.0, 2.0, 0.4, "as noise"),),
)  # fmt: skip
"""A comparison in which the output has changed by 5.6 %."""


OWN = ("mapmore", "validate", "all")
"""The place of the scores of a run's own model on all held-out data."""


def change_forces(path, change, to=None):
    """Write a recording, in its place or `to` another, with other forces."""
    header, *rows = path.read_text().splitlines()
    cells = [row.split(",") for row in rows]
    forces = change(np.array([float(cell[2]) for cell in cells])) if cells else []
    changed = (f"{p},{e},{force:.9g}" for (p, e, _), force in zip(cells, forces, strict=True))
    write_lines(to or path, header, *changed)


def edit(path, old, new):
    """Replace a text of a file, which is there."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def thinned(recordings, folder, every):
    """The load cycles of a shipped muscle in another folder, with one sample in so many, which is
    quicker.
    """
    for path in sorted(recordings.glob("load_cycle_*.csv")):
        head, *rows = path.read_text().splitlines()
        write_lines(folder / path.name, head, *rows[::every])


def without_figures(study, folder, but="", figures=None):
    """A shipped study in another folder, with those that it needs, without figures, which take most
    of the time of a run.

    One may have them: `but`, with some `figures` or with all.
    """
    needs = re.search(r"^needs: (\{.*\})$", study.read_text(encoding="utf-8"), re.MULTILINE)
    quick = (
        {
            role: without_figures(study.parent / path, folder, but, figures).name
            for role, path in yaml.safe_load(needs[1]).items()
        }
        if needs
        else {}
    )
    report = {"figures": [], "formats": ["html", "csv"]}
    if study.stem == but:
        report = {} if figures is None else {"figures": list(figures)}
    document = {"extends": str(study), "name": study.stem, "needs": quick, "report": report}
    (folder / study.name).write_text(yaml.safe_dump(document), encoding="utf-8")
    return folder / study.name


def line(curve, level, slope, height, end):
    """One segment `height + slope strain` over [0, end]."""
    scaling = Scaling("none", "-", ("strain",), np.ones(1), np.zeros(1), 1.0, height)
    one = np.ones(1)
    segment = SegmentFunction(
        np.array([slope]),
        0.1 * one,
        slope * one,
        one,
        50,
        1.0,
        "max_terms",
        f"{curve}/strain:1",
        (1,),
        ("strain",),
        scaling,
    )
    limits = {"strain": (0.0, end), "pressure": (level, level)}
    return CurveFunction(curve, level, limits, (np.array([0.0, end]),), (segment,))


def hand_model():
    """`100 - 400 eps` at 100 kPa up to 0.1, `200 - 500 eps` at 200 kPa up to 0.2, triangles
    between; both continue outside.
    """
    continued = {"pressure": ("continue", "continue"), "strain": ("continue", "continue")}
    curves = (
        line("pressure=100", 100.0, -400.0, 100.0, 0.1),
        line("pressure=200", 200.0, -500.0, 200.0, 0.2),
    )
    return Model(
        name="by-hand",
        output=Quantity("force", "N"),
        inputs=(Quantity("pressure", "kPa"), Quantity("strain", "1")),
        body=Pieces("pressure", ("strain",), curves, Fusion(extrapolation=continued)),
    )


def by_hand(pressure, strain):
    """What `hand_model` says, in plain arithmetic."""
    t = min(max((pressure - 100) / 100, 0.0), 1.0)
    return (1 - t) * (100 - 400 * strain) + t * (200 - 500 * strain)


def held_out(document):
    """The scores of every model on all held-out data, of a document with `scores`."""
    return {
        model: row for (model, *place), row in by_place(document).items() if place == [*OWN[1:]]
    }


def scored_run(mapmore, spec, *arguments):
    """RMSE of every model on the held-out data, and what was done, of one `mapmore run`."""
    document = json.loads(mapmore("run", spec, "--json", "-q", *arguments, code=0).stdout)
    return {model: row["rmse"] for model, row in held_out(document).items()}, document["stages"]
