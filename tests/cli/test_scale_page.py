"""docs/scale.md says what the simulation says, and the simulation what can be reckoned by hand."""

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
