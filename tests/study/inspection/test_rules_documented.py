"""Every issue that a rule can raise is explained in the docs, and no other."""

from __future__ import annotations

import re
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[3]


def test_the_page_lists_the_issues_of_all_rules() -> None:
    sources = (PROJECT / "mapmore_cli/study/inspection").rglob("*.py")
    raised = {id_ for path in sources for id_ in re.findall(r'Issue\([^,]*(?:, )"([a-z-]+)"', path.read_text())}
    page = (PROJECT / "docs/init-and-check.md").read_text()
    rows = [line.split("|")[1] for line in page.splitlines() if re.search(r"\| (?:error|warning|hint)\b", line)]
    documented = {id_ for row in rows for id_ in re.findall(r"`([a-z-]+)`", row)}
    assert raised == documented
    assert len(raised) > 10
