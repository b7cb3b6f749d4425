"""What the report says in numbers about a model with memory: its states, and how nearly other terms would have served."""

from __future__ import annotations

import math

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.memory import MemoryFit, StateSet
from mapmore_cli.modelling.memory.feedback import fed_back_states
from mapmore_cli.modelling.memory.starts import FIRST, started
from mapmore_cli.modelling.validation.error_parts import PARTS, error_parts
from mapmore_cli.reporting.inputs import ReportInputs
from mapmore_cli.reporting.table import Cell, Column, Table


def states_table(states: StateSet) -> Table:
    """Everything that training found out about the states: the oscillators, the ranges of operators, the scales."""
    columns = (Column("state"), Column("what"), Column("from"), Column("to"), Column("frequency", "Hz"), Column("damping ratio"))
    rows: list[tuple[Cell, ...]] = []
    rows += [(name, "oscillator it drives", None, None, hertz, damping) for name, (hertz, damping) in states.resonances.items()]
    rows += [(name, "training range, of which widths are parts", low, high, None, None) for name, (low, high) in states.ranges.items()]
    if states.scaled:
        scales = zip(states.names, states.low.tolist(), states.high.tolist(), strict=True)
        rows += [(name, "scaled to [0, 1]", low, high, None, None) for name, low, high in scales]
    notes: tuple[str, ...] = (f"Samples are {states.step:.6g} s apart.",)
    if states.scaled:
        notes += (f"Scaled states are held once they are {states.margin:g} of their range beyond it.",)
    return Table("states", "States with memory", columns, tuple(rows), notes)


WHAT = {
    "drift": "drift from cycle to cycle",
    "change": "loops that have changed since the training cycles",
    "shape": "the shape of its loops",
    "rest": "what does not repeat from cycle to cycle",
}
"""Parts of the error in words."""

ERROR_PARTS_NOTE = (
    "Drift: the mean error of each cycle, and how far it moves from the first to the last. Of what is left, "
    "the mean over cycles at the same place of the same stroke: shape as far as training left the same error, change where the loops are "
    "no longer those of the training cycles. Rest: what another cycle does not repeat, noise included. Squares add up. "
)


def error_parts_table(inputs: ReportInputs) -> Table:
    """Return what the errors of each model consist of, where the input goes in cycles; no rows where it does not."""
    dataset, unit = inputs.dataset, inputs.target.unit
    columns = (
        *(Column("model"), Column("data"), Column("samples"), Column("cycles")),
        *(Column(name, unit, ".3g") for name in ("RMSE", *PARTS, "moves by")),
        Column("limited by"),
    )
    names = [quantity.name for quantity in inputs.model.inputs]
    moving = [name for name in names if any(np.ptp(curve.columns[name]) > 0 for curve in dataset.curves)]
    rows, told = list[tuple[Cell, ...]](), ""
    if len(moving) == 1 and inputs.has_memory and all(curve.level is None for curve in dataset.curves):
        for model, predicted in inputs.validation.predictions.items():
            for one in error_parts(dataset.curves, predicted, dataset.target, moving[0], dataset.logs):
                sizes = [one.rms[part] for part in PARTS]
                travel = float(one.offsets[-1] - one.offsets[0])
                rows.append((model, one.split, one.samples, len(one.offsets), math.hypot(*sizes), *sizes, travel, one.limit))
                told = told if model != inputs.own else f"{inputs.own} is limited by {WHAT[one.limit]} on the {one.split} data."
    return Table("error_parts", "What the errors consist of", columns, tuple(rows), (ERROR_PARTS_NOTE + told,))


def starts_table(inputs: ReportInputs) -> Table:
    """Errors of free runs over their first part and after it; no rows where nothing is fed back."""
    columns = (
        Column("model"),
        Column("first samples"),
        *(Column(name, inputs.target.unit, ".4g") for name in ("RMSE there", "RMSE after")),
    )
    memory, rows = inputs.fit.memory, list[tuple[Cell, ...]]()
    if memory is None or not fed_back_states(memory.model.states, memory.model.output):
        return Table("starts", "The beginning of free runs", columns, ())
    curves, target = inputs.dataset.curves, inputs.dataset.target
    for model, predicted in inputs.validation.predictions.items():
        parts = [(values - curve.columns[target])[rows] for values, curve in zip(predicted, curves, strict=True) for rows in curve.logs]
        early = [part[: int(FIRST * len(part))] for part in parts]
        later = [part[int(FIRST * len(part)) :] for part in parts]
        rows.append((model, sum(map(len, early)), *(_rms(np.concatenate(ones)) for ones in (early, later))))
    notes = (f"{started(memory.model)} First samples: {FIRST:.0%} of each recording, training or held out.",)
    return Table("starts", "The beginning of free runs", columns, tuple(rows), notes)


def _rms(errors: Array) -> float | None:
    known = errors[np.isfinite(errors)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else None


def identified_table(fit: MemoryFit) -> Table:
    """Return the numbers of operators that training found; no rows where the dictionary left none open."""
    columns = (Column("number"), Column("value", "", "#.6g"), Column("standard error", "", ".3g"), Column("at a bound"))
    found, rows = fit.identified, list[tuple[Cell, ...]]()
    if found is not None:
        cells = zip(found.names, found.numbers.tolist(), found.errors.tolist(), found.held.tolist(), strict=True)
        rows += [(name, value, error if math.isfinite(error) else None, "yes" if held else "no") for name, value, error, held in cells]
    notes = ("Found with the coefficients in free run. A number at a bound of its search is not told by the data.",)
    return Table("identified", "Numbers of operators that training found", columns, tuple(rows), notes)


def substitutes_table(fit: MemoryFit) -> Table:
    """For every term the candidate that would serve best in its place, beside the other terms; no rows without a ridge."""
    columns = (Column("term"), Column("best substitute"), Column("its gain over the term's own", "%", ".1f"))
    rows: list[tuple[Cell, ...]] = []
    for term, place, share in zip(fit.model.terms, fit.substitutes.tolist(), fit.shares.tolist(), strict=False):
        rows.append((term, fit.candidates[place] if place >= 0 else None, 100 * share))
    notes = (
        "Gain: by how much the regularised error falls with the term, or with its substitute, beside all other terms. Near 100 %, the "
        "data do not tell the two apart, and another recording may choose the other.",
        f"{len(fit.forward)} terms were chosen forward, and pruned to {len(fit.model.terms)}.",
    )
    return Table("substitutes", "What else would have served", columns, tuple(rows), notes)


def sizes_table(fit: MemoryFit) -> Table:
    """Return the error in free run of models of 1, 2, ... terms over training samples held out for that; no rows where none were."""
    columns = (Column("terms"), Column("RMSE over the held-out end", "", "#.4g"))
    errors = [] if fit.held_out is None else fit.held_out.tolist()
    rows: tuple[tuple[Cell, ...], ...] = tuple((number + 1, error if math.isfinite(error) else None) for number, error in enumerate(errors))
    notes = (
        "Free runs of models fitted to the first three quarters of each recording's training samples. The model has the terms of the best "
        f"one, {len(fit.model.terms)}, fitted to all of them. A dash: the run diverges.",
    )
    return Table("sizes", "How many terms: error over the last quarter of the training samples", columns, rows, notes)
