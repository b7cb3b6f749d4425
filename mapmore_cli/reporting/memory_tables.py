"""What the report says in numbers about models with memory (states, and how nearly other terms
would have served) and of motion.
"""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.domain.fits import MemoryFit, StateSet
from mapmore_cli.modelling.validation.repeatability import PARTS, error_parts
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import MODEL, Cell, Columns, Table


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
