"""Define the class `Stage`, a step of the pipeline, and the objects with which a stage works."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import Warn
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.tables import RawTable
from mapmore_cli.study.experiment import ExperimentSpec

Progress = Callable[[str, int, int], None]
"""Function `progress(what, done, total)` that is called during long work."""


@dataclass(frozen=True)
class Need:
    """Another run, whose model is the input of a stage.

    - `key`: path of the spec of this run. If there are `overrides`, the run is a variation of the
      study, `key` is the name of the variation, and the run is called `<name of the study>.<key>`.
    - `overrides`: settings of a variation, in the form of `--set`.
    - `compared`: True if the model of this run is only a competitor of the study's model. If the
      run has a model already, this model is used unchanged, even if it is out of date. If the run
      has no model yet, the model is made.
    """

    key: str
    overrides: tuple[str, ...] = ()
    compared: bool = False


@dataclass(frozen=True)
class Workspace:
    """Folders, files and messages with which a stage works.

    `run_dir` holds the outputs of all stages that are finished. A stage writes its own outputs into
    the folder `out` under their final names, and the runner then moves all of them into place
    together. `spec_dir` is the folder of the spec; paths of recordings are relative to it. `needed`
    holds the folders of the runs that the stage needs, by their path in the spec or the name of a
    variation. `spec_text` is the spec with its defaults, as the report shows it; `searched` is True
    if the structure of the model was found by a search. `tables` holds recordings in memory, by
    their names in `data.files`.
    """

    run_dir: Path
    out: Path
    spec_dir: Path
    progress: Progress
    warn: Warn
    needed: Mapping[str, Path]
    spec_text: str
    searched: bool
    tables: Mapping[str, RawTable]

    @property
    def files(self) -> RunFiles:
        """Files in `run_dir` that the earlier stages wrote."""
        return RunFiles(self.run_dir)


@dataclass(frozen=True)
class Stage:
    """One step of the pipeline.

    - `name`: `ingest`, `segment`, ...
    - `revision`: number that is raised when the stage's numbers or files change, so that older
      results become stale.
    - `outputs`: files or folders that the stage writes, relative to the run folder.
    - `reads`: function that returns the part of the spec on which the stage depends. This part is a
      frozen dataclass or a pydantic model, and its JSON text is a part of the fingerprint.
    - `run`: function that does the work. Its arguments are this part of the spec and a workspace.
    - `sources`: function that takes the spec and its folder, and returns the files outside the run
      folder that the stage reads (recordings).
    - `needs`: function that takes the spec, and returns the runs whose models the stage reads.
    """

    name: str
    revision: int
    outputs: tuple[str, ...]
    reads: Callable[[ExperimentSpec], Any]
    run: Callable[[Any, Workspace], None]
    sources: Callable[[ExperimentSpec, Path], Sequence[Path]] = lambda _spec, _folder: ()
    needs: Callable[[ExperimentSpec], Sequence[Need]] = lambda _spec: ()
