"""What the report says in numbers about models of motion: their sections (as P table 1), their errors by waveform (as P table 3)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from mapmore_cli.domain.motion import HARD, Motion, MotionFit, MotionSection, SectionSearch
from mapmore_cli.modelling.motion.sections import extent
from mapmore_cli.modelling.motion.simulation import motion_errors
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import Cell, Column, Table


def sections_table(fits: Mapping[str, MotionFit], unit: str) -> Table:
    """Return the parameters of every section of every model, its poles, its gain, and how it was found; P table 1 has the first."""
    drives = tuple(dict.fromkeys(text for fit in fits.values() for text in fit.model.drives[1:]))
    columns = (
        Column("model"),
        Column("section"),
        Column("input"),
        Column("P1", "", "#.6g"),
        Column("P2", "", "#.6g"),
        Column("P3", "", "#.6g"),
        *(Column(f"weight of {text}", "", "#.6g") for text in drives),
        Column("largest pole", "", ".3f"),
        Column("steady output at its upper end", unit, ".4g"),
        Column("RMSE of the search", unit, ".3g"),
        Column("samples"),
        Column("solver"),
        Column("iterations"),
        Column("simulations"),
    )
    rows = tuple(row for name, fit in fits.items() for row in _section_rows(name, fit, drives))
    notes = (
        "x1[k+1] = x2[k], x2[k+1] = P1 x1[k] + P2 x2[k] + P3 u[k] + ..., the output is x1. Stable sections have poles below 1.",
        *(f"Samples are {step:.6g} s apart." for step in {fit.model.step: None for fit in fits.values()}),
        *(
            ("With one shared state, the weights are those after the sections were joined; the RMSE is that of each section before.",)
            if any(fit.model.switching != HARD for fit in fits.values())
            else ()
        ),
    )
    return Table("sections", "Sections of the models of motion", columns, rows, notes)


def _section_rows(name: str, fit: MotionFit, drives: tuple[str, ...]) -> Iterator[tuple[Cell, ...]]:
    for section, search in zip(fit.model.sections, fit.searches, strict=True):
        weights = dict(zip(fit.model.drives, section.weights.tolist(), strict=True))
        yield (
            name,
            section.id,
            extent(fit.model.boundaries, section.place),
            section.p1,
            section.p2,
            section.p3,
            *(weights.get(text) for text in drives),
            section.radius,
            _steady(fit.model, section),
            *_found(fit, search),
        )


def _found(fit: MotionFit, search: SectionSearch) -> tuple[Cell, ...]:
    return search.rmse, search.samples, fit.solver.replace("_", " "), len(search.history) - 1, search.evaluations


def _steady(motion: Motion, section: MotionSection) -> float:
    """Steady output at the upper end of a section, without load."""
    end = [*motion.boundaries, motion.limits[1]][section.place - 1]
    constant = float(section.weights[1]) if len(section.weights) > 1 else 0.0
    return (section.p3 * end + constant) / (1.0 - section.p1 - section.p2)


def waveforms_table(inputs: ReportInputs) -> Table:
    """Errors of displacement and velocity over the last wavelength of every held-out recording, as P table 3 has them."""
    unit, motion = inputs.target.unit, next(iter(inputs.motions.values())).model
    columns = (
        Column("recording"),
        Column("model"),
        Column("RMSE", unit, ".4g"),
        Column("velocity RMSE", f"{unit}/s", ".4g"),
        Column("max error", unit, ".4g"),
        Column("max velocity error", f"{unit}/s", ".4g"),
        Column("max error before", unit, ".4g"),
        Column("samples"),
    )
    rows: list[tuple[Cell, ...]] = []
    for number, curve in enumerate(inputs.dataset.curves):
        for log, samples in enumerate(curve.logs):
            if not curve.held_out[samples].all():
                continue
            u, measured = (curve.columns[name][samples] for name in (motion.input, inputs.dataset.target))
            for model in inputs.models:
                predicted = inputs.validation.predictions[model][number][samples]
                if np.isfinite(predicted).all() and len(samples) > 1:
                    e = motion_errors(measured, predicted, u, motion.step)
                    numbers = (e.displacement_rmse, e.velocity_rmse, e.max_displacement, e.max_velocity, e.transient, e.samples)
                    rows.append((curve.recordings[log], model, *numbers))
    notes = (
        "Over the last wavelength of the input, so many samples; where it does not repeat itself, over all of them. Before: over the "
        "wavelengths before, with the transient at the beginning. Velocities are central differences.",
    )
    return Table("waveforms", "Errors over one wavelength", columns, tuple(rows), notes)
