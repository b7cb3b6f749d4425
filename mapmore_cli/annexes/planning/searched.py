"""Search the structure of a study for the command `mapmore search`."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Unpack

from mapmore_cli.domain.results import Search
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.runner import (
    FOUND,
    Listeners,
    bring_up_to_date,
)
from mapmore_cli.pipeline.staleness import as_found
from mapmore_cli.storage.atomic import write_text
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import SEARCH_STAGE
from mapmore_cli.study.loader import LoadedSpec, load
from mapmore_cli.study.yaml_loader import as_overrides


def searched(
    loaded: LoadedSpec, runs: Path, budget: str | None, **listeners: Unpack[Listeners]
) -> tuple[Search, Path]:
    """Search the structure of a study, whatever its spec says about it; return the structures that
    were tried, and the spec that was found.

    Raises SpecError, DataError or FitError if the data cannot be read, or if no structure can be
    fitted.
    """
    asked: dict[str, Any] = {"model.type": AUTO}
    if loaded.spec.model.type != AUTO:
        asked = {"dictionary": None, "segment": None, "fit": None, "model": {"type": AUTO}}
    if budget is not None:
        asked["model.budget"] = budget
    loaded = load(loaded.path, (*loaded.overrides, *as_overrides(asked)))
    outcome = bring_up_to_date(loaded, runs, SEARCH_STAGE, **listeners)
    path = outcome.run_dir / FOUND
    write_text(
        path, as_found(loaded, outcome.run_dir).resolved_in(outcome.run_dir, given_only=True)
    )
    search = RunFiles(outcome.run_dir).search()
    assert search is not None
    return search, path
