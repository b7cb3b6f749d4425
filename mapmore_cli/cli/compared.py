"""Show comparisons of models, searches for a structure, and the findings of `mapmore check`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from mapmore_cli.cli.console import Document, View, members
from mapmore_cli.cli.views import of_dataset
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.results import Search
from mapmore_cli.reporting.score_tables import changes_table, drift_table

if TYPE_CHECKING:
    from mapmore_cli.checking.findings import Issue
    from mapmore_cli.modelling.validation.comparison import Comparison
    from mapmore_cli.pipeline.inspection import Inspection


ONE_CURVE = 2 / 3
"""Weight of one curve above which a remark says that the result describes mainly this curve."""


def of_comparisons(names: Sequence[str], results: Sequence[Comparison]) -> View:
    """Return the view of a comparison of the last model with the first: a table with a row for each
    curve, and a sentence with the result. With more than two models, a second table has a row for
    each later model. The JSON document also contains the change of every term.
    """
    last = results[-1]
    document = {
        "before": names[0],
        "after": names[-1],
        **members(last, *ANSWER, "margin", "unit", "curves"),
        "terms": [{**asdict(term), "moved": term.moved} for term in last.terms],
    }
    tables = [changes_table(last)]
    if len(results) > 1:
        later = zip(names[1:], results, strict=True)
        document["campaigns"] = [
            {"after": name, **members(comparison, *ANSWER)} for name, comparison in later
        ]
        tables.append(drift_table(names, results))
    return View(document, tuple(tables), (_verdict(names[0], names[-1], last), *_cautions(last)))


ANSWER = (
    *("answer", "changed", "ratio", "interval", "interval_90=narrow"),
    *("resolution", "p", "p_permutation", "settings", "same_recordings"),
)


def of_campaigns(
    names: Sequence[str],
    results: Mapping[str, Comparison],
    things: str = "runs",
    only_in: Mapping[str, str] = {},
) -> View:
    """Return the view of several comparisons, with a row for each. If `things` is `runs`, every run
    of a campaign is compared with the same run of an earlier campaign. If `things` is `outputs`,
    every output of a model is compared with the same output of an earlier model. For each run that
    only one of two campaigns contains, `only_in` holds the name of this campaign.
    """
    runs = [{"run": run, **members(result, *ANSWER)} for run, result in results.items()]
    counts = Counter(result.answer for result in results.values())
    tally = ", ".join(f"{count} {answer}" for answer, count in sorted(counts.items()))
    lines = [f"{run}: {line}" for run, result in results.items() for line in _of_settings(result)]
    lines += [f"{run}: is only in {name}, and was not compared." for run, name in only_in.items()]
    table = drift_table([names[0], *results], [*results.values()])
    document = {"before": names[0], "after": names[1], "runs": runs, "only_in": dict(only_in)}
    return View(document, (table,), (f"{len(results)} {things}: {tally}.", *lines))


def _verdict(before: str, after: str, comparison: Comparison) -> str:
    """Return a sentence that says that the model has changed, that it has not changed, or that the
    data cannot show a change. The sentence contains the ratio of the outputs with its 95 %
    interval. If the model has changed, the sentence also says at which inputs the change is
    largest. If both models were made from the same recordings, the sentence only says that a
    difference comes from the settings.
    """
    low, high = comparison.interval
    margin = f"{100 * comparison.margin:g} %"
    size = (
        f"{comparison.output} is {comparison.ratio:.4f} times that of {before} "
        f"(95 % interval {low:.4f} to {high:.4f}, {len(comparison.curves)} curves)"
    )
    if comparison.same_recordings:
        return (
            f"{after} was made from the same recordings as {before}: a difference comes "
            f"from the settings, not from the muscle: {size}."
        )
    if comparison.answer == "changed":
        largest = comparison.by_effect[0]
        place = ", ".join(f"{name} {value:.4g}" for name, value in largest.place.items())
        effect = f"{largest.curve}: {largest.largest:+.3g} {comparison.unit} at {place}"
        return f"{after} has changed: {size}. The largest effect is at {effect}."
    if comparison.answer == "same":
        tests = "two one-sided tests show this (90 % interval {:.4f} to {:.4f})".format(
            *comparison.narrow
        )
        return f"{after} is the same within {margin}: {size}; {tests}."
    least = "the curves contain no information about it"
    if comparison.resolution < 1:
        least = (
            f"a change of less than {100 * comparison.resolution:.2g} % cannot be detected "
            "with these data"
        )
    return (
        f"The data cannot show whether {after} has changed by more than {margin}: {size}; {least}."
    )


def _cautions(comparison: Comparison) -> list[str]:
    """Return remarks about a comparison: the settings of the models differ, the result depends
    mainly on one curve, or a model had to be interpolated between its levels.
    """
    heaviest = max(comparison.curves, key=lambda curve: curve.weight)
    notes = list(_of_settings(comparison))
    if heaviest.weight > ONE_CURVE:
        share = f"{100 * heaviest.weight:.0f} % of the weight"
        notes.append(
            f"{share} lies on one curve, {heaviest.curve}: the result describes mainly this curve."
        )
    if any(curve.interpolated for curve in comparison.curves):
        notes.append(
            "The levels of the two models differ, so that one of them is interpolated "
            "between its curves."
        )
    return notes


def _of_settings(comparison: Comparison) -> Iterator[str]:
    """Yield one sentence that lists the settings in which the two models differ. Yield nothing if
    all settings are equal.
    """
    if comparison.settings:
        yield f"The settings differ: {'; '.join(comparison.settings)}."


def search_document(search: Search) -> Document:
    """Return a search as a JSON document: the structures that it tried, and the structure that it
    chose.
    """
    keys = ("family", "structure=words", "sections", "parameters", "error")
    errors = ("standard_error=spread", "above_best=excess", "parts_error=parts", "seconds")
    tried = [
        {**members(candidate, *keys, *errors), "failure": candidate.failure or None}
        for candidate in search.tried
    ]
    return {
        **members(search, "target", "left_out", "parts_left_out=parts", "scale", "cut", "notes"),
        **members(search.found, "found=words", "sections"),
        "tried": tried,
    }


def of_inspection(inspection: Inspection, unconfirmed: Sequence[str]) -> View:
    """Return the view of an inspection: the curves if the data could be read, then the issues with
    their remedies, the worst first, then the guesses in the spec that nobody has confirmed.
    """
    view = View({}) if inspection.dataset is None else of_dataset(inspection.dataset)
    lines = [*view.lines, *_issue_lines(inspection.issues)]
    lines += [f"not confirmed: {question}" for question in unconfirmed]
    if not inspection.issues and not unconfirmed:
        lines.append("No issues.")
    more = {"issues": inspection.issues, "unconfirmed": unconfirmed}
    return View({**view.document, **more}, view.tables, tuple(lines))


def of_campaign(results: Mapping[str, Inspection | MapmoreError]) -> View:
    """Return the view of the inspected runs of a campaign: the issues of every run, or the reason
    why the run could not be checked.
    """
    document: Document = {}
    lines: list[str] = []
    for run, result in results.items():
        if isinstance(result, MapmoreError):
            document[run] = {"error": str(result)}
            lines += [f"{run}:", f"error: {result}"]
        else:
            document[run] = {"issues": result.issues}
            lines += [f"{run}:{'' if result.issues else ' no issues'}"]
            lines += _issue_lines(result.issues)
    return View({"runs": document}, (), tuple(lines))


def _issue_lines(issues: Sequence[Issue]) -> list[str]:
    lines = []
    for issue in issues:
        lines += f"{issue.severity}: {issue.text}".splitlines()
    return lines
