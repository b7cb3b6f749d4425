"""`mapmore check`: everything that can be said about a study before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import DataError, MapmoreError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.runner import pipeline
from mapmore_cli.pipeline.search import SEARCH, read_search
from mapmore_cli.pipeline.staleness import needed_runs
from mapmore_cli.spec.loader import LoadedSpec
from mapmore_cli.spec.sections.data import Split
from mapmore_cli.study.inspection.rules import OF_CURVES, OF_RECORDINGS
from mapmore_cli.study.inspection.subject import ORDER, Cause, Issue, Subject


@dataclass(frozen=True)
class Inspection:
    """The curves, unless none could be made, and all issues, the worst first."""

    dataset: Dataset | None
    issues: tuple[Issue, ...]

    @property
    def verdict(self) -> MapmoreError | None:
        """The error to end with, None without errors: the spec is to be mended before the data are looked at again."""
        errors = [issue for issue in self.issues if issue.severity == "error"]
        if not errors:
            return None
        kind = SpecError if any(issue.cause == "spec" for issue in errors) else DataError
        return kind(f"{len(errors)} error{'s' if len(errors) > 1 else ''}: {', '.join(dict.fromkeys(issue.id for issue in errors))}")


def inspect(
    loaded: LoadedSpec, run_dir: Path | None = None, progress: Progress = lambda *_: None, warn: Callable[[str], None] = lambda _: None
) -> Inspection:
    """Apply every rule; writes nothing.

    Where the curves cannot be made, the recordings alone are looked at: strain in per cent is why no sample was at its level. What the
    search in `run_dir` noted is told again, as that a black box errs less.

    Raises
    ------
    SpecError, DataError
        What is wrong with a spec that this one builds on; what made the curves impossible, where no rule has anything to add.
    """
    needed = {run.key: run.loaded for stage in pipeline() for run in needed_runs(stage, loaded, ())}
    part = slice_of(loaded.spec)
    try:
        dataset = build_dataset(part, loaded.folder, progress=progress, warn=warn)
    except (SpecError, DataError) as fault:
        found = _of_recordings_alone(loaded)
        if not found:
            raise
        return Inspection(None, _sorted((*found, _issue_of(fault, loaded))))
    issues = _issues(loaded, dataset)
    same = {key: dataset if slice_of(other.spec) == part else None for key, other in needed.items()}
    others = [issue for key, other in needed.items() for issue in _of_another(key, other, same[key])]
    return Inspection(dataset, _sorted((*issues, *others, *_of_search(loaded, run_dir))))


def _of_search(loaded: LoadedSpec, run_dir: Path | None) -> Iterator[Issue]:
    """Yield what the search of a run noted, where the spec leaves the structure to it."""
    if run_dir is not None and loaded.spec.model.type == AUTO and (run_dir / SEARCH).is_file():
        for note in read_search(run_dir / SEARCH).notes:
            yield Issue("hint", "structure", loaded.where("model"), note, "its table of what was tried is on the page of the run")


def _issues(loaded: LoadedSpec, dataset: Dataset) -> tuple[Issue, ...]:
    subject = Subject(loaded.spec, loaded.where, dataset.recordings, slice_of(loaded.spec).units, loaded.folder, dataset)
    return tuple(issue for rule in (*OF_RECORDINGS, *OF_CURVES) for issue in rule(subject))


def _of_another(key: str, loaded: LoadedSpec, dataset: Dataset | None) -> Iterator[Issue]:
    """Return the errors of a run that this one needs or is compared with, which would end both; `dataset` where recordings are shared."""
    try:
        found = _issues(loaded, dataset or build_dataset(slice_of(loaded.spec), loaded.folder))
    except (SpecError, DataError) as fault:
        found = (_issue_of(fault, loaded),)
    yield from (replace(issue, message=f"in `{key}`: {issue.message}") for issue in found if issue.severity == "error")


def _of_recordings_alone(loaded: LoadedSpec) -> tuple[Issue, ...]:
    """Return what the rules say about the columns as they stand in the files; nothing where these cannot be read either."""
    part = slice_of(loaded.spec)
    bare: dict[str, Any] = {"derive": {}, "keep": [], "cycles": None, "levels": None, "split": Split()}
    bare |= {"missing": "drop", "repeated_time": "average"}
    try:
        plain = build_dataset(replace(part, data=part.data.model_copy(update=bare)), loaded.folder)
    except (SpecError, DataError):
        return ()
    subject = Subject(loaded.spec, loaded.where, plain.recordings, part.units, loaded.folder)
    return tuple(issue for rule in OF_RECORDINGS for issue in rule(subject))


def _issue_of(fault: SpecError | DataError, loaded: LoadedSpec) -> Issue:
    cause: Cause = "spec" if isinstance(fault, SpecError) else "data"
    return Issue("error", "no-curves", loaded.where("data"), fault.message, fault.remedy or "mend the other issues first", cause)


def _sorted(issues: tuple[Issue, ...]) -> tuple[Issue, ...]:
    return tuple(sorted(issues, key=lambda issue: ORDER.index(issue.severity)))
