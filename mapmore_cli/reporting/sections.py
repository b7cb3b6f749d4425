"""List the sections of a page in their order. A new section is a new row in `SECTIONS`, with the
function that returns its tables.

A section shows the template `templates/sections/ID.html` if there is one, then its figures (see
`reporting.order.FIGURES`), then its tables.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from mapmore_cli.domain.fits import Fit
from mapmore_cli.modelling.kinds import kind_of_fit
from mapmore_cli.reporting import fit_tables, memory_tables, tables
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.score_tables import curve_scores_table, score_table, search_table
from mapmore_cli.reporting.table import Table


@dataclass(frozen=True)
class PageSection:
    """Section of a page.

    - `id`: its anchor on the page. Templates and `reporting.order.FIGURES` use the same id.
    - `tables`: function that returns the tables of the section for an output of a run.
    - `folded`: True if only its title is shown until a reader opens it.
    """

    id: str
    title: str
    tables: Callable[[ReportInputs], Iterable[Table]] = lambda _inputs: ()
    folded: bool = True


@runtime_checkable
class Paged(Protocol):
    """Kind of model from a plugin that has its own section on the page."""

    def section(self) -> PageSection:
        """Return the section of this kind of model. It has no tables if the run has no fit of this
        kind.
        """

    def show_fit(self, fit: Fit) -> tuple[dict[str, object], tuple[Table, ...]]:
        """Return a fit as entries of a JSON document, and as tables."""


def shown_by(fit: Fit | None) -> Paged | None:
    """Return the kind of model to which a fit belongs if this kind has its own section, otherwise
    None.
    """
    kind = kind_of_fit(fit)
    return kind if isinstance(kind, Paged) else None


def sections_of(inputs: ReportInputs) -> tuple[PageSection, ...]:
    """Return the sections of the page of a run. Each kind of model with its own section adds this
    section before the folded sections.
    """
    kinds = dict.fromkeys(filter(None, map(shown_by, inputs.fits.values())))
    first = sum(not section.folded for section in SECTIONS)
    return (*SECTIONS[:first], *(kind.section() for kind in kinds), *SECTIONS[first:])


def all_tables(inputs: ReportInputs) -> tuple[Table, ...]:
    """Return every table of the report in the order of the page, without the equations."""
    shown = [table for section in sections_of(inputs) for table in section.tables(inputs)]
    return (*shown, tables.equations_table(inputs.equations, inputs.other_equations))


def _of_models(inputs: ReportInputs) -> Iterable[Table]:
    validation = inputs.validation
    yield score_table(validation.scores, validation.units, inputs.published, inputs.failed)
    yield tables.bands_table(validation.bands, inputs.target.unit)


def _of_data(inputs: ReportInputs) -> Iterable[Table]:
    along = None if inputs.timed else inputs.in_curve.name
    yield tables.levels_table(inputs.dataset, along, inputs.whole)
    yield tables.recordings_table(inputs.whole)


def _of_terms(inputs: ReportInputs) -> Iterable[Table]:
    yield fit_tables.terms_table(inputs.fit)
    yield fit_tables.coefficients_table(inputs.fit, inputs.target.unit, inputs.model)
    yield fit_tables.outliers_table(inputs.validation.outliers, inputs.target.unit)
    if inputs.search is not None:
        yield search_table(inputs.search)
    if (memory := inputs.fit.memory) is not None:
        yield memory_tables.states_table(memory.model.states)
        yield memory_tables.sizes_table(memory)
        yield memory_tables.identified_table(memory)


def _of_formulas(inputs: ReportInputs) -> Iterable[Table]:
    pieces = inputs.model.pieces
    yield fit_tables.formulas_table(inputs)
    yield fit_tables.folds_table(pieces.cross_validation if pieces else (), inputs.target.unit)


SECTIONS = (
    PageSection(
        *("fit", "Curves, fit and error"),
        lambda own: [
            curve_scores_table(own.validation.scores, own.validation.units),
            tables.shape_table(own),
        ],
        folded=False,
    ),
    PageSection("nrmse", "Scores of all models", _of_models, folded=False),
    PageSection(
        *("equations", "The model in physical units"),
        lambda inputs: tables.limits_tables(inputs.model),
        folded=False,
    ),
    PageSection("data", "Your data as read", _of_data),
    PageSection(
        "segments", "Segments and their weights", lambda inputs: [fit_tables.segments_table(inputs)]
    ),
    PageSection("terms", "Selected terms", _of_terms),
    PageSection("formulas", "Fits of formulas", _of_formulas),
    PageSection("notes", "Notes, spec and provenance"),
)
