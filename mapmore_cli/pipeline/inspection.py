"""Implement `mapmore check`, which applies all rules to a study before a model is computed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from mapmore_cli.checking.applied import issues_of, issues_without_curves
from mapmore_cli.checking.findings import Cause, Issue, is_for_the_spec
from mapmore_cli.domain.errors import DataError, MapmoreError, SpecError, Warn
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.fitting.stage import Progress
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import IngestSlice, slice_of
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.staleness import needed_runs, pipeline
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.loader import LoadedSpec

ORDER = ("error", "warning", "hint")


@dataclass(frozen=True)
class Inspection:
    """Result of an inspection.

    - `dataset`: the curves; None if they could not be made.
    - `issues`: all findings of the rules, the worst first.
    - `read_by`: the settings and the folder with which the data were read.
    """

    dataset: Dataset | None
    issues: tuple[Issue, ...]
    read_by: tuple[IngestSlice, Path]

    @property
    def verdict(self) -> MapmoreError | None:
        """Error that `mapmore check` raises at its end; None if no finding is an error. If at least
        one error is a mistake in the spec, it is a SpecError, because this mistake must be
        corrected before the data can be checked. Otherwise, it is a DataError.
        """
        errors = [issue for issue in self.issues if issue.severity == "error"]
        if not errors:
            return None
        kind = SpecError if is_for_the_spec(errors) else DataError
        return kind(
            f"{len(errors)} error{'s' if len(errors) > 1 else ''}: "
            f"{', '.join(dict.fromkeys(issue.id for issue in errors))}"
        )


def inspect(
    loaded: LoadedSpec,
    run_dir: Path | None = None,
    progress: Progress = lambda *_: None,
    warn: Warn = lambda _: None,
    before: Inspection | None = None,
) -> Inspection:
    """Apply every rule to a study, and return the findings. If `before` is an earlier inspection
    with the same settings for reading, the data of this inspection are used and not read again.

    If the curves cannot be made, only the recordings are checked. If the spec requests a search
    and a search has been run in `run_dir`, its findings are included, for example that a black box
    has a smaller error.

    Raises
    ------
    SpecError, DataError
        The spec of another run that this study needs has a mistake; or no curves can be made, and
        no rule gives the reason.
    """
    needed = {
        run.need.key: run.loaded for stage in pipeline() for run in needed_runs(stage, loaded)
    }
    part = slice_of(loaded.spec)
    read_by = part, loaded.folder
    try:
        if before is not None and before.dataset is not None and before.read_by == read_by:
            dataset = before.dataset
        else:
            dataset = build_dataset(part, loaded.folder, progress=progress, warn=warn)
    except (SpecError, DataError) as fault:
        if issues_of_other := issues_without_curves(loaded):
            return _sorted(None, [*issues_of_other, _no_curves(fault, loaded)], read_by)
        raise
    issues = issues_of(loaded, dataset, hints=True)
    # other runs that this run needs, or with which it is compared, are checked too: if one of
    # them fails, this run fails
    for key, other in needed.items():
        try:
            issues_of_other = issues_of(
                other,
                dataset
                if slice_of(other.spec) == part
                else build_dataset(slice_of(other.spec), other.folder),
            )
        except (SpecError, DataError) as fault:
            issues_of_other = [_no_curves(fault, other)]
        issues += [
            replace(issue, message=f"in `{key}`: {issue.message}")
            for issue in issues_of_other
            if issue.severity == "error"
        ]
    search = RunFiles(run_dir).search() if run_dir and loaded.spec.model.type == AUTO else None
    if search is not None:
        remedy = "the table of what it tried is on the page of the run"
        issues += [
            Issue("hint", "structure", loaded.where("model"), note, remedy) for note in search.notes
        ]
    return _sorted(dataset, issues, read_by)


def _no_curves(fault: SpecError | DataError, loaded: LoadedSpec) -> Issue:
    cause: Cause = "spec" if isinstance(fault, SpecError) else "data"
    return Issue(
        "error",
        "no-curves",
        loaded.where("data"),
        fault.message,
        fault.remedy or "correct the other issues first",
        cause,
    )


def _sorted(
    dataset: Dataset | None, issues: Iterable[Issue], read_by: tuple[IngestSlice, Path]
) -> Inspection:
    return Inspection(
        dataset, tuple(sorted(issues, key=lambda issue: ORDER.index(issue.severity))), read_by
    )
