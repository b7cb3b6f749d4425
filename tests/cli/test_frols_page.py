"""docs/frols.md: its example prints what it says, our columns are computed anew, and its sentences
are those of the table.
"""

import contextlib
import io
import sys
from pathlib import Path

import pytest
from page_tables import DOCS, block_of, page_table

sys.path.insert(0, str(Path(__file__).parents[1] / "bench"))

from peer_cases import cases, largest

from mapmore_cli.modelling.frols import frols

PAGE = DOCS / "frols.md"
TEXT = PAGE.read_text(encoding="utf-8")
CASES = {name: (P, y, k) for name, P, y, k in cases()}


def test_the_example_prints_what_the_page_says():
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(block_of(PAGE, "python"), {})
    assert f"prints `{printed.getvalue().strip()}`" in TEXT


@pytest.mark.parametrize("name", CASES)
def test_our_columns_are_true(name):
    P, y, k = CASES[name]
    row = page_table("cases", PAGE)[name]
    found = frols(P, y, k)
    terms, share = row["ours"].split(": ")
    assert (int(terms), int(row["asked for"])) == (len(found.chosen), k)
    assert float(share) == pytest.approx(100 * found.err.sum(), abs=2e-8)
    assert float(row["largest"]) == pytest.approx(100 * largest(P, y), abs=2e-8)
    assert found.err.sum() <= largest(P, y) + 1e-12
