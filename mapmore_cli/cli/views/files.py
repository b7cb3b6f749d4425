"""Views of result files, whatever their kind, and of whole run folders."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import NoneType
from typing import Any

from mapmore_cli.cli.console import View
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.page import RUN_PAGE
from mapmore_cli.reporting.score_tables import score_table
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.storage import artefacts
from mapmore_cli.storage.run_folder import RESULTS
from mapmore_cli.storage.run_record import load_records, scores_in, stale_stages


def of_file(path: Path, warn: Callable[[str], None], unverified: bool) -> View:
    """Return what a result file or a run folder holds; DataError where it is neither.

    `warn` is told where nothing shows that a file is as it was written; one that is not is only read where it may be `unverified`.
    """
    if path.is_dir():
        return of_run(path)
    if path.suffix == ".json":
        return _of_json(path)
    view = _of_hdf5(path, warn, unverified)
    stage = next((stage for stage, name in RESULTS.items() if name == path.name), "")
    return replace(view, lines=(*view.lines, *(line for name, line in _stale(path.parent).items() if name == stage)))


def of_stage(stage: str, run_dir: Path) -> View:
    """Return what a stage found."""
    if stage in RESULTS:
        return _of_hdf5(run_dir / RESULTS[stage])
    page = run_dir / RUN_PAGE
    files = tuple(str(path) for path in sorted(page.parent.rglob("*")) if path.is_file())
    return View({"files": files}, lines=page_lines(run_dir) or files)


def of_run(run_dir: Path) -> View:
    """Return what a run is made of: why each stage ran, and the scores."""
    record = run_dir / "run.json"
    if not record.is_file():
        raise DataError(f"{run_dir}: is not a run folder (no run.json)", "name a folder that `mapmore run` wrote, as runs/NAME")
    run = _of_json(record)
    stale = _stale(run_dir)
    document = {**run.document, "stale": list(stale)}
    if not (run_dir / RESULTS["validate"]).is_file():
        return replace(run, document=document, lines=(*run.lines, *stale.values()))
    scores = of_stage("validate", run_dir)
    return View({**document, **scores.document}, (*run.tables, *scores.tables[:1]), (*stale.values(), *page_lines(run_dir)))


def _stale(run_dir: Path) -> dict[str, str]:
    """Stages of a run whose results are older than what they were made from, each with a line that says so."""
    found = stale_stages(load_records(run_dir, lambda _message: None))
    return {name: f"{name} is out of date: {before} was done again since; run the spec to renew it" for name, before in found.items()}


def page_lines(run_dir: Path) -> tuple[str, ...]:
    """Where the page is, for people; nothing where the spec asks for none."""
    page = run_dir / RUN_PAGE
    return (f"page: {page}",) if page.is_file() else ()


def _of_hdf5(path: Path, warn: Callable[[str], None] = lambda _message: None, unverified: bool = False) -> View:
    from mapmore_cli.cli.views import compared, models

    match artefacts.kind_of(path):
        case "dataset":
            return models.of_dataset(artefacts.read_dataset(path, warn, unverified))
        case "segmentation":
            return models.of_segmentation(artefacts.read_segmentation(path, warn, unverified))
        case "fit":
            return models.of_fit(artefacts.read_fit(path, warn, unverified))
        case "model":
            return models.of_model(artefacts.read_model(path, warn, unverified))
        case _:
            return compared.of_validation(artefacts.read_validation(path, warn, unverified))


def _of_json(path: Path) -> View:
    """`scores.json` or `run.json`, as they are; the table has what fits on a screen."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as fault:
        raise DataError(f"{path}: cannot be read ({fault})", "give a file that mapmore wrote") from fault
    if isinstance(document, dict) and _are_entries(document.get("stages"), _STAGE):
        return View(document, (_stages_table(document["stages"]),))
    try:
        found = scores_in(document)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError) as fault:
        raise DataError(f"{path}: is neither a scores.json nor a run.json", "give a file that mapmore wrote") from fault
    return View(document, (score_table(found.scores, found.units, failed=found.failed),))


_STAGE: Mapping[str, Any] = {"seconds": (float, int, NoneType), "why": (str, NoneType)}
"""What the table of stages takes from an entry, and of which types."""


def _are_entries(entries: Any, types: Mapping[str, Any]) -> bool:
    """Whether something maps to mappings whose values have the types that are wanted of them."""
    return isinstance(entries, dict) and all(
        isinstance(entry, dict) and all(isinstance(entry.get(name), kind) for name, kind in types.items()) for entry in entries.values()
    )


def _stages_table(stages: Mapping[str, Any]) -> Table:
    rows = tuple((name, entry.get("seconds"), entry.get("why")) for name, entry in stages.items())
    return Table("stages", "Stages", (Column("stage"), Column("took", "s", ".2f"), Column("why it ran")), rows)
