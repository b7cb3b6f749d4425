"""Write the page with a table of all runs in a folder, `RUNS/index.html`. The rows of the table are
also stored in the page as JSON data, so that the page can be extended without reading all runs
again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.errors import Warn
from mapmore_cli.domain.scores import OWN, REPEATABILITY, deciding
from mapmore_cli.pipeline.runs_rows import MARK, PAGE, RunRow, mark_of, rows_of
from mapmore_cli.storage.atomic import refusals_told, refuse_irregular, write_own
from mapmore_cli.storage.run_folder import RunFiles, run_lock
from mapmore_cli.storage.run_record import RUN_RECORD

if TYPE_CHECKING:
    from mapmore_cli.domain.results import Validation
    from mapmore_cli.pipeline.jobs import Finished

POINTS, WIDTH, HEIGHT = 40, 120, 36
"""Number of points of a small picture, and its size in pixels."""


def write_runs_page(
    runs: Path, finished: Sequence[Finished], warn: Warn = lambda _message: None
) -> None:
    """Write `RUNS/index.html` with new rows for the `finished` runs, and the existing rows of all
    other runs that still exist.

    If nothing has changed, nothing is written. If there is a page with this name that mapmore did
    not write, it is not changed, and `warn` is called. Raises WriteError if the page cannot be
    written.
    """
    place = runs / PAGE
    if not finished and not place.is_file():
        return
    with run_lock(runs, patient=True), refusals_told(runs):
        refuse_irregular(place)
        known = rows_of(place)
        if known is None:
            warn(f"{place}: is not a page of runs, and stays as it is")
            return
        of_run: dict[str, list[RunRow]] = {}
        for row in known:
            of_run.setdefault(row.run, []).append(row)
        of_run |= {run.name: _rows(run, of_run.get(run.name, ())) for run in finished}
        there = {entry.name for entry in os.scandir(runs)}
        rows = [row for run, of_one in of_run.items() if run in there for row in of_one]
        rows.sort(key=lambda row: (-row.ended, row.run, row.target))
        if rows != known:
            write_own(place, _page(runs, rows))


def _rows(run: Finished, known: Iterable[RunRow]) -> list[RunRow]:
    """Return the rows of a run, one for each output. If the run has not changed since the `known`
    rows were written, these rows are returned.
    """
    ended, mark = (run.run_dir / "scores.json").stat().st_mtime, mark_of(run.run_dir)
    same = [row for row in known if (row.mark, row.ended) == (mark, ended)]
    if same and {alert for row in same for alert in row.alerts} == {*run.alerts}:
        return same
    record = json.loads((run.run_dir / RUN_RECORD).read_bytes())
    muscle, data = "", list[str]()
    with suppress(LookupError, TypeError):
        muscle = record["stages"]["report"]["slice"]["muscle"]["name"]
    with suppress(LookupError, TypeError):
        data = [str(path) for path in record["stages"]["ingest"]["slice"]["data"]["files"]]
    stages = record["stages"].items()
    seconds = {name: round(stage["seconds"], 3) for name, stage in stages if "seconds" in stage}
    files = RunFiles(run.run_dir)
    rows = []
    scored = zip(run.table.each, files.validation().each, files.dataset().each, strict=True)
    for table, validation, dataset in scored:
        scores = deciding(table.scores)
        target = scores[0].target if scores else ""
        row = RunRow(
            run=run.name,
            muscle=str(muscle or ""),
            campaign=str(record.get("origin", {}).get("campaign", "")),
            data=f"{data[0]} and {len(data) - 1} more" if data[1:] else "".join(data),
            target=target,
            split=scores[0].split if scores else "",
            nrmse={
                score.model: round(100 * score.nrmse, 6)
                for score in scores
                if score.model != REPEATABILITY and np.isfinite(score.nrmse)
            },
            alerts=tuple(alert for alert in run.alerts if alert.target in ("", target)),
            ended=ended,
            picture=_picture(validation, dataset),
            seconds=seconds,
            mark=mark,
        )
        rows.append(row)
    return rows


def _picture(validation: Validation, dataset: Any) -> tuple[str, str]:
    """Return the measured and the predicted values along the first held-out curve as two SVG paths.
    If nothing is held out, the first curve is drawn.
    """
    from mapmore_cli.reporting.figures.elements import path

    curves = (validation.shown or dataset).curves
    number = next((i for i, curve in enumerate(curves) if curve.held_out.any()), 0)
    curve, predicted = curves[number], validation.predictions[OWN][number]
    name = dataset.target
    x = curve.columns.get(validation.along, np.arange(curve.size))
    rows = np.argsort(x, kind="stable") if "time" not in curve.columns else np.arange(curve.size)
    rows = rows[np.unique(np.linspace(0, curve.size - 1, POINTS).round().astype(int))]
    lines = [curve.columns[name][rows], predicted[rows]] if name in curve.columns else []
    known = np.concatenate([line[np.isfinite(line)] for line in lines]) if lines else np.array([])
    if not known.size:
        return "", ""
    low, high = known.min(), max(known.max(), known.min() + 1e-300)
    across = np.linspace(1, WIDTH - 1, len(rows))
    scale = (HEIGHT - 2) / (high - low)
    measured, predicted_path = (path(across, HEIGHT - 1 - scale * (y - low)) for y in lines)
    return measured, predicted_path


def _page(runs: Path, rows: Sequence[RunRow]) -> str:
    """Return the page of all runs as HTML, with the given rows."""
    from mapmore_cli.reporting.order import RUN_PAGE
    from mapmore_cli.reporting.scripts import joined, json_text, scripts
    from mapmore_cli.reporting.table import environment, title_of

    pages = {row.run for row in rows if (runs / row.run / RUN_PAGE).is_file()}
    return (
        environment()
        .get_template("runs.html")
        .render(
            rows=rows,
            pages=pages,
            page=RUN_PAGE,
            title_of=title_of,
            mark=MARK,
            data=json_text([asdict(row) for row in rows]),
            size=(WIDTH, HEIGHT),
            scripts=scripts([joined("tables.js", "runs.js")]),
        )
    )
