"""docs/scale.md says what the simulation says, and the simulation what can be reckoned by hand."""

import re

import pytest
import scale_tables as scale
from hypothesis import strategies as st
from page_tables import DOCS, numbers, page_table


def test_the_table_is_the_one_of_the_page():
    told = page_table("limits", DOCS / "scale.md")
    runs = scale.recorded()
    assert len(told) == 9
    for name, row in told.items():
        assert numbers(row)["client"] < 0.5 * numbers(row)["file system"]
        count, workers = map(int, name.split(" on "))
        if count > 1_000:
            continue
        loads = [runs[number % len(runs)] for number in range(count)]
        assert row["what limits"] == scale.bounds(loads, workers).limit
        assert numbers(row)["simulated"] == pytest.approx(scale.simulated(loads, workers), rel=1e-3)


parts = st.floats(0, 5, width=16)


def test_commands_of_the_page_are_ours():
    from typer.main import get_command

    from mapmore_cli.cli.app import app

    batch = get_command(app).get_command(None, "batch")
    known = {option for parameter in batch.params for option in parameter.opts}
    used = {
        option
        for line in re.findall(r"mapmore.*batch.*", (DOCS / "scale.md").read_text())
        for option in re.findall(r"--[a-z-]+", line)
    }
    assert used
    assert used - {"--nthreads"} <= known
