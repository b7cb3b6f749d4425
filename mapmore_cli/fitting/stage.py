"""What a stage is: five parts, the same for each of the six."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.tables import RawTable
from mapmore_cli.study.experiment import ExperimentSpec

Warn = Callable[[str], None]
Progress = Callable[[str, int, int], None]
"""`progress(what, done, total)`: called as long work goes on."""


@dataclass(frozen=True)
class Need:
    """A run whose model a stage reads.

    - `key`: the path of its spec; with `overrides`, the name of a variation of the study itself,
      which is a run of its own, `<name of the study>.<key>`.
    - `overrides`: the settings of a variation, as those of `--set`.
    - `compared`: whether the model that it has is read as it is, and made only where there is none.
    """

    key: str
    overrides: tuple[str, ...] = ()
    compared: bool = False


@dataclass(frozen=True)
class Workspace:
    """Where a stage works.

    `run_dir` holds the committed outputs of the stages before; a stage writes its own into `out`
    under their final names, and the runner swaps them in whole. `spec_dir` is the folder of the
    spec, from which the recordings are found. `needed` has the run folders of the runs that the
    stage needs, by their path in the spec, or the name of a variation. `spec_text` is the spec with
    its defaults filled in, as the report shows it; `searched` where the structure in it was found
    by a search. `tables` are recordings in memory, by what `data.files` calls them.
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
        """The results of the stages before."""
        return RunFiles(self.run_dir)


@dataclass(frozen=True)
class Stage:
    """One step of the pipeline.

    - `name`: `ingest`, `segment`, ...
    - `revision`: raised when the stage's numbers or its file change: results of older revisions are
      then stale.
    - `outputs`: files or folders that it writes, relative to the run folder.
    - `reads`: the stage's slice of the spec: a frozen dataclass or a pydantic model, dumped to JSON
      for the fingerprint.
    - `run`: does the work, given the slice.
    - `sources`: files outside the run folder that it reads (recordings), given the spec and its
      folder.
    - `needs`: runs whose models it reads.
    """

    name: str
    revision: int
    outputs: tuple[str, ...]
    reads: Callable[[ExperimentSpec], Any]
    run: Callable[[Any, Workspace], None]
    sources: Callable[[ExperimentSpec, Path], Sequence[Path]] = lambda _spec, _folder: ()
    needs: Callable[[ExperimentSpec], Sequence[Need]] = lambda _spec: ()
