"""Show models of motion on pages and in `mapmore show`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from mapmore_cli.annexes.motion.body import HARD, Motion, MotionFit, StateSpace
from mapmore_cli.annexes.motion.simulation import extent, motion_errors
from mapmore_cli.cli.console import View
from mapmore_cli.domain.fits import Fit
from mapmore_cli.domain.models import Model
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.sections import PageSection
from mapmore_cli.reporting.table import MODEL, Cells, Column, Columns, Table


def show(model: Model) -> View:
    """Return what `mapmore show` prints about a model."""
    return View({"motion": _document(model.body_of(StateSpace).motion)})


def show_fit(fit: Fit) -> tuple[dict[str, object], tuple[Table, ...]]:
    """Return what `mapmore show` prints about a fit."""
    assert isinstance(fit, MotionFit)
    document = {**_document(fit.model), "solver": fit.solver, "searches": fit.searches}
    return {"motion": document}, (sections_table({"mapmore": fit}, ""),)


def tables(inputs: ReportInputs) -> list[Table]:
    """Return the tables of a page that compares models of motion."""
    fits = {name: fit for name, fit in inputs.fits.items() if isinstance(fit, MotionFit)}
    if not fits:
        return []
    motion = next(iter(fits.values())).model
    return [waveforms_table(inputs, motion), sections_table(fits, inputs.target.unit)]


def _document(motion: Motion) -> dict[str, object]:
    """Return the model as it is stored, with two additions for every section: its poles (real and
    imaginary parts) and its gain.
    """
    sections = []
    for section in motion.sections:
        poles = [[pole.real, pole.imag] for pole in section.poles]
        sections.append({**asdict(section), "poles": poles, "gain": section.gain})
    return {**asdict(motion), "sections": sections}


def sections_table(fits: Mapping[str, MotionFit], unit: str) -> Table:
    """Return a table with a row for every section of every model: its parameters (as in
    table 1 of Brown and Xie 2024), its poles, its gain, and how it was found.
    """
    drives = tuple(dict.fromkeys(text for fit in fits.values() for text in fit.model.drives[1:]))
    columns: Columns = (
        MODEL,
        *("section", "input", "P1 #.6g", "P2 #.6g", "P3 #.6g"),
        *(Column(f"weight of {text}", "", "#.6g") for text in drives),
        *("largest pole .3f", f"steady output at its upper end [{unit}] .4g"),
        *(f"RMSE of the search [{unit}] .3g", "samples", "solver", "iterations", "simulations"),
    )
    rows: list[Cells] = []
    for name, fit in fits.items():
        motion, solver = fit.model, fit.solver.replace("_", " ")
        for section, search in zip(motion.sections, fit.searches, strict=True):
            weights = dict(zip(motion.drives, section.weights.tolist(), strict=True))
            constant = float(section.weights[1]) if len(section.weights) > 1 else 0.0
            end = [*motion.boundaries, motion.limits[1]][section.place - 1]
            # without load
            steady = (section.p3 * end + constant) / (1.0 - section.p1 - section.p2)
            parameters = (section.p1, section.p2, section.p3, *map(weights.get, drives))
            poles = (section.radius, steady, search.rmse, search.samples)
            steps = (solver, len(search.history) - 1, search.evaluations)
            place = extent(motion.boundaries, section.place)
            rows.append((name, section.id, place, *parameters, *poles, *steps))
    notes = [
        "x1[k+1] = x2[k], x2[k+1] = P1 x1[k] + P2 x2[k] + P3 u[k] + ..., the output is x1. "
        "Stable sections have poles below 1.",
        *(
            f"Samples are {step:.6g} s apart."
            for step in dict.fromkeys(fit.model.step for fit in fits.values())
        ),
    ]
    if any(fit.model.switching != HARD for fit in fits.values()):
        notes.append(
            "With one shared state, the weights are those after the sections were joined; the "
            "RMSE is that of each section before."
        )
    return Table.of("sections", "Sections of the models of motion", columns, rows, *notes)


def waveforms_table(inputs: ReportInputs, motion: Motion) -> Table:
    """Return the table of errors of displacement and velocity over the last wavelength of every
    held-out recording, as in table 3 of Brown and Xie 2024. The table has no rows if only some
    samples are stored, because no velocity can be computed from these.
    """
    unit = inputs.target.unit
    held_out = [
        (number, curve.recordings[log], samples)
        for number, curve in enumerate(() if inputs.validation.shown else inputs.dataset.curves)
        for log, samples in enumerate(curve.logs)
        if curve.held_out[samples].all()
    ]
    rows: list[Cells] = []
    for number, recording, samples in held_out:
        columns = inputs.dataset.curves[number].columns
        u, measured = (columns[name][samples] for name in (motion.input, inputs.dataset.target))
        for model, predictions in inputs.validation.predictions.items():
            predicted = predictions[number][samples]
            if np.isfinite(predicted).all() and len(samples) > 1:
                errors = motion_errors(measured, predicted, u, motion.step)
                rows.append((recording, model, *errors))
    heads = (
        *("recording", MODEL, f"RMSE [{unit}] .4g", f"velocity RMSE [{unit}/s] .4g"),
        *(f"max error [{unit}] .4g", f"max velocity error [{unit}/s] .4g"),
        *(f"max error before [{unit}] .4g", "samples"),
    )
    note = (
        "The errors are those over the last wavelength of the input, with this number of samples, "
        "or over all samples if the input does not repeat itself. The error before is that over "
        "the earlier wavelengths, with the transient at the beginning. Velocities are central "
        "differences."
    )
    return Table.of("waveforms", "Errors over one wavelength", heads, rows, note)


SECTION = PageSection("Models-of-motion", "Models of motion", tables)
