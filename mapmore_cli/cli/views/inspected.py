"""Views of what `mapmore check` found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.views import measured
from mapmore_cli.cli.views.view import View
from mapmore_cli.domain.errors import MapmoreError

if TYPE_CHECKING:
    from mapmore_cli.stages.inspection.lint import Inspection
    from mapmore_cli.stages.inspection.subject import Issue


def of_inspection(inspection: Inspection) -> View:
    """The curves where there are any, then the issues with their remedies, the worst first."""
    found = View({}) if inspection.dataset is None else measured.of_dataset(inspection.dataset)
    issues = [asdict(issue) for issue in inspection.issues]
    return View({**found.document, "issues": issues}, found.tables, (*found.lines, *_lines(inspection.issues)))


def of_campaign(results: Mapping[str, Inspection | MapmoreError]) -> View:
    """The issues of every run, or why it could not be looked at."""
    document: dict[str, Any] = {}
    lines: list[str] = []
    for run, result in results.items():
        if isinstance(result, MapmoreError):
            document[run] = {"error": str(result)}
            lines += [f"{run}:", f"error: {result}"]
        else:
            document[run] = {"issues": [asdict(issue) for issue in result.issues]}
            lines += [f"{run}:", *_lines(result.issues)] if result.issues else [f"{run}: no issues"]
    return View({"runs": document}, (), tuple(lines))


def _lines(issues: Sequence[Issue]) -> tuple[str, ...]:
    if not issues:
        return ("No issues.",)
    blocks = [(f"{issue.severity}: {issue.place}: {issue.message} [{issue.id}]", f"  {issue.remedy}") for issue in issues]
    return tuple(line for block in blocks for line in block)
