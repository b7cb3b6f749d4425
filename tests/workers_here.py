"""Workers of `batch` without processes: to start one takes longer than a small run."""

from __future__ import annotations

from mapmore_cli.domain.errors import MapmoreError


class Here:
    """Workers that are this process."""

    def __init__(self, *_):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def each(self, function, jobs):
        for number, job in enumerate(jobs):
            try:
                yield number, function(job)
            except MapmoreError as error:
                yield number, error
