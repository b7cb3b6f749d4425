"""Write the results of runs for CI servers (JUnit XML) and for people (a Markdown summary)."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass

from mapmore_cli.domain.foreign import xml_text
from mapmore_cli.domain.scores import OWN, Limit
from mapmore_cli.reporting.table import Table, markdown_text, to_markdown


@dataclass(frozen=True)
class RunReport:
    """Result of a run for a CI server. `failure` is the reason why the run failed, or None.
    `limits` are the limits that the spec sets for its scores.
    """

    name: str
    seconds: float = 0.0
    failure: str | None = None
    limits: tuple[Limit, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def missed(self) -> tuple[Limit, ...]:
        """Limits that the scores of the run do not keep."""
        return tuple(limit for limit in self.limits if not limit.kept)


def to_junit(runs: Sequence[RunReport]) -> str:
    """Return JUnit XML with a test case for every run, and one for every limit that the key
    `validate.require` sets.
    """
    cases = [case for run in runs for case in _cases(run)]
    failures, errors = (
        sum(case.find(kind) is not None for case in cases) for kind in ("failure", "error")
    )
    seconds = sum(run.seconds for run in runs)
    counts = {
        "tests": str(len(cases)),
        "failures": str(failures),
        "errors": str(errors),
        "time": f"{seconds:.3f}",
    }
    suites = ET.Element("testsuites", counts)
    suite = ET.SubElement(suites, "testsuite", {"name": "mapmore", **counts, "skipped": "0"})
    suite.extend(cases)
    ET.indent(suites)
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(suites, encoding="unicode") + "\n"
    )


def _cases(run: RunReport) -> list[ET.Element]:
    ended = _case(run.name, "run", run.seconds)
    if run.failure is not None:
        ET.SubElement(
            ended, "error", {"message": xml_text(run.failure.splitlines()[0])}
        ).text = xml_text(run.failure, "\t\n")
    if run.warnings:
        ET.SubElement(ended, "system-err").text = xml_text("\n".join(run.warnings), "\t\n")
    cases = [ended]
    for limit in run.limits:
        case = _case(run.name, f"require {limit.metric}{limit.model.removeprefix(OWN)}", 0.0)
        if not limit.kept:
            ET.SubElement(case, "failure", {"message": xml_text(limit.sentence)})
        cases.append(case)
    return cases


def _case(run: str, name: str, seconds: float) -> ET.Element:
    return ET.Element(
        "testcase",
        {"classname": f"mapmore.{xml_text(run)}", "name": name, "time": f"{seconds:.3f}"},
    )


def to_summary(runs: Sequence[RunReport], tables: Sequence[Table]) -> str:
    """Return a Markdown text with the number of successful runs, the reasons why the other runs
    failed, and the tables.
    """
    bad = [run for run in runs if run.failure is not None or run.missed]
    lines = [f"## mapmore: {len(runs) - len(bad)} of {len(runs)} runs in order", ""]
    for run in bad:
        reasons = (
            [run.failure] if run.failure is not None else [limit.sentence for limit in run.missed]
        )
        lines += [
            f"- **{markdown_text(run.name)}**: {markdown_text(' '.join(reason.split()))}"
            for reason in reasons
        ]
    return "\n".join([*lines, *([""] if bad else []), *(to_markdown(table) for table in tables)])
