"""A draft is tried before it is handed out: what fails its own check or run is made simpler, and says why."""

from __future__ import annotations

import glob
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mapmore_cli.domain.errors import DataError, MapmoreError
from mapmore_cli.modelling.pieces.backbone_choice import FEW
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.yaml_core import dump
from mapmore_cli.stages.drafting.draft import Draft
from mapmore_cli.stages.drafting.trial import Trial, tried
from mapmore_cli.stages.inspection.lint import inspect


def proven(draft: Draft, folder: Path) -> Draft:
    """The draft, or the first of its simpler forms that passes, with what it scored; DataError where none does."""
    faults: list[str] = []
    for candidate in _simpler(draft):
        try:
            trial = _tried(candidate, folder)
        except MapmoreError as fault:
            faults.append(fault.message)
            continue
        return _told(candidate.noted(("target",), _why(candidate, faults[0]), False) if faults else candidate, trial)
    raise DataError(f"{draft.name}: {faults[0]}", "write the spec by hand")


def _told(draft: Draft, trial: Trial | None) -> Draft:
    """The draft with what its model scored; marked where the mean or a polynomial is better."""
    if trial is None:
        return draft
    chosen = draft.spec.get("model", {}).get("backbone") == AUTO
    before = draft.notes.get(("target",))
    told = f"tried{f' with the backbone {FEW}' if chosen else ''}: {trial}"
    doubtful = trial.bad and not (chosen and trial.own.r2 > 0)  # the choice has the polynomials as well
    return draft.noted(("target",), told if before is None else f"{before.why}; {told}", not doubtful and (before is None or before.sure))


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


def _tried(draft: Draft, folder: Path) -> Trial | None:
    """The scores of a draft; MapmoreError for what `check` or `run` has against it."""
    with TemporaryDirectory() as place:
        path = Path(place) / "draft.yaml"
        path.write_text(dump(_chosen(_absolute(draft.spec, folder))), encoding="utf-8")
        loaded = load(path)
        found = inspect(loaded)
        if found.verdict is not None:
            raise DataError("; ".join(issue.message for issue in found.issues if issue.severity == "error"))
        return None if found.dataset is None else tried(loaded, found.dataset)


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
