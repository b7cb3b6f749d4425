"""Define the result of `fit`: the model, its scores, and the spec from which the model was made."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from mapmore_cli.checking.findings import sentences
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.results import FitResult
from mapmore_cli.domain.scores import ScoreTable
from mapmore_cli.pipeline.notebooks import LoadedModel
from mapmore_cli.pipeline.runner import Options, bring_up_to_date
from mapmore_cli.pipeline.tables_in_memory import (
    Frame,
    section_of,
    source_of,
    tables_of,
    write_tables,
)
from mapmore_cli.reporting.score_tables import score_table
from mapmore_cli.reporting.summary import summary_table
from mapmore_cli.reporting.table import Table
from mapmore_cli.storage.atomic import refusals_told, scratch_folder
from mapmore_cli.storage.outputs import write_bytes, write_text
from mapmore_cli.storage.run_folder import MODEL, RunFiles
from mapmore_cli.storage.scores import score_row
from mapmore_cli.storage.tables import RawTable
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.loader import MODELINE, SCHEMA, LoadedSpec, load_text
from mapmore_cli.study.schema import write_schema_beside
from mapmore_cli.study.sections.logs import SourceColumn
from mapmore_cli.study.variables import escaped
from mapmore_cli.study.yaml_dumper import as_overrides, dump

if TYPE_CHECKING:
    from rich.progress import Progress

HERE = "fit(...)"
"""Name that messages give to the spec that the keyword arguments form."""

PATIENCE = 2.0
"""Seconds after which a fit shows its progress."""

LINE_EVERY = 5.0
"""Seconds between two lines of progress in a file, which cannot show a bar."""

_SHOWN = 8
"""Largest number of equations that a notebook shows."""


class Scores(tuple[Mapping[str, Any], ...]):
    """The rows of `scores.json`, each a mapping such as `{"model": "mapmore", "split": "validate",
    "nrmse": 0.01, ...}`. `print(scores)` shows a table of those rows that belong to all curves
    together.
    """

    table: ScoreTable

    @classmethod
    def of(cls, table: ScoreTable) -> Scores:
        """Return the rows of a score table."""
        rows = cls(score_row(score) for score in table.scores)
        rows.table = table
        return rows

    @property
    def _shown(self) -> list[Table]:
        return [
            score_table(output.scores, output.units, failed=output.failed)
            for output in self.table.each
        ]

    def __repr__(self) -> str:
        return "\n\n".join(map(repr, self._shown))

    def _repr_html_(self) -> str:
        return "".join(table._repr_html_() for table in self._shown)

    def of_model(
        self, model: str = "mapmore", split: str = "validate", target: str | None = None
    ) -> Mapping[str, Any]:
        """Return the row with the scores of a model on all curves together. Without the argument
        `target`, it is the row of the first target. Raises `KeyError` if there is no such row.
        """
        for row in self:
            row_key = (row["model"], row["split"], row["curve"])
            if row_key == (model, split, "all") and target in (None, row["target"]):
                return row
        raise KeyError(f"the score table has no row for the model {model} on the {split} data")


@dataclass(frozen=True)
class Study:
    """Arguments of `fit`: the spec as a `document`, the `frames` in memory, and the folder to which
    paths are relative.

    `frames` is empty if files are read. With `check`, an error of `mapmore check` ends the fit.
    `progress` says whether a bar shows the progress (`_Bar`).
    """

    document: Mapping[str, Any]
    frames: tuple[Frame, ...]
    folder: Path
    check: bool
    progress: bool | None

    @property
    def columns(self) -> Mapping[str, Any]:
        """The mapping `data.columns` of the caller's spec; empty if the spec has no such
        mapping.
        """
        section: Mapping[str, Any] = self.document["data"].get("columns", {})
        return section

    def loaded(self, changes: Mapping[str, Any] = MappingProxyType({})) -> LoadedSpec:
        """Return the validated spec. Its recordings are the frames in memory, unless files are
        read.
        """
        document, tables = dict(self.document), dict[str, RawTable]()
        if self.frames:
            tables = tables_of(self.frames, self.columns, self.document.get("units", {}))
            document["data"] = {**document["data"], **section_of(tables, self.columns)}
        text = dump(escaped(document))
        return load_text(text, HERE, self.folder, as_overrides(changes), tables)

    def written(self, place: Path) -> str:
        """Return the text of a spec to be stored in the file `place`. If the recordings are frames
        in memory, first write them to files in a folder beside `place`; the spec then reads these
        files.
        """
        loaded = self.loaded()
        if loaded.tables:
            paths = write_tables(loaded.tables, place.parent / f"{place.stem}_data")
            loaded = self.loaded({"data.files": [os.path.relpath(p, self.folder) for p in paths]})
        return loaded.resolved_in(place.parent, given_only=True)

    def fitted(self, changes: Mapping[str, Any] = MappingProxyType({})) -> Fitted:
        """Run all stages, and return the model and its scores. The files of the stages are written
        to a temporary folder, which is removed afterwards.
        """
        warnings, loaded = list[str](), self.loaded(changes)
        with scratch_folder() as runs, _Bar(self.progress) as bar:
            outcome = bring_up_to_date(
                loaded,
                runs,
                "validate",
                options=Options(check=self.check),
                progress=bar,
                warn=warnings.append,
            )
            run = RunFiles(outcome.run_dir)
            table = run.scores()
            shown = run.validation().shown or run.dataset()
            return Fitted(
                run.model(),
                scores=Scores.of(table),
                study=self,
                spec=loaded.spec,
                file=(outcome.run_dir / MODEL).read_bytes(),
                fit=run.fit(),
                held_out=tuple(
                    curve.at(curve.held_out) for curve in shown.curves if curve.held_out.any()
                ),
                warnings=(*table.warnings, *warnings),
                doubts=sentences(outcome.run_dir),
            )


class _Bar:
    """Progress bar of a fit on stderr or in a notebook, shown after `PATIENCE` seconds; use it as a
    context manager.

    If `is_wanted` is True, the bar is shown at once, even if stderr is a file. If it is None, the
    bar is shown only in a terminal or a notebook. If it is False, the bar is never shown.
    """

    def __init__(self, is_wanted: bool | None) -> None:
        from rich.console import Console  # imported here, because only a progress bar needs `rich`

        self._console = Console(stderr=True)
        self._bar: Progress | None = None
        self._is_begun = False
        self._due = time.monotonic() + (0.0 if is_wanted else PATIENCE)
        self._is_drawn = self._console.is_terminal or self._console.is_jupyter
        if is_wanted is False or not (is_wanted or self._is_drawn):
            self._due = math.inf

    def __enter__(self) -> _Bar:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, task: str, done: int, total: int) -> None:
        """Show that `done` of `total` steps of the task `task` are finished."""
        if time.monotonic() < self._due and not (self._is_begun and done == total):
            return
        self._is_begun = True
        if not self._is_drawn:
            self._console.print(f"{task}: {done} of {total}")
            self._due = time.monotonic() + LINE_EVERY
            return
        if self._bar is None:
            from rich.progress import Progress

            self._bar = Progress(console=self._console, auto_refresh=False)
            self._bar.start()
            self._bar.add_task(task)
        self._bar.update(self._bar.task_ids[0], description=task, completed=done, total=total)
        self._bar.refresh()
        self._due = time.monotonic() + 0.1


@dataclass(frozen=True, repr=False, kw_only=True)
class Fitted(LoadedModel):
    """A model with its scores and the spec that made it. Call the model with its inputs, in the
    units of the model.

    If you ask for intervals, also in a plot, the model is fitted several times, each time without
    one part of the training data. This takes time. With `validate: {intervals: true}` in the spec,
    these fits are made together with the model.

    Attributes
    ----------
    scores
        The scores, in rows as in the file `scores.json`. `print(scores)` shows a table.
    spec
        The spec with its default values.
    fit
        The result of the fit, with every step of the selection of terms.
    held_out
        The held-out samples, curve by curve. If a recording is long, only the samples that the
        figures show are included.
    warnings
        All warnings that the command `mapmore run` would print. The warnings that it prints before
        the score table are also Python warnings.
    doubts
        The warnings of the rules of `mapmore check`. These warnings are also Python warnings.
    """

    scores: Scores
    study: Study
    spec: ExperimentSpec
    file: bytes
    fit: FitResult
    warnings: tuple[str, ...]
    doubts: tuple[str, ...]

    def __repr__(self) -> str:
        return "\n".join(
            [
                super().__repr__(),
                repr(self.scores),
                *(f"warning: {warning}" for warning in self.warnings),
            ]
        )

    def _repr_html_(self) -> str:
        equations = "".join(
            f"<li><code>{escape(equation.id)} = {escape(equation.text)}</code></li>"
            for equation in self.equations[:_SHOWN]
        )
        count, rest = len(self.equations), self.equations[_SHOWN:]
        more = f"<p>... {count} equations in all</p>" if rest else ""
        warnings = "".join(f"<p>warning: {escape(warning)}</p>" for warning in self.warnings)
        scores = self.scores._repr_html_()
        head = f"<p>{escape(super().__repr__())}</p>{scores}"
        return f"{head}<ul>{equations}</ul>{more}{warnings}"

    @property
    def _sources(self) -> dict[str, SourceColumn]:
        return {
            name: column.model_copy(update={"column": source_of(self.study.columns[name])})
            for name, column in self.spec.data.columns.items()
        }

    def summary(self) -> Table:
        """Return a table of all coefficients with standard error, t value and ERR.

        The notes of the table contain the model in physical units, the number of samples and of
        parameters, AIC and BIC (if all samples have the same weight), and the coefficients that the
        training data do not determine. The property `records` of the table has the rows as
        mappings.
        """
        fit = self.spec.fit
        weighed = bool(self.spec.data.uncertainty) or fit.loss != "squares"
        weighed = weighed or fit.weight != "sample"
        return summary_table(self.fit, self.model, self.scores.table, weighed)

    @cached_property
    def _with_intervals(self) -> Model:
        return (
            self.model
            if self.model.left_out is not None
            else self.study.fitted({"validate.intervals": True}).model
        )

    def save(self, path: str | Path) -> Path:
        """Write a model file, which `load_model`, `mapmore predict` and `mapmore export` read, and
        return its path. Raises `WriteError`.
        """
        place = Path(path)
        write_bytes(place, self.file)
        return place

    def to_yaml(self, path: str | Path) -> Path:
        """Write the spec, so that `mapmore run` makes the same model, and return its path.

        Tables in memory are written as files into the folder `<stem>_data` beside the spec. Raises
        `WriteError`.
        """
        place = Path(path)
        with refusals_told(place):
            place.parent.mkdir(parents=True, exist_ok=True)
            write_text(place, f"{MODELINE}{SCHEMA}\n{self.study.written(place)}")
        write_schema_beside(place)
        return place
