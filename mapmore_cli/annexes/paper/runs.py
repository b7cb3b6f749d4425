"""Numbers of ours that stand beside those of papers: rows of the tables of runs, brought up to date
first, and of tables that commands wrote.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

import numpy as np

from mapmore_cli.annexes.motion.simulation import last_wavelength
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.expressions import ExpressionError, evaluate, parse
from mapmore_cli.pipeline.report import collected, report_slice
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.sections import all_tables
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import score_row
from mapmore_cli.study.loader import load
from mapmore_cli.study.paper import Ours, Source

Row = Mapping[str, Cell]


@dataclass(frozen=True)
class Rows:
    """Rows by the names of their columns; `what` is how messages call the table."""

    what: str
    names: Sequence[str]
    cells: Iterable[Sequence[Cell]]

    def kept(
        self, texts: Mapping[str, Collection[str]] | Mapping[str, str], also: Iterable[str] = ()
    ) -> list[Row]:
        """Return the rows with these texts, or with one of them, by column; SpecError for a column
        that is not there, of those named `also` too.
        """
        if unknown := sorted({*texts, *also} - {*self.names}):
            raise SpecError(
                f"{self.what}: has no column {unknown[0]!r}", f"there are {', '.join(self.names)}"
            )
        allowed = {name: [own] if isinstance(own, str) else own for name, own in texts.items()}
        rows = [dict(zip(self.names, row, strict=True)) for row in self.cells]
        return [row for row in rows if all(str(row[name]) in allowed[name] for name in allowed)]


def csv_rows(path: Path) -> Rows:
    """Return the rows of a CSV file, all texts; SpecError where it is none."""
    try:
        with path.open(newline="", encoding="utf-8") as lines:
            heads, *rows = csv.reader(lines)
    except (OSError, ValueError) as fault:
        raise SpecError(f"{path} is no table ({fault})", "give a CSV file with headings") from fault
    if wrong := next((row for row in rows if len(row) != len(heads)), None):
        raise SpecError(
            f"{path}: a row is not as long as the headings: {wrong}",
            "give a CSV file with headings",
        )
    return Rows(path.name, heads, rows)


def _as_names(headings: Iterable[str]) -> list[str]:
    """Return the headings of columns as expressions write them."""
    return [re.sub(r"[^A-Za-z0-9]+", "_", heading).strip("_") for heading in headings]


@dataclass(frozen=True)
class Runs:
    """The runs that papers ask for, each brought up to date once; `folder` is where specs' paths
    start.
    """

    runs: Path
    folder: Path
    _tables: dict[str, Mapping[str, Table]] = field(default_factory=dict)

    def run_dir(self, spec: str) -> Path:
        """Bring the run of a spec up to date and return its folder; raises as its stages do."""
        return bring_up_to_date(load(self.folder / spec), self.runs, "validate").run_dir

    def rows(self, ours: Ours, printed: Mapping[str, str]) -> list[Row]:
        """Return the rows of ours that a printed row stands beside, by column.

        Raises SpecError for a table or a column that the run does not have, or a `{column}` that
        the printed row does not have.
        """
        table = self._table(_with_cells(ours.run, printed), ours.table)
        return table.kept({name: _with_cells(text, printed) for name, text in ours.rows.items()})

    def source_rows(self, source: Source, root: Path) -> dict[str, Row]:
        """Return the rows of a source by the texts that name them; raises SpecError as `rows`."""
        if source.run is not None:
            table = self._table(source.run, source.table)
        else:
            table = csv_rows(root / str(source.file))
            table = replace(table, names=_as_names(table.names))
        kept = table.kept(source.kept, source.key)
        return {" ".join(str(row[name]) for name in source.key): row for row in kept}

    def _table(self, spec: str, name: str) -> Rows:
        if spec not in self._tables:
            self._tables[spec] = _tables(self.run_dir(spec))
        tables = self._tables[spec]
        if name not in tables:
            raise SpecError(
                f"{spec}: its run has no table {name!r}", f"there are {', '.join(tables)}"
            )
        names = _as_names(column.name for column in tables[name].columns)
        return Rows(f"table {name!r}", names, tables[name].rows)


def _with_cells(text: str, printed: Mapping[str, str]) -> str:
    try:
        return text.format_map(printed)
    except (KeyError, ValueError, IndexError, AttributeError) as fault:
        raise SpecError(
            f"{text!r}: names no column of the published table ({fault})",
            f"there are {', '.join(printed)}",
        ) from fault


def _tables(run_dir: Path) -> dict[str, Table]:
    """Return the tables of a run's page; `scores` has every row, under the names that the specs
    have, `curves` what was measured, and `shapes` where each model is above and below it.
    """
    inputs, *_ = collected(report_slice(load(run_dir / "experiment.yaml").spec), run_dir)
    shown = all_tables(inputs)
    rows = [score_row(row) for row in RunFiles(run_dir).scores().scores]
    cells = (tuple(row.values()) for row in rows)
    scores = Table.of("scores", "Scores", [one.name for one in fields(Score)], cells)
    own = {"scores": scores, "curves": _curves(run_dir), "shapes": _shapes(inputs)}
    return {**{table.name: table for table in shown}, **own}


def _curves(run_dir: Path) -> Table:
    """Return the last wavelength of every quantity of every curve, its range and mean; `repeats`
    counts whole wavelengths in `seconds`.
    """
    names = ("curve", "quantity", "lowest", "highest", "mean", "seconds", "wavelength", "repeats")
    rows: list[tuple[Cell, ...]] = []
    for curve in RunFiles(run_dir).dataset().curves:
        steps = np.diff(curve.columns.get("time", np.empty(0)))
        step = float(np.median(steps)) if len(steps) else math.nan
        for name, values in curve.columns.items():
            last = values[-last_wavelength(values) :]
            ends = (float(last.min()), float(last.max()), float(last.mean()))
            seconds, wave = step * (len(values) - 1), step * len(last)
            repeats = seconds // wave if wave > 0 else math.nan
            rows.append((curve.id, name, *ends, seconds, wave, repeats))
    return Table.of("curves", "Curves", names, rows)


SHAPE = ("least", "least_at", "greatest", "greatest_at", "bias", "error_below", "error_above")


def _shapes(inputs: ReportInputs) -> Table:
    """Return the extremes of every curve and model, and where they are: along time, or along the
    input that curves are drawn over; and a model's mean error, and its RMSE below and above the
    middle of the curve.
    """
    along = "time" if inputs.timed else inputs.in_curve.name
    rows: list[tuple[Cell, ...]] = []
    for number, curve in enumerate(inputs.dataset.curves):
        x, y = curve.columns[along], curve.columns[inputs.dataset.target]
        below = x <= (x.min() + x.max()) / 2
        told = {model: found[number] for model, found in inputs.validation.predictions.items()}
        for model, values in {"measured": y, **told}.items():
            if not np.isfinite(values).any():
                continue
            ends = [int(end(values)) for end in (np.nanargmin, np.nanargmax)]
            places = [float(one) for end in ends for one in (values[end], x[end])]
            error = values - y
            rms = [float(np.sqrt(np.nanmean(error[part] ** 2))) for part in (below, ~below)]
            rows.append((model, curve.id, *places, float(np.nanmean(error)), *rms))
    return Table.of("shapes", "Shapes", ("model", "curve", *SHAPE), rows)


def cell_value(text: str, row: Row) -> Cell:
    """Return a column of a row, a number where it is one, or the value of an expression of its
    columns; SpecError where it is neither.
    """
    cells: dict[str, Cell] = {}
    for name, cell in row.items():
        try:
            cells[name] = (float(cell) if cell else None) if isinstance(cell, str) else cell
        except ValueError:
            cells[name] = cell
    if text in cells:
        return cells[text]
    numbers = {
        name: np.array([float(cell)])
        for name, cell in cells.items()
        if isinstance(cell, int | float)
    }
    try:
        return float(evaluate(parse(text), numbers, 1)[0])
    except (ExpressionError, KeyError, DataError, ValueError) as fault:
        raise SpecError(f"{text!r}: {fault}", f"there are {', '.join(row)}") from fault


def as_float(cell: Cell) -> float:
    """Return the number in a cell; NaN where it holds none."""
    return float(cell) if isinstance(cell, int | float) else math.nan
