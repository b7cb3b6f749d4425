"""One stage made and committed: its outputs beside the old ones, moved in whole, then its entry in
`run.json`.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.domain.processors import THREADS
from mapmore_cli.fitting.stage import Progress, Warn, Workspace
from mapmore_cli.pipeline.staleness import Plan
from mapmore_cli.storage.atomic import link_or_copy, refusals_told
from mapmore_cli.storage.run_folder import stage_folder, swap_in
from mapmore_cli.storage.run_record import (
    Origin,
    StageRecord,
    load_records,
    save_records,
    stamps_of,
    take_stamp,
    tool_versions,
)

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

    from mapmore_cli.spec.loader import LoadedSpec


@dataclass(frozen=True)
class StageMaker:
    """Makes the stages of a run; those that the run in the folder `like` has made from the same are
    taken over.
    """

    loaded: LoadedSpec
    run_dir: Path
    origin: Origin
    progress: Progress
    warn: Warn
    like: Path | None = None
    searched: bool = False

    def make(
        self, plan: Plan, why: str, needed: Mapping[str, Path], records: Mapping[str, StageRecord]
    ) -> dict[str, StageRecord]:
        """Run one stage and commit it; the records with its entry. `needed` are the folders of the
        runs whose models it needs.
        """
        started, stage = time.perf_counter(), plan.stage
        with refusals_told(self.run_dir), stage_folder(self.run_dir, stage.name) as out:
            if not self._taken_over(plan, out):
                with _one_blas_thread():
                    where = (self.run_dir, out, self.loaded.folder)
                    stage.run(
                        plan.part,
                        Workspace(
                            *where,
                            self.progress,
                            self.warn,
                            needed,
                            self.loaded.resolved,
                            self.searched,
                        ),
                    )
            written = {path.name for path in out.iterdir()}
            if written != set(stage.outputs):  # the stage itself is wrong
                raise RuntimeError(
                    f"stage {stage.name} wrote {sorted(written)} and declares "
                    f"{sorted(stage.outputs)}"
                )
            outputs = stamps_of(out, stage.outputs)
            swap_in(out, self.run_dir, stage.outputs)
            seconds = round(time.perf_counter() - started, 3)
            made = (plan.fingerprint, stage.revision, plan.before, plan.slice, plan.inputs, outputs)
            committed = {**records, stage.name: StageRecord(*made, tool_versions(), seconds, why)}
            save_records(self.run_dir, self.loaded.spec.name, self.origin, committed)
        return committed

    def _taken_over(self, plan: Plan, out: Path) -> bool:
        """Put the files that another run made from the same into `out`; False where it has none.

        They are linked where the file system can, as files of runs are replaced and never written
        into, and hashed before they count.
        """
        if self.like is None:
            return False
        known = load_records(self.like, lambda _message: None).get(plan.stage.name)
        if known is None or (known.fingerprint, known.tools) != (plan.fingerprint, tool_versions()):
            return False
        if set(known.outputs) != set(plan.stage.outputs):  # the page: it has links into its own run
            return False
        for name, stamp in known.outputs.items():
            with suppress(OSError):
                link_or_copy(self.like / name, out / name)
            if (
                not (out / name).is_file() or take_stamp(out / name).sha256 != stamp.sha256
            ):  # replaced meanwhile
                for left in out.iterdir():
                    left.unlink()
                return False
        return True


@contextmanager
def _one_blas_thread() -> Iterator[None]:
    """Hold BLAS to one thread: the same sums on every machine, and no fight between runs for the
    processors.

    A library that is loaded already is told so. One that a stage loads, as SciPy's, reads it in the
    environment when it starts.
    """
    with variables_set(dict.fromkeys(THREADS, "1")):
        loaded = "scipy.linalg" in sys.modules or "scipy.special" in sys.modules
        with _thread_pools(loaded).limit(limits=1):
            yield


@contextmanager
def variables_set(variables: Mapping[str, str]) -> Iterator[None]:
    """Set variables of the environment for a while."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            os.environ |= {} if value is None else {name: value}


@cache
def _thread_pools(_with_scipy: bool) -> ThreadpoolController:
    """Return the libraries with threads loaded; looked for when SciPy's has come too, else once: it
    takes longer than a small stage.
    """
    import numpy  # noqa: F401 - has one of them
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
