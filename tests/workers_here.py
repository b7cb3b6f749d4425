"""Runs of `batch` without processes: to start one takes longer than a small run."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from typing import Any

from mapmore_cli.domain.errors import MapmoreError


def in_turn(
    work: Callable[[Any], Any], jobs: Mapping[int, Any], *_: object
) -> Generator[tuple[int, Any], None, None]:
    """Do all jobs in this process."""
    for number, job in jobs.items():
        try:
            yield number, work(job)
        except MapmoreError as error:
            yield number, error
