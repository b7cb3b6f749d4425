"""The voice on stderr: patient, plain where it is no terminal, silent on request."""

import sys
import warnings

import pytest

from mapmore_cli.cli import progress
from mapmore_cli.cli.progress import Reporter


class Clock:
    """A clock that stands still until it is told."""

    def __init__(self):
        self.now = 100.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    stopped = Clock()
    monkeypatch.setattr(progress, "time", stopped)
    return stopped


@pytest.fixture
def terminal(capsys, monkeypatch):
    monkeypatch.setattr(type(sys.stderr), "isatty", lambda _: True, raising=False)
    monkeypatch.setenv("TERM", "xterm-256color")


def work(reporter, clock, seconds, steps=100):
    for done in range(steps + 1):
        reporter.progress("fit", done, steps)
        clock.now += seconds / steps


@pytest.mark.parametrize(("pieces", "seconds"), [(1, 0.9), (10, 0.5)])
def test_quick_work_makes_no_noise(pieces, seconds, clock, capsys):
    """Patience starts anew with each piece of work."""
    with Reporter() as reporter:
        for number in range(pieces):
            reporter.progress(f"part {number}", 0, 1)
            clock.now += seconds
    assert capsys.readouterr().err == ""


def test_plain_lines_where_stderr_is_no_terminal(clock, capsys):
    with Reporter() as reporter:
        work(reporter, clock, 20)
    err = capsys.readouterr().err
    assert "\x1b" not in err
    assert "\r" not in err
    assert err.splitlines() == [
        "fit: 5 of 100",
        "fit: 30 of 100",
        "fit: 55 of 100",
        "fit: 80 of 100",
    ]


@pytest.mark.usefixtures("terminal")
def test_a_bar_on_a_terminal_is_gone_at_the_end(clock, capsys):
    with Reporter() as reporter:
        work(reporter, clock, 20)
        reporter.warn("few samples")
    err = capsys.readouterr().err
    assert "━" in err
    assert "\x1b[3" in err  # in colour
    assert err.endswith("warning: few samples\n")
    assert "\x1b[2K" in err  # the bar is erased before the warning


def test_quiet_is_silent_but_for_failures(clock, capsys):
    with Reporter(quiet=True) as reporter:
        work(reporter, clock, 20)
        reporter.stage("fit", "never ran")
        reporter.warn("few samples")
        warnings.warn("a library's opinion", stacklevel=1)
        reporter.complain("one of the runs failed")
    assert capsys.readouterr().err == "one of the runs failed\n"
