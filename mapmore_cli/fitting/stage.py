"""Define what a stage of the pipeline is, and what it works with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
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
    """Another run, whose model a stage reads.

    - `key`: path of the spec of this run. With `overrides`, it is the name of a variation of the
      study, and the run is called `<name of the study>.<key>`.
    - `overrides`: settings of a variation, in the form of `--set`.
    - `compared`: True if the study is only compared with this run. An existing model of the run is
      then used unchanged, and the run is made only if it has no model yet.
    """

    key: str
    overrides: tuple[str, ...] = ()
    compared: bool = False


@dataclass(frozen=True)
class Workspace:
    """Folders, files and messages with which a stage works.

    `run_dir` holds the committed outputs of the earlier stages. A stage writes its own outputs into
    the folder `out` under their final names, and the runner then moves all of them into place
    together. `spec_dir` is the folder of the spec; paths of recordings are relative to it. `needed`
    holds the folders of the runs that the stage needs, by their path in the spec or the name of a
    variation. `spec_text` is the spec with its defaults, as the report shows it; `searched` is True
    if its structure was found by a search. `tables` holds recordings in memory, by their names in
    `data.files`.
    """

    run_dir: Path
    out: Path
    spec_dir: Path
    progress: Progress
    warn: Warn
    needed: Mapping[str, Path] = field(default_factory=dict)
    spec_text: str = ""
    searched: bool = False
    tables: Mapping[str, RawTable] = field(default_factory=dict)

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
    - `outputs`: files or folders that it writes, relative to the run folder.
    - `reads`: function that returns the slice of the spec that the stage depends on: a frozen
      dataclass or a pydantic model, which is dumped to JSON for the fingerprint.
    - `run`: function that does the work, given the slice.
    - `sources`: function that returns the files outside the run folder that it reads (recordings),
      given the spec and its folder.
    - `needs`: function that returns the runs whose models it reads.
    """

    name: str
    revision: int
    outputs: tuple[str, ...]
    reads: Callable[[ExperimentSpec], Any]
    run: Callable[[Any, Workspace], None]
    sources: Callable[[ExperimentSpec, Path], Sequence[Path]] = lambda _spec, _folder: ()
    needs: Callable[[ExperimentSpec], Sequence[Need]] = lambda _spec: ()
