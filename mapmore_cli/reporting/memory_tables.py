"""What the report says in numbers about models with memory (states, and how nearly other terms
would have served) and of motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from mapmore_cli.domain.fits import MemoryFit, StateSet
from mapmore_cli.domain.models import HARD, MotionFit
from mapmore_cli.modelling.motion.simulation import extent, motion_errors
from mapmore_cli.modelling.validation.repeatability import PARTS, error_parts
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import MODEL, Cell, Column, Columns, Table


def states_table(states: StateSet) -> Table:
    """Everything that training found out about the states: the oscillators, the ranges of
    operators, the scales.
    """
    rows: list[tuple[Cell, ...]] = []
    rows += [
        (name, "oscillator it drives", None, None, hertz, damping)
        for name, (hertz, damping) in states.resonances.items()
    ]
    rows += [
        (name, "training range, of which widths are parts", low, high, None, None)
        for name, (low, high) in states.ranges.items()
    ]
    notes = [f"Samples are {states.step:.6g} s apart."]
    if states.scaled:
        scales = zip(states.names, states.low.tolist(), states.high.tolist(), strict=True)
        rows += [(name, "scaled to [0, 1]", low, high, None, None) for name, low, high in scales]
        notes.append(
            f"Scaled states are held once they are {states.margin:g} of their range beyond it."
        )
    columns = ("state", "what", "from", "to", "frequency [Hz]", "damping ratio")
    return Table.of("states", "States with memory", columns, rows, *notes)


WHAT = {
    "drift": "drift from cycle to cycle",
    "change": "loops that have changed since the training cycles",
    "shape": "the shape of its loops",
    "rest": "what does not repeat from cycle to cycle",
}
"""Parts of the error in words."""

ERROR_PARTS_NOTE = (
    "Drift: the mean error of each cycle, and how far it moves from the first to the last. Of "
    "what is left, "
    "the mean over cycles at the same place of the same stroke: shape as far as training left "
    "the same error, change where the loops are "
    "no longer those of the training cycles. Rest: what another cycle does not repeat, noise "
    "included. Squares add up. "
)


def error_parts_table(inputs: ReportInputs) -> Table:
    """Return what the errors of each model consist of, where the input goes in cycles; no rows
    where it does not.
    """
    dataset, unit = inputs.dataset, inputs.target.unit
    names = [quantity.name for quantity in inputs.model.inputs]
    moving = [
        name for name in names if any(np.ptp(curve.columns[name]) > 0 for curve in dataset.curves)
    ]
    rows, told = list[tuple[Cell, ...]](), ""
    if (
        len(moving) == 1
        and inputs.has_memory
        and all(curve.level is None for curve in dataset.curves)
    ):
        for model, predicted in inputs.validation.predictions.items():
            for one in error_parts(
                dataset.curves, predicted, dataset.target, moving[0], dataset.logs
            ):
                sizes = [one.rms[part] for part in PARTS]
                travel = float(one.offsets[-1] - one.offsets[0])
                rows.append(
                    (
                        model,
                        one.split,
                        one.samples,
                        len(one.offsets),
                        math.hypot(*sizes),
                        *sizes,
                        travel,
                        one.limit,
                    )
                )
                told = (
                    told
                    if model != inputs.own
                    else f"{inputs.own} is limited by {WHAT[one.limit]} on the {one.split} data."
                )
    numbers = (f"{name} [{unit}] .3g" for name in ("RMSE", *PARTS, "moves by"))
    columns: Columns = (MODEL, "data", "samples", "cycles", *numbers, "limited by")
    return Table.of(
        "error_parts", "What the errors consist of", columns, rows, ERROR_PARTS_NOTE + told
    )


def identified_table(fit: MemoryFit) -> Table:
    """Return the numbers of operators that training found; no rows where the dictionary left none
    open.
    """
    found, rows = fit.identified, list[tuple[Cell, ...]]()
    if found is not None:
        cells = zip(
            found.names,
            found.numbers.tolist(),
            found.errors.tolist(),
            found.held.tolist(),
            strict=True,
        )
        rows += [
            (name, value, error if math.isfinite(error) else None, "yes" if held else "no")
            for name, value, error, held in cells
        ]
    columns = ("number", "value #.6g", "standard error .3g", "at a bound")
    note = (
        "Found with the coefficients in free run. A number at a bound of its search is not "
        "told by the data."
    )
    return Table.of("identified", "Numbers of operators that training found", columns, rows, note)


def sizes_table(fit: MemoryFit) -> Table:
    """Return the error in free run of models of 1, 2, ... terms over training samples held out for
    that; no rows where none were.
    """
    errors = [] if fit.held_out is None else fit.held_out.tolist()
    rows = (
        (number, error if math.isfinite(error) else None) for number, error in enumerate(errors, 1)
    )
    title = "How many terms: error over the last quarter of the training samples"
    note = (
        "Free runs of models fitted to the first three quarters of each recording's training "
        "samples. The model has the terms of the best "
        f"one, {len(fit.model.terms)}, fitted to all of them. A dash: the run diverges."
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
        *(
            "largest pole .3f",
            f"steady output at its upper end [{unit}] .4g",
            f"RMSE of the search [{unit}] .3g",
            "samples",
        ),
        *("solver", "iterations", "simulations"),
    )
    rows = (row for name, fit in fits.items() for row in _section_rows(name, fit, drives))
    notes = [
        "x1[k+1] = x2[k], x2[k+1] = P1 x1[k] + P2 x2[k] + P3 u[k] + ..., the output is x1. "
        "Stable sections have poles below 1.",
        *(
            f"Samples are {step:.6g} s apart."
            for step in {fit.model.step: None for fit in fits.values()}
        ),
    ]
    if any(fit.model.switching != HARD for fit in fits.values()):
        notes.append(
            "With one shared state, the weights are those after the sections were joined; the "
            "RMSE is that of each section before."
        )
    return Table.of("sections", "Sections of the models of motion", columns, rows, *notes)


def _section_rows(name: str, fit: MotionFit, drives: tuple[str, ...]) -> Iterator[tuple[Cell, ...]]:
    motion, solver = fit.model, fit.solver.replace("_", " ")
    for section, search in zip(motion.sections, fit.searches, strict=True):
        weights = dict(zip(motion.drives, section.weights.tolist(), strict=True))
        constant = float(section.weights[1]) if len(section.weights) > 1 else 0.0
        end = [*motion.boundaries, motion.limits[1]][section.place - 1]
        steady = (section.p3 * end + constant) / (1.0 - section.p1 - section.p2)  # without load
        parameters = (section.p1, section.p2, section.p3, *(weights.get(text) for text in drives))
        found = (search.rmse, search.samples, solver, len(search.history) - 1, search.evaluations)
        yield (
            name,
            section.id,
            extent(motion.boundaries, section.place),
            *parameters,
            section.radius,
            steady,
            *found,
        )


def waveforms_table(inputs: ReportInputs) -> Table:
    """Errors of displacement and velocity over the last wavelength of every held-out recording, as
    P table 3 has them.
    """
    unit, motion = inputs.target.unit, next(iter(inputs.motions.values())).model
    rows: list[tuple[Cell, ...]] = []
    for number, curve in enumerate(inputs.dataset.curves):
        for log, samples in enumerate(curve.logs):
            if not curve.held_out[samples].all():
                continue
            u, measured = (
                curve.columns[name][samples] for name in (motion.input, inputs.dataset.target)
            )
            for model in inputs.models:
                predicted = inputs.validation.predictions[model][number][samples]
                if np.isfinite(predicted).all() and len(samples) > 1:
                    e = motion_errors(measured, predicted, u, motion.step)
                    numbers = (
                        e.displacement_rmse,
                        e.velocity_rmse,
                        e.max_displacement,
                        e.max_velocity,
                        e.transient,
                        e.samples,
                    )
                    rows.append((curve.recordings[log], model, *numbers))
    columns = (
        *(
            "recording",
            MODEL,
            f"RMSE [{unit}] .4g",
            f"velocity RMSE [{unit}/s] .4g",
            f"max error [{unit}] .4g",
        ),
        *(f"max velocity error [{unit}/s] .4g", f"max error before [{unit}] .4g", "samples"),
    )
    note = (
        "Over the last wavelength of the input, so many samples; where it does not repeat "
        "itself, over all of them. Before: over the "
        "wavelengths before, with the transient at the beginning. Velocities are central "
        "differences."
    )
    return Table.of("waveforms", "Errors over one wavelength", columns, rows, note)
