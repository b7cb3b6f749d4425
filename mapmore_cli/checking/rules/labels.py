"""A rule about what figures will say, so that a long run does not end at its last step."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.checking.rules import Issue, Subject
from mapmore_cli.storage.tables.cells import shortened


def formulas_in_labels(subject: Subject) -> Iterator[Issue]:
    """Find labels with a formula that cannot be set."""
    for quantity, label in subject.spec.report.style.labels.items():
        if "$" not in label:
            continue
        from mapmore_cli.reporting.figures.style import wrong_formula

        if fault := wrong_formula(label):
            place = subject.where("report", "style", "labels", quantity)
            message, remedy = (
                f"report.style.labels.{quantity}: {shortened(label)!r} cannot be set ({fault})",
                "mend the formula between the dollars, or remove the dollars",
            )
            yield Issue("error", "label", place, message, remedy)
