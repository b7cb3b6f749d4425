"""docs/campaigns.md says what the comparisons say: its promises hold in its tables, and some of its
numbers are made again.
"""

from itertools import product

import campaign_tables
import pytest
from page_tables import DOCS, rows_of

from mapmore_cli.modelling.validation.comparison import compare

PAGE = DOCS / "campaigns.md"


def test_what_is_promised_and_said_follows_from_the_tables():
    """Few false alarms, a change of 3 % is found, and what did not change is shown to be the same;
    the three answers add up.
    """
    calls = {
        (int(count), float(factor)): [int(cell.split()[0]) for cell in cells[:3]]
        for count, factor, *cells in rows_of("detection", PAGE)
    }
    assert {*calls} == {*product((4, 8), (1.0, 1.01, 1.02, 1.03, 1.05))}
    assert {sum(answers) for answers in calls.values()} == {20}
    assert all(answers[0] == 20 for (_, factor), answers in calls.items() if factor > 1.01)
    (changed_4, same_4, _), (changed_8, same_8, _) = calls[4, 1.0], calls[8, 1.0]
    assert max(changed_4, changed_8) <= 1 < 18 <= min(same_4, same_8)
    pairs = [(one[:5] == other[:5], called) for one, other, *_, called in rows_of("festo", PAGE)]
    repeats = [called for same, called in pairs if same]
    others = [called for same, called in pairs if not same]
    assert ({*others}, "changed" in repeats) == ({"changed"}, False)
    text = PAGE.read_text(encoding="utf-8")
    for said in (
        f"{len(repeats)} pairs of repetitions",
        f"None of them is called changed: {repeats.count('same')} are called the same, and for "
        f"{repeats.count('cannot tell')} the program",
        f"called different in all {len(others)} pairs",
    ):
        assert said in text


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
