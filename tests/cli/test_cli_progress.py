"""The voice on stderr: patient, plain where it is no terminal, silent on request."""

import os
import sys
import threading
import warnings

import pytest

from mapmore_cli.cli import progress
from mapmore_cli.cli.progress import Reporter
from mapmore_cli.domain.errors import RunWarning


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


def work(reporter, clock):
    """A hundred steps in 20 s."""
    for done in range(101):
        reporter.progress("fit", done, 100)
        clock.now += 0.2


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
        work(reporter, clock)
    lines = [f"fit: {percent} of 100\n" for percent in (5, 30, 55, 80)]
    assert capsys.readouterr().err == "".join(lines)


def test_progress_is_shown_after_a_second_and_then_every_five_seconds(clock, capsys):
    with Reporter() as reporter:
        for done, wait in enumerate((0.0, 1.0, 4.5, 0.5)):
            clock.now += wait
            reporter.progress("fit", done, 9)
    assert capsys.readouterr().err == "fit: 1 of 9\nfit: 3 of 9\n"


@pytest.mark.usefixtures("terminal")
def test_a_bar_on_a_terminal_is_gone_at_the_end(clock, capsys):
    with Reporter() as reporter:
        work(reporter, clock)
        assert threading.active_count() == 1, "only the computation takes processor time"
        reporter.warn("few samples")
    err = capsys.readouterr().err
    assert "━" in err
    assert "\x1b[3" in err  # in colour
    assert err.endswith("warning: few samples\n")
    assert "\x1b[2K" in err.rpartition("━")[2]  # the bar is erased before the warning


@pytest.mark.usefixtures("terminal")
def test_a_bar_moves_ten_times_in_a_second(clock, capsys):
    with Reporter() as reporter:
        for done in range(101):
            reporter.progress("fit", done, 100)
            clock.now += 0.02
    assert capsys.readouterr().err.count("fit") == pytest.approx(10, abs=2)


def test_quiet_is_silent_but_for_failures(clock, capsys):
    with Reporter(quiet=True) as reporter:
        work(reporter, clock)
        reporter.stage("fit", "first time")
        reporter.warn("few samples")
        warnings.warn("a library's opinion", stacklevel=1)
        reporter.complain("one of the runs failed")
    assert capsys.readouterr().err == "one of the runs failed\n"


def test_ten_warnings_of_a_kind_are_printed_and_then_their_number(capsys):
    with Reporter() as reporter:
        for row in range(10_004):
            reporter.warn(f"log_{row % 7}.csv:row {row}: the value {row / 2} is odd")
        reporter.warn("few samples")
    lines = capsys.readouterr().err.splitlines()
    assert lines[9] == "warning: log_2.csv:row 9: the value 4.5 is odd"
    assert lines[10:] == [
        "warning: 9994 more warnings like this one, 10004 in all",
        "warning: few samples",
    ]


@pytest.mark.usefixtures("terminal")
@pytest.mark.parametrize(
    ("runs", "told"),
    [
        ([""], "warning: odd"),
        (["a"], "warning: a: odd"),
        (["a", "b"], "warning: odd (the same in 2 runs: a, b)"),
        (["a", "b", "a", "c"], "warning: odd (the same in 3 runs: a, b, c)"),
        (["a", "b", "c", "d"], "warning: odd (the same in 4 runs: a, b, c, ...)"),
    ],
)
def test_a_warning_of_several_runs_names_three_of_them(runs, told, capsys):
    with Reporter(quiet=False) as reporter:
        for run in runs:
            reporter.warn(RunWarning.of(run, "odd") if run else "odd")
    assert capsys.readouterr().err.splitlines() == [told]


def test_no_bar_has_a_colour_if_none_is_wanted(clock, capsys, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    with Reporter() as reporter:
        work(reporter, clock)
    assert "\x1b[3" not in capsys.readouterr().err


def test_no_color_is_an_option_anywhere_on_the_line(mapmore, monkeypatch):
    monkeypatch.setenv("NO_COLOR", "")
    mapmore("schema", "keys", "--no-color", code=0)
    assert os.environ["NO_COLOR"] == "1"
