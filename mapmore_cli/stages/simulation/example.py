"""`mapmore example`: a small study with its recordings, for somebody who has the program and no data yet."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.simulation import SimulationSpec
from mapmore_cli.stages.pipeline.stage import Progress
from mapmore_cli.stages.simulation.simulate import simulate
from mapmore_cli.storage.atomic import refusals_told, write_text

SPECS = ("rig.yaml", "study.yaml")
STUDY = "study.yaml"


def write_example(folder: Path, progress: Progress) -> list[Path]:
    """Write the study, the rig and its simulated recordings into a folder, which is made where missing; their paths, the study first.

    Raises
    ------
    WriteError
        Where the folder is not empty, or cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise WriteError(f"{folder}: is not an empty folder", "name a new folder")
    with refusals_told(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name in SPECS:
            write_text(folder / name, files("mapmore_cli.stages.simulation").joinpath("example_study", name).read_text(encoding="utf-8"))
    recordings = simulate(load_as(folder / "rig.yaml", SimulationSpec, ()).spec, folder, progress)
    return [folder / STUDY, folder / "rig.yaml", *recordings]
