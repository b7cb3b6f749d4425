"""docs/control.md says what the loop does."""

import control_tables
import pytest
from page_tables import DOCS, numbers, page_table


@pytest.mark.parametrize("feed", ["mapmore", pytest.param("nothing", marks=pytest.mark.long)])
def test_the_page_has_the_errors_of_the_loop(feed, tmp_path):
    row = numbers(page_table("tracking", DOCS / "control.md")[feed])
    assert [row["RMSE"], row["largest error"]] == pytest.approx(
        control_tables.errors(feed, tmp_path), rel=0.01
    )
