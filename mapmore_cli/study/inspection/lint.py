"""`mapmore check`: everything that can be said about a study before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
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
from mapmore_cli.study.inspection.rules import ORDER, Cause, Issue, Rule, Subject, curves, samples, units

OF_RECORDINGS: tuple[Rule, ...] = (
    *(units.strain_in_per_cent, units.pressure_in_pascals, units.pressure_in_bar, units.pull_of_the_bore, units.time_in_milliseconds),
    *(units.unit_in_the_name, units.unit_line, samples.constant, samples.same_signal, samples.clipped, samples.cycles_of_noise),
    *(samples.force_never_pulls, samples.offset, curves.wrong_way_round, samples.recorded_twice),
)
"""Rules that need the recordings alone, so that they can say why no curves could be made of them."""

OF_CURVES: tuple[Rule, ...] = (
    *(curves.few_samples, curves.segments, curves.beyond_training, samples.many_dropped, samples.unsettled, samples.slack_foot),
    *(curves.single_valued, curves.loops_apart, curves.even_steps),
)
"""Rules that need the curves."""


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
        bare: dict[str, Any] = {"derive": {}, "keep": [], "cycles": None, "levels": None, "split": Split()}
        bare |= {"missing": "drop", "repeated_time": "average"}
        with suppress(SpecError, DataError):  # which say nothing where the files cannot be read either
            plain = build_dataset(replace(part, data=part.data.model_copy(update=bare)), loaded.folder)
            found = _issues(loaded, plain, curves=False)
            if found:
                return _sorted(None, [*found, _no_curves(fault, loaded)])
        raise
    issues = _issues(loaded, dataset)
    for key, other in needed.items():  # what would end a run that this one needs, or is compared with, would end both
        try:
            found = _issues(other, dataset if slice_of(other.spec) == part else build_dataset(slice_of(other.spec), other.folder))
        except (SpecError, DataError) as fault:
            found = [_no_curves(fault, other)]
        issues += [replace(issue, message=f"in `{key}`: {issue.message}") for issue in found if issue.severity == "error"]
    if run_dir is not None and loaded.spec.model.type == AUTO and (run_dir / SEARCH).is_file():
        remedy = "its table of what was tried is on the page of the run"
        issues += [Issue("hint", "structure", loaded.where("model"), note, remedy) for note in read_search(run_dir / SEARCH).notes]
    return _sorted(dataset, issues)


def _issues(loaded: LoadedSpec, dataset: Dataset, curves: bool = True) -> list[Issue]:
    """Return what the rules say of a dataset, or of its recordings alone."""
    subject = Subject(
        loaded.spec, loaded.where, dataset.recordings, slice_of(loaded.spec).units, loaded.folder, dataset if curves else None
    )
    return [issue for rule in (*OF_RECORDINGS, *(OF_CURVES if curves else ())) for issue in rule(subject)]


def _no_curves(fault: SpecError | DataError, loaded: LoadedSpec) -> Issue:
    cause: Cause = "spec" if isinstance(fault, SpecError) else "data"
    return Issue("error", "no-curves", loaded.where("data"), fault.message, fault.remedy or "mend the other issues first", cause)


def _sorted(dataset: Dataset | None, issues: Iterable[Issue]) -> Inspection:
    return Inspection(dataset, tuple(sorted(issues, key=lambda issue: ORDER.index(issue.severity))))
