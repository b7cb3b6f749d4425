"""Put published tables, figures and claims beside numbers of ours: `make paper`.

    python docs/papers/compare.py [PAPER.yaml ...] [--runs DIR] [--out FILE]

Brings the runs of each paper up to date, judges by the rules of its file, and writes one page, and
beside it the same verdicts as JSON. The exit code is the highest of the runs, and 3 for a mistake
in a paper.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from comparison import (
    HERE,
    PaperResult,
    Told,
    compare_paper,
    counts,
    overview,
    page,
    verdicts_table,
)
from paper import PaperError, load_paper

from mapmore_cli.reporting.table import to_text


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the papers that the command line names, by default all beside this file."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("papers", nargs="*", type=Path, metavar="PAPER.yaml")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="folder of the runs")
    parser.add_argument("--out", type=Path, help="the page; RUNS/paper.html by default")
    asked = parser.parse_args(arguments)
    try:
        loaded = [load_paper(path) for path in asked.papers or sorted(HERE.glob("*.yaml"))]
    except PaperError as fault:
        print(fault, file=sys.stderr)
        return 3
    ended = [compare_paper(one, asked.runs, _complain) for one in loaded]
    papers = [result for result, _ in ended]
    target = asked.out or asked.runs / "paper.html"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(page(papers, target), encoding="utf-8")
    document = json.dumps([_document(one) for one in papers], indent=1, ensure_ascii=False)
    target.with_suffix(".json").write_text(document + "\n", encoding="utf-8")
    print(to_text(overview(papers)), to_text(verdicts_table(papers)), sep="\n")
    print(f"page: {target}")
    return max(code for _, code in ended)


def _complain(message: str) -> None:
    print(message, file=sys.stderr)


def _document(one: PaperResult) -> Mapping[str, Any]:
    return {
        "paper": one.loaded.spec.paper,
        "counts": {
            kind: {"agree": agree, "compared": every}
            for kind, (agree, every) in counts(one.compared).items()
        },
        "items": [
            {
                "id": result.item.id,
                "status": result.item.status,
                "verdicts": result.verdicts,
                "because": [_told(reason) for reason in result.reasons],
                "failed": result.failed or None,
            }
            for result in one.results
        ],
        "claims": [_told(claim) for claim in one.claims],
    }


def _told(one: Told) -> Mapping[str, Any]:
    shown = one.shown
    return {
        "says": shown.says,
        "holds": shown.holds,
        "verdict": one.verdict,
        "numbers": one.failed or one.numbers,
    }


if __name__ == "__main__":
    sys.exit(main())
