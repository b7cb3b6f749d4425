"""Provide `run`, which does the same as the command `mapmore run`, and `load_model`, which reads
the model file of a run.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

from mapmore_cli.api.fitted import Scores
from mapmore_cli.checking.findings import sentences
from mapmore_cli.pipeline.jobs import Finished, Job, run_one
from mapmore_cli.pipeline.notebooks import LoadedModel
from mapmore_cli.pipeline.runner import Options
from mapmore_cli.pipeline.tables_in_memory import plain_values
from mapmore_cli.reporting.order import RUN_PAGE
from mapmore_cli.storage.artefacts import read_model
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.scores import scores_beside
from mapmore_cli.study.yaml_dumper import as_overrides


@dataclass(frozen=True, repr=False)
class Run(Finished):
    """Result of `run`. All stages of the run are up to date.

    Attributes
    ----------
    model, scores
        The model and the rows of its score table.
    page
        The path of the report.
    stages
        State of each stage, by its name: `done` or `up-to-date`.
    missed
        One sentence for each limit of `validate.require` that the scores miss. If there are any,
        the command `mapmore run` ends with exit code 6.
    """

    @cached_property
    def scores(self) -> Scores:
        """The rows of `scores.json`."""
        return Scores.of(self.table)

    @cached_property
    def model(self) -> LoadedModel:
        """The model of the run, as a function of its inputs."""
        return LoadedModel(RunFiles(self.run_dir).model(), self.scores)

    @property
    def page(self) -> Path:
        """Path of the page of the run."""
        return self.run_dir / RUN_PAGE

    def __repr__(self) -> str:
        return "\n".join([f"<run {self.name}: {self.page}>", repr(self.scores), *self.missed])

    def _repr_html_(self) -> str:
        missed = "".join(f"<p>{escape(sentence)}</p>" for sentence in self.missed)
        page = escape(str(self.page))
        return (
            f"<p>{escape(self.name)}: <a "
            f'href="{page}">{page}</a></p>{self.scores._repr_html_()}{missed}'
        )


def run(
    config: str | Path,
    runs: str | Path = "runs",
    *,
    force: bool = False,
    check: bool = True,
    settings: Mapping[str, Any] | None = None,
) -> Run:
    """Run all stages of a spec, as `mapmore run` does, with results in the folder `runs`.

    `settings` replaces values of the spec, as `--set` does, for example `{"fit.max_terms": 2}`.
    With `check=False`, the run continues even if `mapmore check` finds errors.

    Raises
    ------
    MapmoreError
        The error that the command would print. If scores miss the limits of `validate.require`, no
        error is raised, and `Run.missed` names these limits.
    """
    overrides = tuple(as_overrides(plain_values(dict(settings or {}))))
    finished = run_one(Job(Path(config), Path(runs), overrides, Options(force, check=check)))
    for warning in (*finished.table.warnings, *sentences(finished.run_dir)):
        warnings.warn(warning, stacklevel=2)
    return Run(**vars(finished))


def load_model(path: str | Path, *, unverified: bool = False) -> LoadedModel:
    """Read a model file, and return the model as a function of keyword arguments. For example,
    `load_model("model.h5")(pressure=[100, 200], strain=0.1)` returns two forces.

    Warns (UserWarning) if the file has no checksum, because a change of the file could then not be
    noticed.

    Raises
    ------
    mapmore_cli.domain.errors.DataError
        The file is missing, damaged or no valid model, or its checksum is wrong. With
        `unverified=True`, a wrong checksum is accepted.
    """
    model = read_model(Path(path), lambda message: warnings.warn(message, stacklevel=4), unverified)
    return LoadedModel(model, scores_beside(Path(path)))
