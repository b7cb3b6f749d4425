"""What a command has to show, in both forms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mapmore_cli.domain.fits import FormulaFit, SegmentFit, Selection
    from mapmore_cli.domain.memory import MemoryFit, MemoryModel
    from mapmore_cli.domain.models import SegmentFunction
    from mapmore_cli.domain.motion import Motion, MotionFit
    from mapmore_cli.domain.results import FitResult
    from mapmore_cli.reporting.table import Table


def memory_document(memory: MemoryModel) -> dict[str, Any]:
    """Return the model with memory as it is stored; theta is of states scaled as `states` says."""
    return asdict(memory)


def memory_fit_document(fit: MemoryFit | None) -> dict[str, Any] | None:
    """Return the same, with how its terms were found: those chosen forward, and the best substitute of each."""
    if fit is None:
        return None
    found = {
        "ridge": fit.ridge,
        "forward": [fit.candidates[place] for place in fit.forward],
        "substitutes": [fit.candidates[place] if place >= 0 else None for place in fit.substitutes],
        "shares": fit.shares,
        "held_out": fit.held_out,
        "identified": None if fit.identified is None else asdict(fit.identified),
    }
    return {**asdict(fit.model), **found}


def memory_fit_tables(fit: MemoryFit) -> tuple[Table, ...]:
    """Return what else would have served, where a ridge tells; then the tables of the model."""
    from mapmore_cli.reporting.memory_tables import identified_table, sizes_table, substitutes_table

    others = (substitutes_table(fit),) if len(fit.substitutes) else ()
    sizes = (sizes_table(fit),) if fit.held_out is not None else ()
    found = (identified_table(fit),) if fit.identified is not None else ()
    return (*found, *others, *sizes, *memory_tables(fit.model))


def memory_tables(memory: MemoryModel) -> tuple[Table, ...]:
    """Coefficients with standard errors, and the numbers behind the states where there are any."""
    from mapmore_cli.reporting.memory_tables import states_table
    from mapmore_cli.reporting.table import Column, Table

    columns = (Column("term"), Column("coefficient", "", "#.6g"), Column("standard error", "", ".3g"))
    rows = tuple(zip(memory.terms, memory.theta.tolist(), memory.theta_error.tolist(), strict=True))
    constant = (("(constant)", memory.constant, None),) if memory.constant else ()
    scaled = "Coefficients of scaled states." if memory.states.scaled else "Coefficients in physical units."
    title = f"Coefficients of {memory.output}"
    coefficients = Table("coefficients", title, columns, (*constant, *rows), (scaled,))
    states = states_table(memory.states)
    return (coefficients, states) if states.rows else (coefficients,)


def memory_lines(memory: MemoryModel) -> tuple[str, ...]:
    """How the model is run."""
    from mapmore_cli.modelling.memory.feedback import fed_back_states

    steps = sorted(fed_back_states(memory.states, memory.output).values())
    first = f"the first {steps[-1]} measured samples" if steps and steps[-1] > 1 else "the first measured sample"
    start = f"from {first} of {memory.output}" if steps else f"without measured {memory.output}"
    return (f"Runs free {start}, at steps of {memory.states.step:.6g} s.",)


def motion_document(motion: Motion) -> dict[str, Any]:
    """Return the model as it is stored, with the poles (real and imaginary parts) and the gain of every section."""
    derived = ({"poles": [[pole.real, pole.imag] for pole in section.poles], "gain": section.gain} for section in motion.sections)
    sections = [{**asdict(section), **more} for section, more in zip(motion.sections, derived, strict=True)]
    return {**asdict(motion), "sections": sections}


def motion_fit_document(fit: MotionFit | None) -> dict[str, Any] | None:
    """Return the same, with how its sections were found."""
    if fit is None:
        return None
    return {**motion_document(fit.model), "solver": fit.solver, "searches": [asdict(search) for search in fit.searches]}


def motion_tables(fit: MotionFit) -> tuple[Table, ...]:
    """Return the sections with their searches."""
    from mapmore_cli.reporting.memory_tables import sections_table

    return (sections_table({"mapmore": fit}, ""),)


def motion_lines(motion: Motion) -> tuple[str, ...]:
    """How the model is run."""
    ways = {
        "hard": "every section runs, the active one's output is taken",
        "carried": "sections hand one state on",
        "bumpless": "sections share one state, and meet at their boundaries",
    }
    at = ", ".join(f"{boundary:g}" for boundary in motion.boundaries)
    places = f"Sections meet at {motion.input} {at}. " if at else ""
    return (f"{places}Switching: {motion.switching} ({ways[motion.switching]}), at steps of {motion.step:.6g} s, from {motion.start}.",)


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
    from mapmore_cli.reporting.tables import terms_table

    document = {
        "segments": [segment_document(fit, fit.selection) for fit in result.pieces],
        "memory": memory_fit_document(result.memory),
        "motion": motion_fit_document(result.motion),
        "backbone": formula_document(result.formula),
        "notes": result.notes,
    }
    tables = [terms_table(result)] if result.pieces else []
    tables += memory_fit_tables(result.memory) if result.memory is not None else ()
    tables += motion_tables(result.motion) if result.motion is not None else ()
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
    from mapmore_cli.reporting.tables import rival_minima

    if formula is None:
        return ()
    units = units_of_parameters(formula)
    parameters = ", ".join(f"{name} = {value:.6g} {units.get(name, '')}".rstrip() for name, value in formula.parameters.items())
    own = f"{formula.name} ({formula.status.replace('_', ' ')}, {formula.method}): {parameters}"
    return (own, *rival_minima(formula.name, formula))
