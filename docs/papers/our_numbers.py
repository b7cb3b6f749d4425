"""Numbers of ours that stand beside those of papers: rows of the files of runs, which are brought
up to date first, and of tables that commands wrote.
"""

from __future__ import annotations

import ast
import csv
import json
import math
import operator
import re
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from paper import Ours, PaperError, Source

import mapmore_cli as mm
from mapmore_cli.annexes.motion.simulation import last_wavelength

Cell = str | float | int | None
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
        """Return the rows with these texts, or with one of them, by column; PaperError for a column
        that is not there, of those named `also` too.
        """
        if unknown := sorted({*texts, *also} - {*self.names}):
            raise PaperError(
                f"{self.what}: has no column {unknown[0]!r}; there are {', '.join(self.names)}"
            )
        allowed = {name: [own] if isinstance(own, str) else own for name, own in texts.items()}
        rows = [dict(zip(self.names, row, strict=True)) for row in self.cells]
        return [row for row in rows if all(str(row[name]) in allowed[name] for name in allowed)]


def csv_rows(path: Path) -> Rows:
    """Return the rows of a CSV file, all texts; PaperError where it is none."""
    try:
        with path.open(newline="", encoding="utf-8") as lines:
            heads, *rows = csv.reader(lines)
    except (OSError, ValueError) as fault:
        raise PaperError(f"{path} is no table of a CSV file with headings ({fault})") from fault
    if wrong := next((row for row in rows if len(row) != len(heads)), None):
        raise PaperError(f"{path}: a row is not as long as the headings: {wrong}")
    return Rows(path.name, heads, rows)


def _named(table: Rows, without: str = "$") -> Rows:
    """Return a table with its headings as expressions write them, but for what matches."""
    plain = [re.sub(without, "", heading) for heading in table.names]
    names = [re.sub(r"[^A-Za-z0-9]+", "_", heading).strip("_") for heading in plain]
    return replace(table, names=names)


@dataclass(frozen=True)
class Runs:
    """The runs that papers ask for, each brought up to date once; `folder` is where specs' paths
    start.
    """

    runs: Path
    folder: Path
    _folders: dict[str, Path] = field(default_factory=dict)
    _tables: dict[tuple[str, str, str], Rows] = field(default_factory=dict)

    def run_dir(self, spec: str, **settings: Any) -> Path:
        """Bring the run of a spec up to date, with other settings or not, and return its folder;
        raises as `mapmore run`.
        """
        key = f"{spec} {settings}"
        if key not in self._folders:
            with warnings.catch_warnings():  # the page of the run has them
                warnings.simplefilter("ignore")
                found = mm.run(self.folder / spec, self.runs, settings=settings)
                self._folders[key] = found.run_dir
        return self._folders[key]

    def rows(self, ours: Ours, printed: Mapping[str, str], root: Path) -> list[Row]:
        """Return the rows of ours that a printed row stands beside, by column.

        Raises PaperError for a table or a column that the run does not have, or a `{column}` that
        the printed row does not have.
        """
        if ours.run is None:
            table = _named(csv_rows(root / str(ours.file)))
        else:
            table = self._table(_with_cells(ours.run, printed), ours.table)
        return table.kept({name: _with_cells(text, printed) for name, text in ours.rows.items()})

    def source_rows(self, source: Source, root: Path) -> dict[str, Row]:
        """Return the rows of a source by the texts that name them; raises PaperError as `rows`."""
        if source.run is not None:
            table = self._table(source.run, source.table, source.along)
        else:
            table = _named(csv_rows(root / str(source.file)))
        kept = table.kept(source.kept, source.key)
        return {" ".join(str(row[name]) for name in source.key): row for row in kept}

    def _table(self, spec: str, name: str, along: str = "") -> Rows:
        key = (spec, name, along)
        if key not in self._tables:
            self._tables[key] = self._read(*key)
        return self._tables[key]

    def _read(self, spec: str, name: str, along: str) -> Rows:
        """Return a table of a run: `scores` of scores.json, `curves`, `shapes`, or one of its
        report.
        """
        folder = self.run_dir(spec)
        if name == "scores":
            scores = json.loads((folder / "scores.json").read_text(encoding="utf-8"))["scores"]
            return Rows("scores", list(scores[0]), [list(row.values()) for row in scores])
        if name == "curves":
            return _curves(folder)
        if name == "shapes":
            return _shapes(folder, along)
        tables = {path.stem: path for path in sorted(folder.glob("report/tables/*.csv"))}
        if name not in tables:
            raise PaperError(
                f"{spec}: its run has no table {name!r}; there are {', '.join(tables)}"
            )
        return _named(csv_rows(tables[name]), r" \[.*\]$")


def _with_cells(text: str, printed: Mapping[str, str]) -> str:
    try:
        return text.format_map(printed)
    except (KeyError, ValueError, IndexError, AttributeError) as fault:
        raise PaperError(
            f"{text!r} names no column of the published table ({fault}); there are "
            f"{', '.join(printed)}"
        ) from fault


def result_file(path: Path) -> Any:
    """Return the document of a result file, its arrays in their places (docs/file-format.md)."""
    with h5py.File(path) as file:

        def filled(value: Any) -> Any:
            if isinstance(value, list):
                return [filled(one) for one in value]
            if not isinstance(value, dict):
                return value
            if "array" not in value:
                return {name: filled(one) for name, one in value.items()}
            array = file[value["array"]][()]
            if "from" not in value:
                return array
            first, size = value["from"], math.prod(value["shape"])
            return array[first : first + size].reshape(value["shape"])

        return filled(json.loads(file["document"].asstr()[()]))


def _curves(run_dir: Path) -> Rows:
    """Return the last wavelength of every quantity of every curve, its range and mean; `repeats`
    counts whole wavelengths in `seconds`.
    """
    names = ("curve", "quantity", "lowest", "highest", "mean", "seconds", "wavelength", "repeats")
    rows: list[tuple[Cell, ...]] = []
    for curve in result_file(run_dir / "ingest.h5")["curves"]:
        steps = np.diff(curve["columns"].get("time", np.empty(0)))
        step = float(np.median(steps)) if len(steps) else math.nan
        for name, values in curve["columns"].items():
            last = values[-last_wavelength(values) :]
            ends = (float(last.min()), float(last.max()), float(last.mean()))
            seconds, wave = step * (len(values) - 1), step * len(last)
            repeats = seconds // wave if wave > 0 else math.nan
            rows.append((curve["id"], name, *ends, seconds, wave, repeats))
    return Rows("curves", names, rows)


SHAPE = (
    *("least", "least_at", "greatest", "greatest_at", "bias", "error_below", "error_above"),
    "straight",
)


def _shapes(run_dir: Path, along: str) -> Rows:
    """Return the extremes of every curve and model, and where they are along a quantity; and a
    model's mean error, its RMSE below and above the middle of the curve, and the share of its
    variance that a straight line has.
    """
    validation = result_file(run_dir / "validate.h5")
    dataset = validation.get("shown") or result_file(run_dir / "ingest.h5")
    rows: list[tuple[Cell, ...]] = []
    for number, curve in enumerate(dataset["curves"]):
        if along not in curve["columns"]:
            known = ", ".join(curve["columns"])
            raise PaperError(f"shapes go `along` a quantity: give one of {known}")
        x, y = curve["columns"][along], curve["columns"][dataset["target"]]
        below = x <= (x.min() + x.max()) / 2
        models = {name: found[number] for name, found in validation["predictions"].items()}
        for model, values in {"measured": y, **models}.items():
            if not np.isfinite(values).any():
                continue
            ends = [int(end(values)) for end in (np.nanargmin, np.nanargmax)]
            places = [float(one) for end in ends for one in (values[end], x[end])]
            error = values - y
            rms = [float(np.sqrt(np.nanmean(error[part] ** 2))) for part in (below, ~below)]
            known = np.isfinite(values)
            level = np.ptp(values[known]) == 0
            straight = 1.0 if level else float(np.corrcoef(x[known], values[known])[0, 1] ** 2)
            rows.append((model, curve["id"], *places, float(np.nanmean(error)), *rms, straight))
    return Rows("shapes", ("model", "curve", *SHAPE), rows)


OPERATIONS: Mapping[type, Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def cell_value(text: str, row: Row) -> Cell:
    """Return a column of a row, a number where it is one, or the value of an expression of its
    columns; PaperError where it is neither.
    """
    cells: dict[str, Cell] = {}
    for name, cell in row.items():
        try:
            cells[name] = (float(cell) if cell else None) if isinstance(cell, str) else cell
        except ValueError:
            cells[name] = cell
    if text in cells:
        return cells[text]

    def value(node: ast.AST) -> float:
        match node:
            case ast.Constant(value=int() | float() as number):
                return float(number)
            case ast.Name(id=name) if isinstance(cells.get(name), int | float):
                return as_float(cells[name])
            case ast.BinOp(left, operation, right) if type(operation) in OPERATIONS:
                return OPERATIONS[type(operation)](value(left), value(right))
            case ast.UnaryOp(ast.USub(), one):
                return -value(one)
            case ast.Call(ast.Name(id="sqrt"), [one]):
                return math.sqrt(value(one))
            case ast.Call(ast.Name(id="abs"), [one]):
                return abs(value(one))
        raise ValueError(f"{ast.unparse(node)} is no number here")

    try:
        return value(ast.parse(text.replace("^", "**").strip(), mode="eval").body)
    except (SyntaxError, ValueError, ZeroDivisionError) as fault:
        raise PaperError(f"{text!r}: {fault}; there are {', '.join(row)}") from fault


def as_float(cell: Cell) -> float:
    """Return the number in a cell; NaN where it holds none."""
    return float(cell) if isinstance(cell, int | float) else math.nan
