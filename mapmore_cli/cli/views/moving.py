"""What fits and models of motion have to show beside their equations."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mapmore_cli.domain.motion import Motion, MotionFit
    from mapmore_cli.reporting.table import Table


def model_document(motion: Motion) -> dict[str, Any]:
    """Return the model as it is stored, with the poles (real and imaginary parts) and the gain of every section."""
    derived = ({"poles": [[pole.real, pole.imag] for pole in section.poles], "gain": section.gain} for section in motion.sections)
    sections = [{**asdict(section), **more} for section, more in zip(motion.sections, derived, strict=True)]
    return {**asdict(motion), "sections": sections}


def fit_document(fit: MotionFit | None) -> dict[str, Any] | None:
    """Return the same, with how its sections were found."""
    if fit is None:
        return None
    return {**model_document(fit.model), "solver": fit.solver, "searches": [asdict(search) for search in fit.searches]}


def fit_tables(fit: MotionFit) -> tuple[Table, ...]:
    """Return the sections with their searches."""
    from mapmore_cli.reporting.motion_tables import sections_table

    return (sections_table({"mapmore": fit}, ""),)


def running_lines(motion: Motion) -> tuple[str, ...]:
    """How the model is run."""
    ways = {
        "hard": "every section runs, the active one's output is taken",
        "carried": "sections hand one state on",
        "bumpless": "sections share one state, and meet at their boundaries",
    }
    at = ", ".join(f"{boundary:g}" for boundary in motion.boundaries)
    places = f"Sections meet at {motion.input} {at}. " if at else ""
    return (f"{places}Switching: {motion.switching} ({ways[motion.switching]}), at steps of {motion.step:.6g} s, from {motion.start}.",)
