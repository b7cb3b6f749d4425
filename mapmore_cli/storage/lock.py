"""One process at a time writes a run."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mapmore_cli.domain.errors import WriteError
from mapmore_cli.storage.atomic import refusals_told

LOCK = ".lock"


@contextmanager
def run_lock(run_dir: Path) -> Iterator[None]:
    """Hold the run; WriteError at once where another process holds it. The system frees it when its holder dies."""
    from filelock import FileLock, Timeout

    lock = FileLock(run_dir / LOCK, timeout=0)
    try:
        with refusals_told(run_dir):
            lock.acquire()
    except Timeout:
        remedy = "wait until it is done, or choose another folder with --runs"
        raise WriteError(f"{run_dir}: another process is writing this run", remedy) from None
    try:
        yield
    finally:
        lock.release()
