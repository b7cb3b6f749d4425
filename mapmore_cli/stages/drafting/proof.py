"""A draft is tried before it is handed out: what fails its own check or run is made simpler, and says why."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.modelling.pieces.backbone_choice import FEW
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.sections.method import AUTO
from mapmore_cli.spec.yaml_core import dump
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.inspection.lint import inspect
from mapmore_cli.stages.pipeline.runner import bring_up_to_date

MOST_ROWS = 20_000  # of recordings, up to which the fit is tried as well: longer ones hardly lack samples


def proven(draft: Draft, folder: Path) -> Draft:
    """The draft, or the first of its simpler forms that passes; DataError where none does."""
    faults: list[str] = []
    for candidate in _simpler(draft):
        fault = _fault(candidate, folder)
        if fault is None:
            return candidate.noted(("target",), _why(candidate, faults[0]), False) if faults else candidate
        faults.append(fault.message)
    raise DataError(f"{draft.name}: {faults[0]}", "write the spec by hand")


def _why(draft: Draft, fault: str) -> str:
    before = draft.notes.get(("target",))
    told = f"made simpler, as {' '.join(fault.split())[:160]}"
    return told if before is None else f"{before.why}; {told}"


def _simpler(draft: Draft) -> Iterator[Draft]:
    """The draft, then without one thing after the other that data may be too few or too odd for."""
    yield draft
    steps: tuple[Callable[[Draft], Draft], ...] = (
        lambda one: one.without("model", "validate"),
        lambda one: one.without("segment"),
        lambda one: one.with_section("fit", {"max_terms": 1}),
        lambda one: one.without_data("cycles", "keep", "derive"),
        lambda one: one.without_data("split"),
        lambda one: one.without("segment").without_data("levels"),
    )
    for step in steps:
        simpler = step(draft)
        if simpler.spec != draft.spec:
            draft = simpler
            yield draft
    yield _straight(draft)


def _straight(draft: Draft) -> Draft:
    """A straight line over the first input: the least that is a model."""
    target = draft.spec["target"]
    output = target["column"] if isinstance(target, dict) else "force"
    beside = [name for entry in draft.data["files"] if isinstance(entry, dict) for name in entry.get("set", {})]
    inputs = [name for name in (*draft.data["columns"], *beside) if name not in ("time", output)]
    draft = draft.without_data("resample", "gaps")
    return draft.with_section("dictionary", [{"polynomial": {"of": inputs[:1], "order": 1}}])


def _fault(draft: Draft, folder: Path) -> MapmoreError | None:
    """What `check` or, of short recordings, `run` has against a draft; None for nothing."""
    with TemporaryDirectory() as place:
        path = Path(place) / "draft.yaml"
        try:
            path.write_text(dump(_chosen(_absolute(draft.spec, folder))), encoding="utf-8")
            loaded = load(path)
            found = inspect(loaded)
            if found.verdict is not None:
                return DataError("; ".join(issue.message for issue in found.issues if issue.severity == "error"))
            if found.dataset is not None and sum(curve.size for curve in found.dataset.curves) <= MOST_ROWS:
                bring_up_to_date(loaded, Path(place) / "runs", until="fuse")
        except MapmoreError as fault:
            return fault
    return None


def _chosen(spec: dict[str, Any]) -> dict[str, Any]:
    """The spec with the backbone named that a choice falls back to: the choice leaves out what cannot be fitted, and takes its time."""
    model = spec.get("model", {})
    return {**spec, "model": {**model, "backbone": FEW}} if model.get("backbone") == AUTO else spec


def _absolute(spec: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The spec with paths that mean the same from anywhere."""
    start = glob.escape(str(folder.resolve()))

    def moved(log: dict[str, Any]) -> dict[str, Any]:
        files = [{**entry, "path": f"{start}/{entry['path']}"} if isinstance(entry, dict) else f"{start}/{entry}" for entry in log["files"]]
        return {**log, "files": files}

    data = moved(spec["data"])
    return {**spec, "data": {**data, "join": [moved(log) for log in data["join"]]} if "join" in data else data}
