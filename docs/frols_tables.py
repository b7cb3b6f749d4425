"""Writes the table of frols.md: `python docs/frols_tables.py [PYTHON]`, with the interpreter of the
peers' environment (`make peers`).
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from pages import DOCS, write_tables

from mapmore_cli.modelling.frols import frols
from mapmore_cli.reporting.table import Cell, Column, Columns, Table

BENCH = DOCS.parent / "tests" / "bench"
sys.path.insert(0, str(BENCH))

PEERS = ("sysidentpy", "fastcan", "pysindy")


def cell(terms: int, share: float) -> str:
    """Return number of terms, and the share in % with ten digits."""
    return f"{terms}: {100 * share:.8f}"


def ours() -> dict[str, tuple[int, str, str]]:
    """By case: the terms that are asked for, the largest share, and what `frols` selects."""
    from peer_cases import cases, largest  # type: ignore[import-not-found]

    rows = {}
    for name, P, y, k in cases():
        found = frols(P, y, k)
        rows[name] = (
            k,
            f"{100 * largest(P, y):.8f}",
            cell(len(found.chosen), float(found.err.sum())),
        )
    return rows


def table(python: Path) -> Table:
    """Terms and shares of every case."""
    said = subprocess.run(
        [python, BENCH / "peer_cases.py"], check=True, capture_output=True, text=True
    ).stdout
    peers = json.loads(said.splitlines()[-1])
    columns: Columns = ("case", "asked for", "largest [%]", "ours", *map(Column, PEERS))
    rows: list[tuple[Cell, ...]] = []
    for name, own in ours().items():
        rows.append((name, *own, *(cell(**peers[name][peer]) for peer in PEERS)))
    return Table.of("cases", "Number of terms, and the share that they explain", columns, rows)


if __name__ == "__main__":
    interpreter = Path(sys.argv[1] if len(sys.argv) > 1 else ".venv-bench/bin/python")
    write_tables(DOCS / "frols.md", {"cases": lambda: table(interpreter)})
