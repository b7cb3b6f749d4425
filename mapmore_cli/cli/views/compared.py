"""Views of scores, and of comparisons: has a muscle changed?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.views.view import View

if TYPE_CHECKING:
    from mapmore_cli.domain.scores import Published, ScoreTable, Validation
if TYPE_CHECKING:
    from mapmore_cli.modelling.comparison import Comparison


def of_scores(table: ScoreTable, published: Published | None = None) -> View:
    """The score rows of every curve in the document; the pooled ones in the table, beside what a publication reports."""
    from mapmore_cli.reporting.score_tables import score_table
    from mapmore_cli.storage.score_files import score_row

    rows = [score_row(score) for score in table.scores]
    return View({"scores": rows, "units": table.units}, (score_table(table.scores, table.units, published, table.failed),))


def of_validation(validation: Validation) -> View:
    """The scores pooled and by curve, and the formulas that were fitted as competitors."""
    from mapmore_cli.reporting.model_tables import rival_minima
    from mapmore_cli.reporting.score_tables import curve_scores_table

    pooled = of_scores(validation.table)
    formulas = {name: asdict(formula) for name, formula in validation.formulas.items()}
    unit = next(iter(validation.units.values()), "")
    lines = tuple(told for name, formula in validation.formulas.items() for told in rival_minima(name, formula, unit))
    tables = (*pooled.tables, curve_scores_table(validation.scores, validation.units))
    loud = tuple(f"warning: {warning}" for warning in validation.warnings)
    return View({**pooled.document, "formulas": formulas, "warnings": validation.warnings}, tables, (*loud, *lines))


ONE_CURVE = 2 / 3
"""Weight of one curve from which on the statement is about that curve above all."""


def of_comparisons(names: Sequence[str], results: Sequence[Comparison]) -> View:
    """The last model against the first, curve by curve; every model where there are more than two. The document has every term."""
    from mapmore_cli.reporting.comparison_tables import changes_table, drift_table

    last = results[-1]
    document = {"before": names[0], "after": names[-1], **_document(last)}
    if len(results) > 1:
        document["campaigns"] = [{"after": name, **_ends(one)} for name, one in zip(names[1:], results, strict=True)]
    tables = [changes_table(last), *([drift_table(names, results)] if len(results) > 1 else [])]
    return View(document, tuple(tables), (verdict(names[0], names[-1], last), *cautions(last)))


def verdict(before: str, after: str, found: Comparison) -> str:
    """One of three answers, with its numbers and where the change is largest."""
    low, high = found.interval
    margin = f"{100 * found.margin:g} %"
    size = f"force is {found.ratio:.4f} times that of {before} (95 % interval {low:.4f} to {high:.4f}, {len(found.curves)} curves)"
    if found.answer == "changed":
        largest = found.by_effect[0]
        place = ", ".join(f"{name} {value:.4g}" for name, value in largest.place.items())
        where = f"The largest effect is at {largest.curve}: {largest.largest:+.3g} {found.unit} at {place}"
        return f"{after} has changed: {size}. {where}."
    if found.answer == "same":
        low, high = found.narrow
        return f"{after} is the same within {margin}: {size}; two one-sided tests show it (90 % interval {low:.4f} to {high:.4f})."
    return f"The data cannot tell whether {after} has changed by more than {margin}: {size}."


def cautions(found: Comparison) -> list[str]:
    """What the reader has to know of the interval."""
    heaviest = max(found.curves, key=lambda curve: curve.weight)
    notes = []
    if heaviest.weight > ONE_CURVE:
        notes.append(
            f"{100 * heaviest.weight:.0f} % of the weight is on one curve, {heaviest.curve}: the statement is about that one above all."
        )
    if any(curve.interpolated for curve in found.curves):
        notes.append("The levels of the two differ: one of them is interpolated between its curves.")
    return notes


def _ends(found: Comparison) -> dict[str, Any]:
    return {
        "answer": found.answer,
        "changed": found.changed,
        "ratio": found.ratio,
        "interval": found.interval,
        "interval_90": found.narrow,
        "p": found.p,
        "p_permutation": found.p_permutation,
    }


def _document(found: Comparison) -> dict[str, Any]:
    terms = [{**asdict(term), "moved": term.moved} for term in found.terms]
    return {**_ends(found), "margin": found.margin, "unit": found.unit, "curves": [asdict(curve) for curve in found.curves], "terms": terms}
