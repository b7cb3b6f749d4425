"""Find out which runs of a campaign are up to date, without planning these runs. To plan a run
means to find out which of its stages are outdated, which takes a while.

A seal is a file in the folder of a run. It records the spec, the data and the options of the run,
and the sizes and times of its files. If all of them are unchanged, the stored result is used. Like
a plan, a seal does not notice a change that keeps the size and the time of a file; `--rehash` reads
the files again. Runs with a searched structure, and runs that need other runs, have no seal.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import TypeAdapter

from mapmore_cli.checking import findings
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.scores import Alert, Limit, Published
from mapmore_cli.ingestion.globs import expand, relative_name
from mapmore_cli.modelling.selection import AUTO
from mapmore_cli.pipeline.jobs import Finished, Job, run_one
from mapmore_cli.pipeline.staleness import needed_runs, pipeline
from mapmore_cli.storage.inputs import files_read
from mapmore_cli.storage.run_folder import RunFiles, is_tidy
from mapmore_cli.storage.run_record import RUN_RECORD, load_records, tool_versions, written_files
from mapmore_cli.storage.seals import (
    REVISION,
    Sealed,
    file_at,
    hashes_of,
    read_seal,
    states_of,
    still_holds,
    write_seal,
)
from mapmore_cli.storage.stamps import take_stamp
from mapmore_cli.study.loader import load
from mapmore_cli.study.variables import readable_variables

if TYPE_CHECKING:
    from mapmore_cli.study.loader import LoadedSpec

_LIMITS = TypeAdapter(tuple[Limit, ...])
_PUBLISHED = TypeAdapter(Published | None)
_ALERTS = TypeAdapter(tuple[Alert, ...])


def known_by_seal(job: Job, name: str) -> Finished | None:
    """Return the stored result of the run with this name. Return None if the run has no seal, if
    the seal shows that something has changed since (the spec, the data, the options, the program or
    the files of the run), or if the options `force` or `rehash` are set.
    """
    started, run_dir = time.perf_counter(), job.runs / name
    sealed = None if job.options.force or job.options.rehash else read_seal(run_dir)
    if sealed is None or sealed["question"] != _question(job, run_dir):
        return None
    answer = sealed["answer"]
    # raised if a source is missing, or if a pattern matches no file
    with suppress(OSError, DataError):
        if (
            not still_holds(run_dir, sealed)
            or not is_tidy(run_dir)
            or _named_by(answer["patterns"], job.config.parent) != answer["recordings"]
        ):
            return None
        table = RunFiles(run_dir).scores()
        return Finished(
            name,
            run_dir,
            dict.fromkeys(answer["stages"], "up-to-date"),
            table,
            _PUBLISHED.validate_python(answer["published"]),
            _LIMITS.validate_python(answer["limits"]),
            (*table.warnings, *answer["warnings"]),
            time.perf_counter() - started,
            _ALERTS.validate_python(answer["alerts"]),
        )
    return None


def run_and_seal(job: Job) -> Finished:
    """Bring one run up to date like `run_one`. Then write its seal, if no file changed during the
    run.
    """
    with files_read() as paths:
        loaded = load(job.config, job.overrides)
    run_dir = job.runs / loaded.spec.name
    specs = {os.path.relpath(path, run_dir) for path in paths}
    texts = _hashes_now(run_dir, specs)
    finished = run_one(job)
    if _can_be_sealed(loaded) and texts and _hashes_now(run_dir, specs) == texts:
        # without a seal, the next campaign examines every stage of this run
        with suppress(OSError, DataError):
            sealed = _sealed(job, loaded, finished, texts)
            if sealed is not None:
                write_seal(run_dir, sealed)
    return finished


def _hashes_now(run_dir: Path, specs: set[str]) -> dict[str, str]:
    """Return the hashes of the specs; an empty dictionary if one of the specs has disappeared."""
    with suppress(OSError):
        return hashes_of(run_dir, specs)
    return {}


def _can_be_sealed(loaded: LoadedSpec) -> bool:
    """Return True if the result of a run depends only on its own spec and sources, because its
    structure is not searched and it needs no other run.
    """
    return loaded.spec.model.type != AUTO and not any(
        needed_runs(stage, loaded) for stage in pipeline()
    )


def _sealed(
    job: Job, loaded: LoadedSpec, finished: Finished, texts: dict[str, str]
) -> Sealed | None:
    """Return the seal of a run that is up to date. Return None if a file differs from the record of
    the run, or if a recording that the spec names now was not read by the run.
    """
    run_dir, spec = finished.run_dir, loaded.spec
    folder = os.path.relpath(loaded.folder, run_dir)
    records = load_records(run_dir).values()
    recorded = {
        **{
            f"{folder}/{path}": stamp for record in records for path, stamp in record.inputs.items()
        },
        **written_files(run_dir),
    }
    files = states_of(run_dir, [*recorded, RUN_RECORD])
    for path, stamp in recorded.items():
        if take_stamp(file_at(run_dir, path), stamp).sha256 != stamp.sha256:
            return None
    entries = [*spec.data.files, *(path for join in spec.data.join for path in join.files)]
    patterns = [entry if isinstance(entry, str) else entry.path for entry in entries]
    recordings = _named_by(patterns, loaded.folder)
    read = {path for record in records for path in record.inputs}
    if not read.issuperset(recordings):
        return None
    sealed: Sealed = {
        "question": _question(job, run_dir),
        "texts": texts,
        "files": files,
        "answer": {
            "patterns": patterns,
            "recordings": recordings,
            "stages": [*finished.stages],
            "published": None if finished.published is None else asdict(finished.published),
            "limits": [asdict(limit) for limit in finished.limits],
            "warnings": list(findings.sentences(run_dir)),
            "alerts": [asdict(alert) for alert in finished.alerts],
        },
    }
    return sealed if still_holds(run_dir, sealed) else None


def _named_by(patterns: list[str], folder: Path) -> list[str]:
    """Return the paths of the recordings that the patterns match now, relative to the folder of the
    spec.
    """
    return [relative_name(path, folder) for pattern in patterns for path in expand(pattern, folder)]


def _question(job: Job, run_dir: Path) -> object:
    """Return everything that was asked of a run, as JSON values: the stage until which it runs,
    whether errors that the rules of `check` find stop it, the paths of its spec and its campaign,
    its overrides, the variables, and the version of the program.
    """
    campaign = job.options.campaign
    return [
        job.until,
        job.options.check,
        os.path.relpath(job.config, run_dir),
        "" if campaign is None else os.path.relpath(campaign, run_dir),
        list(job.overrides),
        readable_variables(),
        _program(),
    ]


@cache
def _program() -> Mapping[str, object]:
    """Return everything on which the results of a run depend, apart from specs and sources: the
    versions of the program, of its stages, and of the libraries that it uses.
    """
    return {
        **tool_versions(),
        "stages": {stage.name: stage.revision for stage in pipeline()},
        "rules": findings.REVISION,
        "seal": REVISION,
    }
