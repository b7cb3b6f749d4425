"""What the report says in numbers about a model with memory: its states, and how nearly other terms would have served."""

from __future__ import annotations

import math

from mapmore_cli.domain.memory import MemoryFit, StateSet
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


def identified_table(fit: MemoryFit) -> Table:
    """The numbers of operators that training found; no rows where the dictionary left none open."""
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
    """The error in free run of models of 1, 2, ... terms over training samples held out for that; no rows where none were."""
    columns = (Column("terms"), Column("RMSE over the held-out end", "", "#.4g"))
    errors = [] if fit.held_out is None else fit.held_out.tolist()
    rows: tuple[tuple[Cell, ...], ...] = tuple((number + 1, error if math.isfinite(error) else None) for number, error in enumerate(errors))
    notes = (
        "Free runs of models fitted to the first three quarters of each recording's training samples. The model has the terms of the best "
        f"one, {len(fit.model.terms)}, fitted to all of them. A dash: the run diverges.",
    )
    return Table("sizes", "How many terms: error over the last quarter of the training samples", columns, rows, notes)
