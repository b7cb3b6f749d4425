"""Views of scores."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

from mapmore_cli.cli.views.view import View

if TYPE_CHECKING:
    from mapmore_cli.domain.scores import Published, Validation
    from mapmore_cli.reporting.tables import Table


def of_scores(validation: Validation, published: Published | None = None) -> View:
    """The score rows of every curve in the document; the pooled ones in the table, beside what a publication reports."""
    from mapmore_cli.storage.artefacts.score_table import score_row

    rows = [score_row(score) for score in validation.scores]
    return View({"scores": rows, "units": validation.units}, (pooled_table(validation, published),))


def of_validation(validation: Validation) -> View:
    """The scores pooled and by curve, and the formulas that were fitted as competitors."""
    from mapmore_cli.reporting.model_tables import rival_minima
    from mapmore_cli.reporting.tables import curve_scores_table

    pooled = of_scores(validation)
    formulas = {name: asdict(formula) for name, formula in validation.formulas.items()}
    unit = next(iter(validation.units.values()), "")
    lines = tuple(told for name, formula in validation.formulas.items() for told in rival_minima(name, formula, unit))
    tables = (*pooled.tables, curve_scores_table(validation.scores, validation.units))
    return View({**pooled.document, "formulas": formulas}, tables, lines)


def pooled_table(validation: Validation, published: Published | None = None) -> Table:
    """Scores over all curves, beside the numbers of a publication."""
    from mapmore_cli.reporting.tables import score_table

    failed = [name for name, formula in validation.formulas.items() if formula.failed]
    return score_table(validation.scores, validation.units, published, failed)
