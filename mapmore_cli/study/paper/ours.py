"""Numbers of a run by name: its scores, its waveforms, and every table of its page."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.motion.simulation import last_wavelength
from mapmore_cli.pipeline.report import collected, reads
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.reporting.tables import all_tables
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.paper import Ours
from mapmore_cli.storage.run_folder import RunFiles

Row = Mapping[str, Cell]


@dataclass
class Runs:
    """The runs that papers ask for, each brought up to date once; `folder` is where specs' paths start."""

    runs: Path
    folder: Path
    _tables: dict[Path, Mapping[str, Table]] = field(default_factory=dict)

    def run_dir(self, spec: str) -> Path:
        """Bring the run of a spec up to date and return its folder; raises as its stages do."""
        return bring_up_to_date(load(self.folder / spec), self.runs, "validate").run_dir

    def rows(self, ours: Ours, printed: Mapping[str, str]) -> list[Row]:
        """Return the rows of ours that a printed row stands beside, by column.

        Raises SpecError for a table or a column that the run does not have, or a `{column}` that the printed row does not have.
        """
        path = self.folder / _filled(ours.run, printed)
        if path not in self._tables:
            self._tables[path] = _tables(self.run_dir(_filled(ours.run, printed)))
        found = self._tables[path]
        if ours.table not in found:
            raise SpecError(f"{path.name}: its run has no table {ours.table!r}", f"there are {', '.join(found)}")
        table = found[ours.table]
        names = [identifier(column.name) for column in table.columns]
        if unknown := sorted(set(ours.rows) - set(names)):
            raise SpecError(f"{path.name}: table {ours.table!r} has no column {unknown[0]!r}", f"there are {', '.join(names)}")
        wanted = {name: _filled(text, printed) for name, text in ours.rows.items()}
        rows = [dict(zip(names, row, strict=True)) for row in table.rows]
        return [row for row in rows if all(str(row[name]) == text for name, text in wanted.items())]


def identifier(name: str) -> str:
    """Return the name of a column as expressions write it: `max error` is `max_error`."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")


def _filled(text: str, printed: Mapping[str, str]) -> str:
    try:
        return text.format_map(printed)
    except (KeyError, ValueError, IndexError, AttributeError) as fault:
        raise SpecError(f"{text!r}: names no column of the published table ({fault})", f"there are {', '.join(printed)}") from fault


def _tables(run_dir: Path) -> dict[str, Table]:
    shown = all_tables(collected(reads(load(run_dir / "experiment.yaml").spec), run_dir))
    return {**{table.name: table for table in shown}, "scores": _scores(run_dir), "curves": _curves(run_dir)}


def _scores(run_dir: Path) -> Table:
    """Every row of the scores, with `rmse` and the other metrics under the names that the specs have."""
    names = [one.name for one in fields(Score)]
    rows = tuple(tuple(getattr(row, name) for name in names) for row in RunFiles(run_dir).scores().scores)
    return Table("scores", "Scores", tuple(map(Column, names)), rows)


def _curves(run_dir: Path) -> Table:
    """Return the last wavelength of every quantity of every curve, its range and mean; `repeats` counts whole wavelengths in `seconds`."""
    names = ("curve", "quantity", "lowest", "highest", "mean", "seconds", "wavelength", "repeats")
    rows: list[tuple[Cell, ...]] = []
    for curve in RunFiles(run_dir).dataset().curves:
        time = curve.columns.get("time")
        step = float(np.median(np.diff(time))) if time is not None and len(time) > 1 else float("nan")
        for name, values in curve.columns.items():
            last = values[-last_wavelength(values) :]
            wave = step * len(last)
            numbers = (float(last.min()), float(last.max()), float(last.mean()), step * (len(values) - 1), wave)
            rows.append((curve.id, name, *numbers, numbers[3] // wave if wave > 0 else float("nan")))
    return Table("curves", "Curves", tuple(map(Column, names)), tuple(rows))
