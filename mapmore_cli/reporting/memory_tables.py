"""Make tables about models with memory: their states, the parameters of their operators, and their
errors for different numbers of terms.
"""

from __future__ import annotations

from mapmore_cli.domain.fits import MemoryFit, StateSet
from mapmore_cli.reporting.table import Cells, Table


def states_table(states: StateSet) -> Table:
    """Return a table of the numbers that training determined for the states: frequency and damping
    of oscillators, training ranges of the inputs of operators, and the range of each state that is
    scaled to [0, 1].
    """
    rows: list[Cells] = []
    for name, (hertz, damping) in states.resonances.items():
        rows.append((name, "oscillator that it drives", None, None, hertz, damping))
    for name, ends in states.ranges.items():
        rows.append((name, "training range; widths are fractions of it", *ends, None, None))
    uneven = " in the median; only their order matters" * states.ordered
    notes = [f"Samples are {states.step:.6g} s apart{uneven}."]
    if states.scaled:
        scales = zip(states.names, states.low.tolist(), states.high.tolist(), strict=True)
        rows += [(name, "scaled to [0, 1]", low, high, None, None) for name, low, high in scales]
        notes.append(
            f"Scaled states are limited to their training range plus {states.margin:g} of it at "
            "each end."
        )
    columns = ("state", "what", "from", "to", "frequency [Hz]", "damping ratio")
    return Table.of("states", "States with memory", columns, rows, *notes)


def identified_table(fit: MemoryFit) -> Table:
    """Return a table of the parameters of operators that training estimated. The table has no rows
    if the spec gives all of these parameters.
    """
    rows: list[Cells] = []
    if (numbers := fit.identified) is not None:
        columns = (numbers.numbers.tolist(), numbers.errors.tolist(), numbers.held.tolist())
        for name, value, error, held in zip(numbers.names, *columns, strict=True):
            rows.append((name, value, error, "yes" if held else "no"))
    heads = ("number", "value #.6g", "standard error .3g", "at a bound")
    note = (
        "Found with the coefficients in free run. The data do not determine a number that is at "
        f"a bound of its search. {fit.selection.errors_note}"
    )
    return Table.of("identified", "Numbers of operators that training found", heads, rows, note)


def sizes_table(fit: MemoryFit) -> Table:
    """Return a table of the free-run (simulation) error of models with 1, 2, ... terms. The errors
    are measured on the last quarter of the training samples, which was left out of these fits. If
    no samples were left out, the table has no rows.
    """
    rows = enumerate([] if fit.held_out is None else fit.held_out.tolist(), 1)
    title = "How many terms: error over the last quarter of the training samples"
    note = (
        "Free runs of models fitted to the first three quarters of each recording's training "
        "samples. The model has the terms of the best "
        f"one, {len(fit.model.terms)}, fitted to all of them. inf: the run diverges."
    )
    return Table.of("sizes", title, ("terms", "RMSE over the held-out end #.4g"), rows, note)
