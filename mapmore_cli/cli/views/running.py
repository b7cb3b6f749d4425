"""What fits and models with memory, and of motion, have to show beside their terms and equations."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mapmore_cli.domain.memory import MemoryFit, MemoryModel
    from mapmore_cli.domain.motion import Motion, MotionFit
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
