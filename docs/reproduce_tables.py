"""Write the table of docs/reproduce.md on the papers: `PYTHONPATH=.:docs/papers python
docs/reproduce_tables.py RUNS`, where RUNS is the folder that `make paper` filled.
"""

from __future__ import annotations

import sys
from pathlib import Path

from comparison import HERE, PaperResult, compare_paper, counts
from pages import write_page
from paper import load_paper

from mapmore_cli.reporting.table import Cell, Table

KINDS = ("claim", "order", "size")
"""What is counted: claims, complete orders of models, and numbers that agree within a factor."""


def papers(runs: Path) -> Table:
    """Return for each paper how many of its claims, orders and numbers agree with our runs."""
    columns = (
        "paper",
        *("claims", "claims that hold"),
        *("orders of models", "orders that agree"),
        *("numbers", "numbers that agree within their factor"),
    )
    results = [
        compare_paper(load_paper(path), runs, lambda message: print(message, file=sys.stderr))[0]
        for path in sorted(HERE.glob("*.yaml"))
    ]
    title = "What the papers print and claim, and how much of it our simulated muscles show"
    return Table.of("papers", title, columns, [_row(result) for result in results])


def _row(result: PaperResult) -> tuple[Cell, ...]:
    found = counts(result.compared)
    pairs = [found.get(kind, (0, 0)) for kind in KINDS]
    return result.loaded.spec.paper, *(
        number for holds, total in pairs for number in (total, holds)
    )


if __name__ == "__main__":
    write_page("reproduce.md", {"papers": papers})
