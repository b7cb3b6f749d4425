"""Workers of `batch` without processes: to start one takes longer than a small run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from mapmore_cli.domain.errors import MapmoreError


class Here:
    """Workers that are this process."""

    def __init__(self, *_: object) -> None:
        pass

    def __enter__(self) -> Here:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def each(
        self, function: Callable[[Any], Any], jobs: Sequence[Any]
    ) -> Iterator[tuple[int, Any]]:
        for number, job in enumerate(jobs):
            try:
                yield number, function(job)
            except MapmoreError as error:
                yield number, error
