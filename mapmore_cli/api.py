"""The program in Python: the words of the YAML spec as keyword arguments.

    import mapmore_cli as mm

`fit` makes a model of arrays, of data frames or of files; `run` does what `mapmore run` does;
`FROLS` is the regression engine as an estimator. Nothing is written but by `Fitted.save`,
`Fitted.to_yaml` and `run`.
"""

from __future__ import annotations

import os
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from mapmore_cli.checking.findings import sentences
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import MapmoreError, SpecError
from mapmore_cli.domain.given import labels_of
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.scores import RUN_PAGE, ScoreTable
from mapmore_cli.modelling.frols.estimator import FROLS
from mapmore_cli.pipeline.jobs import Job, run_one
from mapmore_cli.pipeline.notebooks import (
    LoadedModel,
    canonical_columns,
    columns_in,
    quantities_of,
    source_of,
    write_frames,
)
from mapmore_cli.pipeline.records import reading_of
from mapmore_cli.pipeline.runner import Options, bring_up_to_date
from mapmore_cli.reporting.score_tables import score_table
from mapmore_cli.reporting.table import to_html, to_text
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.loader import LoadedSpec, load, load_text
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.yaml_loader import as_overrides, dump, escaped
from mapmore_cli.storage.artefacts import read_model
from mapmore_cli.storage.atomic import refusals_told, write_bytes, write_text
from mapmore_cli.storage.readers import reader_of
from mapmore_cli.storage.run_folder import MODEL, RunFiles
from mapmore_cli.storage.run_record import score_row, scores_beside

__all__ = ["FROLS", "Fitted", "Run", "Scores", "fit", "load_model", "run"]

_HERE = "fit(...)"
"""How messages call the spec that the keyword arguments make."""

_OF_DATA = frozenset(Data.model_fields) - {"files"}
"""Keys of the section `data` that `fit` takes beside the other sections."""

_SHOWN = 8
"""Equations that a notebook shows."""


class Scores(tuple[Mapping[str, Any], ...]):
    """The rows of `scores.json`, each a mapping as `{"model": "mapmore", "split": "validate",
    "nrmse": 0.01, ...}`.

    It prints as the table of the pooled rows.
    """

    table: ScoreTable

    @classmethod
    def of(cls, table: ScoreTable) -> Scores:
        """Return the rows of a score table."""
        found = cls(score_row(score) for score in table.scores)
        found.table = table
        return found

    def __repr__(self) -> str:
        return to_text(
            score_table(self.table.scores, self.table.units, failed=self.table.failed)
        ).rstrip()

    def _repr_html_(self) -> str:
        return to_html(score_table(self.table.scores, self.table.units, failed=self.table.failed))

    def of_model(self, model: str = "mapmore", split: str = "validate") -> Mapping[str, Any]:
        """Return the pooled row of a model; raises `KeyError` where there is none."""
        for row in self:
            if (row["model"], row["split"], row["curve"]) == (model, split, "all"):
                return row
        raise KeyError(f"no row of {model} on the {split} data")


@dataclass(frozen=True)
class Study:
    """Hold what `fit` was given: the spec as a `document`, the `frames` in memory, and the folder
    at which paths start.

    There are no frames where files are read. With `check`, an error of `mapmore check` ends the
    fit.
    """

    document: Mapping[str, Any]
    frames: tuple[Any, ...]
    folder: Path
    check: bool = True

    @property
    def columns(self) -> Mapping[str, Any]:
        """The section `columns` as it was given."""
        found: Mapping[str, Any] = self.document["data"].get("columns", {})
        return found

    def loaded(self, place: Path, changes: Mapping[str, Any] | None = None) -> LoadedSpec:
        """Return the spec written to the file `place`, so that it runs there; frames are written to
        a folder beside it.
        """
        document = {"schema_version": 1, **self.document}
        if self.frames:
            written = write_frames(
                self.frames,
                self.columns,
                self.document.get("units", {}),
                place.parent / f"{place.stem}_data",
            )
            files = [os.path.relpath(path, self.folder) for path in written["files"]]
            document["data"] = {**document["data"], **written, "files": files}
        # mistakes are told without naming a file that nobody wrote
        told = load_text(dump(escaped(document)), _HERE, self.folder)
        write_text(place, told.resolved_in(place.parent, given_only=True))
        return load(place, as_overrides(changes or {}))

    def fitted(self, changes: Mapping[str, Any] | None = None) -> Fitted:
        """Return the model and its scores, made in a temporary folder that is removed."""
        told: list[str] = []
        with TemporaryDirectory(prefix="mapmore-") as place:
            loaded = self.loaded(Path(place) / "spec.yaml", changes)
            try:
                outcome = bring_up_to_date(
                    loaded,
                    Path(place) / "runs",
                    "validate",
                    options=Options(check=self.check),
                    warn=told.append,
                )
            except MapmoreError as error:
                error.message = re.sub(
                    rf"{re.escape(str(loaded.path))}(:\d+)*", _HERE, error.message
                )
                raise
            run = RunFiles(outcome.run_dir)
            table = run.scores()
            file, doubts = (outcome.run_dir / MODEL).read_bytes(), sentences(outcome.run_dir)
            return Fitted(
                run.model(),
                Scores.of(table),
                study=self,
                spec=loaded.spec,
                file=file,
                warnings=(*table.warnings, *told),
                doubts=doubts,
            )


@dataclass(frozen=True, repr=False)
class Fitted(LoadedModel):
    """A model with its scores and the spec that made it. Call it with the inputs, in the model's
    units.

    For intervals, also those of a plot, it is fitted again without each curve, unless the spec
    asked for them already.

    Attributes
    ----------
    scores
        The rows of `scores.json`; they print as a table.
    spec
        The experiment as it was validated.
    warnings
        What the command says on stderr; what makes a model useless is a Python warning too.
    doubts
        Those of them that `mapmore check` says of the data, which are Python warnings too.
    """

    scores: Scores
    study: Study = field(kw_only=True)
    spec: ExperimentSpec = field(kw_only=True)
    file: bytes = field(kw_only=True)
    warnings: tuple[str, ...] = field(default=(), kw_only=True)
    doubts: tuple[str, ...] = field(default=(), kw_only=True)

    def __repr__(self) -> str:
        return "\n".join(
            [
                super().__repr__(),
                repr(self.scores),
                *(f"warning: {warning}" for warning in self.warnings),
            ]
        )

    def _repr_html_(self) -> str:
        equations = [
            f"<li><code>{escape(one.id)} = {escape(one.text)}</code></li>" for one in self.equations
        ]
        more = f"<p>... {len(equations)} equations in all</p>" if len(equations) > _SHOWN else ""
        told = "".join(f"<p>warning: {escape(warning)}</p>" for warning in self.warnings)
        scores = self.scores._repr_html_()
        head = f"<p>{escape(super().__repr__())}</p>{scores}"
        return f"{head}<ul>{''.join(equations[:_SHOWN])}</ul>{more}{told}"

    def predict(self, frame: Any) -> Array:
        """Return the output at the rows of a frame, (n,), in the model's unit; NaN where an input
        is not finite.

        Columns are found as in the fit (name, unit, scale, offset), else by their canonical names
        in the model's units. The rows of a model with memory are one recording.

        Raises
        ------
        DataError
            Where an input has no column.
        """
        source = {name: source_of(entry) for name, entry in self.study.columns.items()}
        names = {*source, *map(str, labels_of(frame) or ())}
        known = {
            name
            for name in names
            if columns_in(frame, name) or columns_in(frame, source.get(name, name))
        }
        given = (
            known if "time" in known else {*known, *(signal.name for signal in self.model.signals)}
        )
        reading = reading_of(self.model, given)
        wanted = tuple(dict.fromkeys((*reading.columns, *reading.outputs)))
        columns = {
            name: column.model_copy(update={"column": source[name]})
            for name, column in self.spec.data.columns.items()
        }
        return self(**quantities_of(frame, wanted, columns, self.units))

    @cached_property
    def _with_intervals(self) -> Model:
        return (
            self.model
            if self.model.left_out is not None
            else self.study.fitted({"validate.intervals": True}).model
        )

    def save(self, path: str | Path) -> Path:
        """Write the `model.h5` that `load_model`, `mapmore predict` and `mapmore export` read; its
        path. Raises `WriteError`.
        """
        place = Path(path)
        write_bytes(place, self.file)
        return place

    def to_yaml(self, path: str | Path) -> Path:
        """Write the spec, and frames as recordings into the folder `<stem>_data` beside it:
        `mapmore run` makes the same of them.

        Returns the path of the spec. Raises `WriteError`.
        """
        place = Path(path)
        with refusals_told(place):
            place.parent.mkdir(parents=True, exist_ok=True)
            self.study.loaded(place)
        return place


def fit(frame: Any, **sections: Any) -> Fitted:
    """Fit a model to a table, with the sections of a spec as keyword arguments.

    Parameters
    ----------
    frame
        A mapping of arrays, a data frame (pandas, polars, pyarrow, ...), the path of a file, or a
        list of these, each one recording. Labels are taken as they are: `column: 2` is the column
        labelled 2; where no label is a number, the third. No index is looked at. Masked values,
        None and `pd.NA` are missing. Arrays with units (pint, astropy, xarray) are converted.
        `time` may be dates or durations. Text, true and false, and complex numbers are refused. So
        does a model read what it is called with.
    sections
        The keys of a spec (`target`, `segment`, `dictionary`, ...; docs/spec.md), and those of its
        section `data` (`columns`, `levels`, `split`, ...). Without `columns`, the columns of a
        frame have canonical names; where `target` is the label of one, all are called by their
        labels. `target` is `static` where nothing is said. With `check=False`, what `mapmore check`
        calls an error is a warning, and does not end the fit.

    Raises
    ------
    SpecError
        For a section that is wrong, as the command says it.
    DataError, FitError
        Where the data are wrong, or a fit failed.

    Examples
    --------
    >>> import numpy as np
    >>> import mapmore_cli as mm
    >>> levels, strains = [0.8, 1.5, 2.0, 2.5, 3.5], np.linspace(0, 0.2, 40)
    >>> bar, eps = (grid.ravel() for grid in np.meshgrid(levels, strains, indexing="ij"))
    >>> newton = 330 * bar * (1 - 3.2 * eps) ** 2 - 70 + 40 * np.exp(-eps / 0.02)
    >>> m = mm.fit({"P [bar]": bar, "eps": eps, "F": newton}, target="static",
    ...     columns={"pressure": {"column": "P [bar]", "unit": "bar"}, "strain": {"column": "eps"},
    ...              "force": {"column": "F"}},
    ...     levels={"of": "pressure", "at": "auto"}, split={"validate": {"pressure": [200]}},
    ...     segment={"strain": {"method": "even", "count": 4}},
    ...     dictionary=[{"polynomial": {"of": ["strain"], "order": 4}}],
    ...     validate={"against": ["sarosi"]})
    >>> m
    <model model: force [N] of pressure [kPa], strain [1]>
    ...
    >>> m.scores.of_model()["nrmse"] < 0.01
    True
    >>> float(m(pressure=150, strain=0.1).round())
    157.0
    >>> pressure = m.invert("pressure", force=100, strain=0.1).picked
    >>> float(m(pressure=pressure[0], strain=0.1).round(6))
    100.0
    """
    target, check = sections.pop("target", "static"), bool(sections.pop("check", True))
    data = {
        **sections.pop("data", {}),
        **{key: sections.pop(key) for key in list(sections) if key in _OF_DATA},
    }
    given = list(frame) if isinstance(frame, list | tuple) else [frame]
    frames = tuple(one for one in given if labels_of(one) is not None)
    if not given or 0 < len(frames) < len(given):
        raise SpecError(
            "fit: frames and files are mixed" if given else "fit: there are no frames",
            "give frames alone, or paths alone",
        )
    if frames and "columns" not in data:
        data["columns"] = canonical_columns(frames[0], target)
    if not frames:
        data["files"] = [str(path) for path in given]
        data.setdefault("reader", _reader_of(given[0]))
    document = {"name": "model", **sections, "data": data, "target": target}
    found = Study(plain_values(document), frames, Path.cwd(), check).fitted()
    for warning in (*found.scores.table.warnings, *found.doubts):
        warnings.warn(warning, stacklevel=2)
    return found


def _reader_of(path: Any) -> str:
    """Return the reader of files that begin or end so; `csv` for others.

    Raises `SpecError` for what is no path.
    """
    if not isinstance(path, str | Path):
        raise SpecError(
            f"fit: {type(path).__name__} is no table",
            "give a mapping of arrays, a data frame, or the path of a file",
        )
    reader = reader_of(Path(path))
    return "csv" if reader is None else reader.name


@dataclass(frozen=True, repr=False)
class Run:
    """A run that is up to date.

    Attributes
    ----------
    model, scores
        What the run found.
    page
        The report.
    stages
        `done` or `up-to-date` by stage.
    missed
        Sentences about `validate.require` limits that are missed: the command ends with 6 where
        there are any.
    """

    name: str
    run_dir: Path
    stages: Mapping[str, str]
    model: LoadedModel
    scores: Scores
    page: Path
    missed: tuple[str, ...]
    warnings: tuple[str, ...]

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
    """Do what `mapmore run` does with a spec, in the folder `runs`; `settings` are those of
    `--set`, as `{"fit.max_terms": 2}`.

    Without `check`, it goes on where `mapmore check` finds errors.

    Raises
    ------
    MapmoreError
        As the command says it; but limits that are missed are in `Run.missed`.
    """
    overrides = tuple(as_overrides(plain_values(dict(settings or {}))))
    found = run_one(Job(Path(config), Path(runs), overrides, Options(force, check=check)))
    for warning in (*found.table.warnings, *sentences(found.run_dir)):
        warnings.warn(warning, stacklevel=2)
    scores = Scores.of(found.table)
    model = LoadedModel(RunFiles(found.run_dir).model(), scores)
    return Run(
        found.name,
        found.run_dir,
        found.stages,
        model,
        scores,
        found.run_dir / RUN_PAGE,
        found.missed,
        found.warnings,
    )


def plain_values(value: Any) -> Any:
    """Return the value as YAML holds it: lists for tuples and arrays, numbers for NumPy's scalars,
    text for paths.
    """
    if isinstance(value, Mapping):
        return {str(key): plain_values(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_values(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def load_model(path: str | Path, *, unverified: bool = False) -> LoadedModel:
    """Read a `model.h5` as a function of keyword arrays: `load_model("model.h5")(pressure=[100,
    200], strain=0.1)`.

    Warns (UserWarning) where nothing shows that the file is as it was written.

    Raises
    ------
    mapmore_cli.domain.errors.DataError
        The file is missing, damaged or no valid model, or its checksum does not match (but not
        where it may be `unverified`).
    """
    model = read_model(Path(path), lambda message: warnings.warn(message, stacklevel=4), unverified)
    return LoadedModel(model, scores_beside(Path(path)))
