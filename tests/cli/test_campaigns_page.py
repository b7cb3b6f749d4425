"""docs/campaigns.md says what the comparisons say: its promises hold in its tables, and some of its
numbers are made again.
"""

from __future__ import annotations

import campaign_tables
import pytest
from page_tables import DOCS, rows_of

from mapmore_cli.modelling.validation.comparison import compare

PAGE = DOCS / "campaigns.md"


def test_few_false_alarms_and_a_change_of_three_per_cent_is_found():
    called = {
        (int(row[0]), float(row[1])): int(row[2].split()[0]) for row in rows_of("detection", PAGE)
    }
    assert set(called) == {
        (count, factor) for count in (4, 8) for factor in (1.0, 1.01, 1.02, 1.03, 1.05)
    }
    for count in (4, 8):
        assert called[count, 1.0] <= 1
        assert called[count, 1.03] >= 18


def test_what_did_not_change_is_shown_to_be_the_same():
    """The three answers add up, and pairs without a change are seldom left open."""
    for row in rows_of("detection", PAGE):
        changed, same, unclear = (int(cell.split()[0]) for cell in row[2:5])
        assert changed + same + unclear == 20
        if float(row[1]) == 1.0:
            assert same >= 18


def test_the_sentences_follow_from_the_tables():
    text = PAGE.read_text(encoding="utf-8")
    found = {
        (int(row[0]), float(row[1])): [int(cell.split()[0]) for cell in row[2:5]]
        for row in rows_of("detection", PAGE)
    }
    changed, same, unclear = (
        [found[count, factor][i] for count in (4, 8)]
        for factor, i in ((1.0, 0), (1.0, 1), (1.01, 2))
    )
    assert "{} and {} of 20 are called changed, {} and {} the same".format(*changed, *same) in text
    by_one = (found[4, 1.01][0], found[8, 1.01][0])
    assert (
        "{} and {} are called changed; for {} and {} it cannot tell".format(*by_one, *unclear)
        in text
    )
    assert all(calls[0] == 20 for (_, factor), calls in found.items() if factor > 1.01)
    answers = [
        (row[0].split(",")[0] == row[1].split(",")[0], row[-1]) for row in rows_of("festo", PAGE)
    ]
    repeats = [answer for same, answer in answers if same]
    told = (len(repeats), repeats.count("same"), repeats.count("cannot tell"))
    assert (
        "Of {} pairs of repeats none is called changed: {} are the same, "
        "for {} it cannot tell".format(*told)
        in text
    )
    assert f"called changed in all {len(answers) - len(repeats)} pairs" in text


def test_measured_repeats_are_no_change_and_other_lengths_are():
    for before, after, *_, called in rows_of("festo", PAGE):
        same = before.split(",")[0] == after.split(",")[0]
        assert (called == "changed") != same, (before, after)


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
