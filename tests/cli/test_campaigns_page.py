"""docs/campaigns.md says what the comparisons say: its promises hold in its tables, and some of its numbers are made again."""

from __future__ import annotations

import re
from pathlib import Path

import campaign_tables
import pytest
from page_tables import DOCS

from mapmore_cli.modelling.validation.comparison import compare

PAGE = DOCS / "campaigns.md"


def rows(name: str) -> list[list[str]]:
    """The cells of a table, row by row, without its heading."""
    block = re.search(rf"<!-- table {name} -->\n(.*?)<!-- end -->", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert block
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in block[1].splitlines() if line.startswith("|")][2:]


def test_few_false_alarms_and_a_change_of_three_per_cent_is_found() -> None:
    called = {(int(row[0]), float(row[1])): int(row[2].split()[0]) for row in rows("detection")}
    assert set(called) == {(count, factor) for count in (4, 8) for factor in (1.0, 1.01, 1.02, 1.03, 1.05)}
    for count in (4, 8):
        assert called[count, 1.0] <= 1
        assert called[count, 1.03] >= 18


def test_what_did_not_change_is_shown_to_be_the_same() -> None:
    """The three answers add up, and pairs without a change are seldom left open."""
    for row in rows("detection"):
        changed, same, unclear = (int(cell.split()[0]) for cell in row[2:5])
        assert changed + same + unclear == 20
        if float(row[1]) == 1.0:
            assert same >= 18


def test_measured_repeats_are_no_change_and_other_lengths_are() -> None:
    for before, after, *_, called in rows("festo"):
        same = before.split(",")[0] == after.split(",")[0]
        assert (called == "changed") != same, (before, after)


def test_the_first_pairs_are_the_ones_of_the_page() -> None:
    told = [[float(cell) for cell in row[1:]] for row in rows("first")]
    found = [[one.ratio, *one.interval] for one in campaign_tables.pairs(4, 1.03, len(told))]
    for mine, theirs in zip(found, told, strict=True):
        assert mine == pytest.approx(theirs, abs=1e-5)


@pytest.mark.long  # simulated campaigns are compared above
@pytest.mark.usefixtures("measured_data")
def test_a_measured_repeat_is_the_one_of_the_page(tmp_path: Path) -> None:
    found = compare(campaign_tables.festo(30, "9", tmp_path), campaign_tables.festo(30, "10", tmp_path))
    told = next(row for row in rows("festo") if row[:2] == ["30 cm, repeat 9", "30 cm, repeat 10"])
    assert [found.ratio, *found.interval] == pytest.approx([float(cell) for cell in told[2:5]], abs=2e-4)
