"""The sections of a page, in its order: who adds one adds a row here, and its tables.

A section shows its words, its figures (`domain.scores.FIGURES` says which), its tables, and what
its template in `templates/` has to show besides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from mapmore_cli.reporting import memory_tables, tables
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.score_tables import curve_scores_table, score_table, search_table
from mapmore_cli.reporting.table import Table


@dataclass(frozen=True)
class Section:
    """One section of a page.

    - `id`: its anchor on the page, and the word that figures name it by.
    - `tables`, `words`: what it says of a run, in numbers and in sentences.
    - `template`: what else stands in it, in front of its tables; empty for nothing.
    - `folded`: whether a reader opens it.
    """

    id: str
    title: str
    tables: Callable[[ReportInputs], Iterable[Table]] = lambda _inputs: ()
    words: Callable[[ReportInputs], Iterable[str]] = lambda _inputs: ()
    template: str = ""
    folded: bool = True


def sections_of(inputs: ReportInputs) -> tuple[Section, ...]:
    """Return the sections of a run's page; kinds that have tables of their own have one each."""
    kinds = (
        Section(page.__name__.split(".")[-2], page.TITLE, page.tables) for page in inputs.pages
    )
    return (*SECTIONS[:3], *kinds, *SECTIONS[3:])


def all_tables(inputs: ReportInputs) -> tuple[Table, ...]:
    """Every table of the report, in the order of the page; equations stand there by themselves."""
    shown = [table for section in sections_of(inputs) for table in section.tables(inputs)]
    return (*shown, tables.equations_table(inputs.equations, inputs.other_equations))


def _of_curves(inputs: ReportInputs) -> Iterator[Table]:
    yield curve_scores_table(inputs.validation.scores, inputs.validation.units)


def _of_fit(inputs: ReportInputs) -> Iterator[str]:
    if not inputs.holds_out:
        yield "Nothing was held out: every curve trained the models."


def _of_models(inputs: ReportInputs) -> Iterator[Table]:
    scores = inputs.validation
    yield score_table(scores.scores, scores.units, inputs.published, inputs.failed)
    yield tables.bands_table(scores.bands, inputs.target.unit)


def _of_data(inputs: ReportInputs) -> Iterator[Table]:
    along = None if inputs.timed else inputs.in_curve.name
    yield tables.levels_table(inputs.dataset, along, inputs.whole)
    yield tables.recordings_table(inputs.whole)


def _of_no_segments(inputs: ReportInputs) -> Iterator[str]:
    if inputs.own in inputs.fits:
        yield "The model has no segments: its parts are in a table above."
    elif inputs.has_memory:
        yield "The model has no segments: it has memory, and runs along whole recordings."
    elif not inputs.has_pieces:
        yield "The model has no segments: it is a formula alone." + (
            " Those fitted to what it leaves did not help on left-out data (see the fits of "
            "formulas), and are listed for the record."
        ) * bool(inputs.fit.segments)


def _of_choice(inputs: ReportInputs) -> Iterator[str]:
    if not inputs.fit.pieces:
        yield "No terms were selected."
    if inputs.search is not None:
        yield (
            "The spec names no structure: it was searched on the training data. Taken: "
            f"{inputs.search.found.words}."
        )


def _of_terms(inputs: ReportInputs) -> Iterator[Table]:
    yield tables.terms_table(inputs.fit)
    yield tables.coefficients_table(inputs)
    if inputs.search is not None:
        yield search_table(inputs.search)
    if (memory := inputs.fit.memory) is not None:
        yield memory_tables.states_table(memory.model.states)
        yield memory_tables.sizes_table(memory)
        yield memory_tables.identified_table(memory)


def _of_formulas(inputs: ReportInputs) -> Iterator[Table]:
    pieces = inputs.model.pieces
    yield tables.formulas_table(inputs)
    yield tables.folds_table(pieces.cross_validation if pieces else (), inputs.target.unit)


def _of_no_formula(inputs: ReportInputs) -> Iterator[str]:
    if inputs.fit.formula is None and not inputs.validation.formulas:
        yield "No formula was fitted."


SECTIONS = (
    Section("fit", "Curves, fit and error", _of_curves, _of_fit, folded=False),
    Section("nrmse", "Scores of all models", _of_models, folded=False),
    Section(
        *("equations", "The model in physical units"),
        lambda inputs: tables.limits_tables(inputs.model),
        template="model.html",
        folded=False,
    ),
    Section("data", "Your data as read", _of_data),
    Section(
        *("segments", "Segments and their weights"),
        lambda inputs: [tables.segments_table(inputs)],
        _of_no_segments,
    ),
    Section("terms", "Selected terms", _of_terms, _of_choice),
    Section("formulas", "Fits of formulas", _of_formulas, _of_no_formula),
    Section("notes", "Notes, spec and provenance", template="notes.html"),
)
