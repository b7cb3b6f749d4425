"""How much of the logs has been read, in megabytes: a single long one shows progress as well as many short ones."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from mapmore_cli.stages.ingestion.files import Log, Source
from mapmore_cli.stages.stage import Progress

MEGABYTE = 10**6


class Meter:
    """Counts the bytes of all logs of a study, joined ones each time that they are read, and tells `progress`."""

    def __init__(self, sources: Sequence[Source], progress: Progress) -> None:
        self._progress = progress
        self._total = sum(log.path.stat().st_size for source in sources for log in (source, *source.joined))
        self._before = 0

    def within(self, log: Log) -> Callable[[int], None]:
        """Begin with a log; the function returned is told how many bytes of it have been read."""
        before = self._before
        self._before += log.path.stat().st_size

        def tell(read: int) -> None:
            self._progress("MB read", (before + read) // MEGABYTE, -(-self._total // MEGABYTE))

        tell(0)
        return tell
