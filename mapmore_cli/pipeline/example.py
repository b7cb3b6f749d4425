"""Provide the small example study of mapmore, as files or as arrays."""

from __future__ import annotations

import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.storage.atomic import refusals_told, write_own
from mapmore_cli.study.schema import write_schema_beside

SHIPPED = files("mapmore_cli.pipeline") / "shipped"
SPECS = ("study.yaml", "search.yaml", "autumn.yaml")
QUANTITIES = ("time", "pressure", "strain", "force")
"""Columns of an example recording, in s, kPa, 1 and N."""


def write_example(folder: Path) -> list[Path]:
    """Copy the example study and the recordings of its two campaigns into a folder, which is
    created if necessary. Return the paths of the files, the study first. The study is named after
    the folder, so that runs of two copies never overwrite each other.

    Raises WriteError if the folder is not empty or cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise WriteError(f"{folder}: is not an empty folder", "name a new folder")
    name = re.sub(r"[^A-Za-z0-9._-]+", "-", folder.resolve().name).lstrip("._-")[:80] or "example"
    recordings = [(each, folder / each.name) for each in _recordings(SHIPPED)]
    later = [(each, folder / "autumn" / each.name) for each in _recordings(SHIPPED / "autumn")]
    specs = [(SHIPPED / spec, folder / spec) for spec in SPECS]
    with refusals_told(folder):
        (folder / "autumn").mkdir(parents=True)
        for source, path in (*specs, *recordings, *later):
            text = source.read_text(encoding="utf-8")
            write_own(path, re.sub(r"^name: example", f"name: {name}", text, flags=re.MULTILINE))
    write_schema_beside(folder / "study.yaml")
    return [path for _, path in (*specs, *recordings, *later)]


def example_recordings() -> list[dict[str, Array]]:
    """Return the recordings of the study. Time is in s, pressure in kPa and force in N, strain has
    no unit, and each quantity has the shape (n,).
    """
    tables = [each.read_text(encoding="utf-8").splitlines() for each in _recordings(SHIPPED)]
    return [
        dict(zip(QUANTITIES, np.loadtxt(lines, delimiter=",", skiprows=1).T, strict=True))
        for lines in tables
    ]


def _recordings(folder: Traversable) -> list[Traversable]:
    return sorted((each for each in folder.iterdir() if each.name.endswith(".csv")), key=str)
