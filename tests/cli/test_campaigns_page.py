"""docs/campaigns.md says what the comparisons say: its promises hold in its tables, and some of its
numbers are made again.
"""

import campaign_tables
import pytest
from page_tables import DOCS, rows_of

from mapmore_cli.modelling.validation.comparison import compare

PAGE = DOCS / "campaigns.md"


def test_the_first_pairs_are_the_ones_of_the_page():
    told = [[float(cell) for cell in row[1:]] for row in rows_of("first", PAGE)]
    found = [[one.ratio, *one.interval] for one in campaign_tables.pairs(4, 1.03, len(told))]
    for mine, theirs in zip(found, told, strict=True):
        assert mine == pytest.approx(theirs, abs=1e-5)


@pytest.mark.long  # simulated campaigns are compared above
@pytest.mark.usefixtures("measured_data")
def test_a_measured_repeat_is_the_one_of_the_page(tmp_path):
    found = compare(
        campaign_tables.festo(30, "9", tmp_path), campaign_tables.festo(30, "10", tmp_path)
    )
    told = next(
        row for row in rows_of("festo", PAGE) if row[:2] == ["30 cm, repeat 9", "30 cm, repeat 10"]
    )
    assert [found.ratio, *found.interval] == pytest.approx(
        [float(cell) for cell in told[2:5]], abs=2e-4
    )
