"""Print messages on stderr while a command works: its stages, its progress and warnings."""

from __future__ import annotations

import re
import sys
import time
import warnings
from collections import Counter
from contextlib import ExitStack
from types import TracebackType
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import RunWarning, UsageError
from mapmore_cli.domain.foreign import printable

if TYPE_CHECKING:
    from rich.progress import Progress

    from mapmore_cli.pipeline.runner import Listeners

PATIENCE = 1.0
"""Time in seconds after which the progress of work is shown."""

SOME_RUNS = 3
"""Largest number of runs whose names are printed with a warning."""

MOST_OF_A_KIND = 10
"""Largest number of printed warnings that are equal without the words that contain a digit."""

LINE_EVERY = 5.0
"""Seconds between two lines of progress if stderr is no terminal."""


def _kind(message: str) -> str:
    """Return a message without the words that contain a digit, such as numbers and names of files.
    Messages that differ only in such words then become equal.
    """
    return re.sub(r"\S*\d\S*", "", message)


class Reporter:
    """Printer of the messages of a command on stderr. Use it as a context manager, because warnings
    are printed at its end. If `quiet` is True, only errors are printed.

    On a terminal, progress is shown as a bar, otherwise as lines. Work that takes less than
    `PATIENCE` seconds shows no progress.
    """

    def __init__(self, quiet: bool = False, verbose: bool = False) -> None:
        if quiet and verbose:
            raise UsageError("--quiet and --verbose exclude each other", "leave out one of them")
        self._quiet = quiet
        self._verbose = verbose
        self._bar: Progress | None = None
        self._task = ""  # name of the work in progress
        self._due = 0.0  # time at which its progress is shown next, in seconds of `time.monotonic`
        self._stage: tuple[str, float] | None = None
        self._cleanup = ExitStack()
        self._warnings: dict[str, list[str]] = {}

    def __enter__(self) -> Reporter:
        self._cleanup.enter_context(warnings.catch_warnings())
        if self._quiet:
            warnings.simplefilter("ignore")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        where: TracebackType | None,
    ) -> None:
        self._end_task()
        if error is None:
            self._end_stage()
        self._tell_warnings()
        self._cleanup.close()

    @property
    def listeners(self) -> Listeners:
        """Functions that `bring_up_to_date` calls to report on the stages of a run."""
        return {"progress": self.progress, "warn": self.warn, "on_stage": self.stage}

    def say(self, message: str) -> None:
        """Print one line, unless `quiet` is set."""
        if not self._quiet:
            self.complain(message)

    def warn(self, message: str) -> None:
        """Collect a warning. When the command ends, the warning is printed once, with the names of
        the runs that it concerns.
        """
        run, text = (
            (message.run, message.message) if isinstance(message, RunWarning) else ("", message)
        )
        runs = self._warnings.setdefault(text, [])
        if run not in runs:
            runs.append(run)

    def _tell_warnings(self) -> None:
        counts = Counter(map(_kind, self._warnings))
        shown = Counter[str]()
        for message, runs in self._warnings.items():
            kind = _kind(message)
            shown[kind] += 1
            if shown[kind] > MOST_OF_A_KIND:
                continue
            named = [run for run in runs if run]
            if len(runs) == 1:
                self.say(f"warning: {': '.join([*named, message])}")
            else:
                some = ", ".join(named[:SOME_RUNS]) + (", ..." if len(named) > SOME_RUNS else "")
                self.say(f"warning: {message} (the same in {len(runs)} runs: {some})")
            if shown[kind] == MOST_OF_A_KIND < counts[kind]:
                more = counts[kind] - MOST_OF_A_KIND
                self.say(f"warning: {more} more warnings like this one, {counts[kind]} in all")

    def complain(self, message: str) -> None:
        """Print a message, for example an error, even if `quiet` is set."""
        self._end_task()
        print(printable(message), file=sys.stderr)

    def stage(self, name: str, reason: str | None) -> None:
        """Print the `reason` why a stage runs, or that the stage is up to date if `reason` is
        None.
        """
        self._end_stage()
        self.say(f"{name}: {'up to date' if reason is None else f'runs ({reason})'}")
        self._stage = None if reason is None else (name, time.monotonic())

    def progress(self, task: str, done: int, total: int) -> None:
        """Show that `done` of `total` steps of long work are done. `task` names the work. The
        function has the type `fitting.stage.Progress`.
        """
        if self._quiet:
            return
        now = time.monotonic()
        if task != self._task:
            self._end_task()
            self._task, self._due = task, now + PATIENCE
        if now < self._due:
            return
        if sys.stderr.isatty():
            self._draw(task, done, total)
        else:
            print(f"{task}: {done} of {total}", file=sys.stderr)
            self._due = now + LINE_EVERY

    def _draw(self, task: str, done: int, total: int) -> None:
        if self._bar is None:
            from rich.console import Console
            from rich.progress import Progress

            # Rich's own thread would compete with the computation, so the bar is drawn here.
            self._bar = Progress(console=Console(stderr=True), transient=True, auto_refresh=False)
            self._bar.start()
            self._bar.add_task(task)
        self._bar.update(self._bar.task_ids[0], completed=done, total=total)
        self._bar.refresh()
        self._due = time.monotonic() + 0.1

    def _end_task(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None
        self._task = ""

    def _end_stage(self) -> None:
        if self._stage is not None and self._verbose:
            name, started = self._stage
            self.say(f"{name}: done in {time.monotonic() - started:.2f} s")
        self._stage = None
