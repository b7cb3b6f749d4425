"""What the report says in numbers about models with memory (states, and how nearly other terms
would have served) and of motion.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mapmore_cli.domain.fits import MemoryFit, StateSet
from mapmore_cli.domain.models import HARD, MotionFit
from mapmore_cli.modelling.motion.simulation import extent, motion_errors
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import MODEL, Cell, Column, Columns, Table


def states_table(states: StateSet) -> Table:
    """Everything that training found out about the states: the oscillators, the ranges of
    operators, the scales.
    """
    rows: list[tuple[Cell, ...]] = []
    for name, (hertz, damping) in states.resonances.items():
        rows.append((name, "oscillator it drives", None, None, hertz, damping))
    for name, ends in states.ranges.items():
        rows.append((name, "training range, of which widths are parts", *ends, None, None))
    notes = [f"Samples are {states.step:.6g} s apart."]
    if states.scaled:
        scales = zip(states.names, states.low.tolist(), states.high.tolist(), strict=True)
        rows += [(name, "scaled to [0, 1]", low, high, None, None) for name, low, high in scales]
        notes.append(
            f"Scaled states are held once they are {states.margin:g} of their range beyond it."
        )
    columns = ("state", "what", "from", "to", "frequency [Hz]", "damping ratio")
    return Table.of("states", "States with memory", columns, rows, *notes)


def identified_table(fit: MemoryFit) -> Table:
    """Return the numbers of operators that training found; no rows where the dictionary left none
    open.
    """
    rows: list[tuple[Cell, ...]] = []
    if (numbers := fit.identified) is not None:
        columns = (numbers.numbers.tolist(), numbers.errors.tolist(), numbers.held.tolist())
        for name, value, error, held in zip(numbers.names, *columns, strict=True):
            rows.append((name, value, error, "yes" if held else "no"))
    heads = ("number", "value #.6g", "standard error .3g", "at a bound")
    note = (
        "Found with the coefficients in free run. A number at a bound of its search is not "
        "told by the data."
    )
    return Table.of("identified", "Numbers of operators that training found", heads, rows, note)


def substitutes_table(fit: MemoryFit) -> Table:
    """For every term the candidate that would serve best in its place, beside the other terms; no
    rows without a ridge.
    """
    rows: list[tuple[Cell, ...]] = []
    found = zip(fit.model.terms, fit.substitutes.tolist(), fit.shares.tolist(), strict=False)
    for term, place, share in found:
        rows.append((term, fit.candidates[place] if place >= 0 else None, 100 * share))
    columns = ("term", "best substitute", "its gain over the term's own [%] .1f")
    notes = (
        "Gain: by how much the regularised error falls with the term, or with its substitute, "
        "beside all other terms. Near 100 %, the "
        "data do not tell the two apart, and another recording may choose the other.",
        f"{len(fit.forward)} terms were chosen forward, and pruned to {len(fit.model.terms)}.",
    )
    return Table.of("substitutes", "What else would have served", columns, rows, *notes)


def sizes_table(fit: MemoryFit) -> Table:
    """Return the error in free run of models of 1, 2, ... terms over training samples held out for
    that; no rows where none were.
    """
    rows = enumerate([] if fit.held_out is None else fit.held_out.tolist(), 1)
    title = "How many terms: error over the last quarter of the training samples"
    note = (
        "Free runs of models fitted to the first three quarters of each recording's training "
        "samples. The model has the terms of the best "
        f"one, {len(fit.model.terms)}, fitted to all of them. inf: the run diverges."
    )
    return Table.of("sizes", title, ("terms", "RMSE over the held-out end #.4g"), rows, note)


def sections_table(fits: Mapping[str, MotionFit], unit: str) -> Table:
    """Return the parameters of every section of every model, its poles, its gain, and how it was
    found; P table 1 has the first.
    """
    drives = tuple(dict.fromkeys(text for fit in fits.values() for text in fit.model.drives[1:]))
    columns: Columns = (
        MODEL,
        *("section", "input", "P1 #.6g", "P2 #.6g", "P3 #.6g"),
        *(Column(f"weight of {text}", "", "#.6g") for text in drives),
        *("largest pole .3f", f"steady output at its upper end [{unit}] .4g"),
        *(f"RMSE of the search [{unit}] .3g", "samples", "solver", "iterations", "simulations"),
    )
    rows: list[tuple[Cell, ...]] = []
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


def waveforms_table(inputs: ReportInputs) -> Table:
    """Errors of displacement and velocity over the last wavelength of every held-out recording, as
    P table 3 has them.
    """
    unit, motion = inputs.target.unit, next(iter(inputs.motions.values())).model
    held_out = [
        (number, curve.recordings[log], samples)
        for number, curve in enumerate(inputs.dataset.curves)
        for log, samples in enumerate(curve.logs)
        if curve.held_out[samples].all()
    ]
    rows: list[tuple[Cell, ...]] = []
    for number, recording, samples in held_out:
        columns = inputs.dataset.curves[number].columns
        u, measured = (columns[name][samples] for name in (motion.input, inputs.dataset.target))
        for model, predictions in inputs.validation.predictions.items():
            predicted = predictions[number][samples]
            if np.isfinite(predicted).all() and len(samples) > 1:
                e = motion_errors(measured, predicted, u, motion.step)
                rms = (e.displacement_rmse, e.velocity_rmse)
                largest = (e.max_displacement, e.max_velocity, e.transient, e.samples)
                rows.append((recording, model, *rms, *largest))
    heads = (
        *("recording", MODEL, f"RMSE [{unit}] .4g", f"velocity RMSE [{unit}/s] .4g"),
        *(f"max error [{unit}] .4g", f"max velocity error [{unit}/s] .4g"),
        *(f"max error before [{unit}] .4g", "samples"),
    )
    note = (
        "Over the last wavelength of the input, so many samples; where it does not repeat "
        "itself, over all of them. Before: over the "
        "wavelengths before, with the transient at the beginning. Velocities are central "
        "differences."
    )
    return Table.of("waveforms", "Errors over one wavelength", heads, rows, note)
