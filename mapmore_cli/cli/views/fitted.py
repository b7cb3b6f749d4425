"""What a command has to show, in both forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from mapmore_cli.cli.views import running

if TYPE_CHECKING:
    from mapmore_cli.reporting.table import Table
if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, SegmentFit, Selection
    from mapmore_cli.domain.models import SegmentFunction
    from mapmore_cli.domain.results import FitResult


@dataclass(frozen=True)
class View:
    """A result as the members of one JSON document, as tables, and as closing lines for people."""

    document: Mapping[str, Any]
    tables: tuple[Table, ...] = ()
    lines: tuple[str, ...] = ()

    def under(self, head: Mapping[str, Any]) -> View:
        """Return the same view with `head` in front of its document."""
        return View({**head, **self.document}, self.tables, self.lines)


def of_fit(result: FitResult) -> View:
    """Return the segments, or the model with memory, with their terms in the order of selection; theta is in scaled coordinates."""
    from mapmore_cli.reporting.model_tables import terms_table

    document = {
        "segments": [segment_document(fit, fit.selection) for fit in result.pieces],
        "memory": running.memory_fit_document(result.memory),
        "motion": running.motion_fit_document(result.motion),
        "backbone": formula_document(result.formula),
        "notes": result.notes,
    }
    tables = [terms_table(result)] if result.pieces else []
    tables += running.memory_fit_tables(result.memory) if result.memory is not None else ()
    tables += running.motion_tables(result.motion) if result.motion is not None else ()
    return View(document, tuple(tables), (*formula_lines(result.formula), *result.notes))


def segment_document(named: SegmentFit | SegmentFunction, found: Selection | SegmentFunction) -> dict[str, Any]:
    """One segment function; theta is in scaled coordinates."""
    return {
        "id": named.id,
        "terms": named.terms,
        "theta": found.theta,
        "theta_error": found.theta_error,
        "g": found.g,
        "err": found.err,
        "scaling": asdict(named.scaling),
        "samples": found.samples,
        "stop": found.stop,
        "condition": found.condition,
    }


def formula_document(formula: FormulaFit | None) -> dict[str, Any] | None:
    """Return a fitted formula; None where there is none."""
    return None if formula is None else asdict(formula)


def formula_lines(formula: FormulaFit | None) -> tuple[str, ...]:
    """Its parameters in a line, and other minima that fit nearly as well."""
    from mapmore_cli.modelling.literature.own import units_of_parameters
    from mapmore_cli.reporting.model_tables import rival_minima

    if formula is None:
        return ()
    units = units_of_parameters(formula)
    parameters = ", ".join(f"{name} = {value:.6g} {units.get(name, '')}".rstrip() for name, value in formula.parameters.items())
    own = f"{formula.name} ({formula.status.replace('_', ' ')}, {formula.method}): {parameters}"
    return (own, *rival_minima(formula.name, formula))
