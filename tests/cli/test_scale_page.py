"""docs/scale.md says what the simulation says, and the simulation what can be reckoned by hand."""

from __future__ import annotations

import re

import pytest
import scale_tables as scale
from hypothesis import given
from hypothesis import strategies as st
from page_tables import DOCS, numbers, page_table


def test_the_table_is_the_one_of_the_page():
    told = page_table("limits", DOCS / "scale.md")
    runs = scale.recorded()
    assert len(told) == 9
    for name, row in told.items():
        count, workers = map(int, name.split(" on "))
        if count > 1_000:
            continue
        loads = [runs[number % len(runs)] for number in range(count)]
        assert row["what limits"] == scale.bounds(loads, workers).limit
        assert numbers(row)["simulated"] == pytest.approx(scale.simulated(loads, workers), rel=1e-3)


def test_what_the_text_says_stands_in_the_table():
    told = page_table("limits", DOCS / "scale.md")
    assert told["10 on 64"]["what limits"] == told["10 on 1000"]["what limits"] == "longest run"
    assert told["1000 on 64"]["what limits"] == told["100000 on 1000"]["what limits"] == "workers"
    assert told["1000 on 1000"]["what limits"] == "longest run"
    by_run = {name: numbers(row) for name, row in told.items()}
    assert 1.25 < by_run["1000 on 64"]["simulated"] / by_run["1000 on 64"]["workers"] < 1.42
    assert 0.9 < by_run["100000 on 1000"]["file system"] / by_run["100000 on 1000"]["workers"] < 1
    assert all(row["client"] < 0.5 * row["file system"] for row in by_run.values())


def test_by_hand():
    work = [scale.Load(0, 0, seconds, 0) for seconds in (3, 1, 2)]
    assert [scale.simulated(work, workers) for workers in (1, 2, 3, 9)] == [6, 3, 3, 3]
    disk = [scale.Load(0, 1, 0, 2)] * 4
    assert [scale.simulated(disk, workers) for workers in (1, 4)] == [12, 12]
    sent = [scale.Load(5, 0, 1, 0)] * 3
    assert [scale.simulated(sent, workers) for workers in (1, 3)] == [16, 16]
    assert scale.bounds(sent, 3).limit == "client and scheduler"


parts = st.floats(0, 5, width=16)


@given(
    loads=st.lists(st.tuples(parts, parts, parts, parts), min_size=1, max_size=12),
    workers=st.integers(1, 6),
)
def test_nothing_is_faster_than_on_paper(loads, workers):
    found = [scale.Load(*load) for load in loads]
    took = scale.simulated(found, workers)
    assert took >= scale.bounds(found, workers).least * (1 - 1e-12)
    assert took <= sum(map(sum, loads)) * (1 + 1e-12)


def test_commands_of_the_page_are_ours():
    from typer.main import get_command

    from mapmore_cli.cli.app import app

    batch = get_command(app).commands["batch"]
    known = {option for parameter in batch.params for option in parameter.opts}
    used = {
        option
        for line in re.findall(r"mapmore.*batch.*", (DOCS / "scale.md").read_text())
        for option in re.findall(r"--[a-z-]+", line)
    }
    assert used
    assert used - {"--nthreads"} <= known
