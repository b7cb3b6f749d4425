"""Runs of `batch` without processes: to start one takes longer than a small run."""

from mapmore_cli.domain.errors import MapmoreError


def in_turn(work, jobs, *_):
    """Do all jobs in this process."""
    for number, job in jobs.items():
        try:
            yield number, work(job)
        except MapmoreError as error:
            yield number, error
