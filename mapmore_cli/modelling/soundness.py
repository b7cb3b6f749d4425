"""Check that a stored model can be evaluated. This is done once, when the model is read. Types and
single values were checked before; here, mapmore checks that the parts of the model are consistent.
A model is refused if its kind finds a fault (`faults`), or if a trial on a few rows ends with an
internal error.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling import kinds, literature
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.modelling.signals.rates import signal_values
from mapmore_cli.modelling.validation.intervals import INTERVAL, half_widths_of

ROWS = 16  # number of rows in the trial evaluation


def unsound(model: Model) -> str | None:
    """Return the reason why a model cannot be evaluated; None if it can be evaluated."""
    try:
        for part in model.every:
            fault = next(iter(kinds.verbs_of(part).faults(part)), None)
            inputs = {*part.input_names}
            if part.backbone and (missing := {*literature.of(part.backbone).inputs} - inputs):
                fault = fault or f"{part.backbone.name} needs {min(missing)}, which the model lacks"
            names = (quantity.name for quantity in (part.output, *part.inputs))
            if fault or len({*names}) <= len(part.inputs):
                return f"in the model {part.name}: {fault or 'two quantities have the same name'}"
        for part in model.each:
            _try(part)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".partition("\n")[0]
        return f"the model cannot be evaluated, because its parts do not match ({reason})"
    return None


def _try(model: Model) -> None:
    """Apply to a model every operation that a command may use. Errors that the commands report to
    users are accepted.
    """
    asked = (*model.inputs, model.output)
    names = [quantity.name for quantity in asked] + [
        *kinds.fed_back(model),
        *(signal.of for signal in model.signals),
    ]
    columns = dict.fromkeys(names, np.linspace(0.0, 1.0, ROWS))
    timed = {**columns, "time": np.arange(1.0 * ROWS)}
    kinds.equations(model)
    kinds.parameters(model)
    for attempt in (
        lambda: kinds.simulate(model, columns),
        lambda: kinds.outside_range(model, columns),
        lambda: kinds.runs_over_time(model) and kinds.one_step_ahead(model, columns),
        lambda: program_of(model),
        lambda: model.left_out and half_widths_of(model, columns, INTERVAL),
        lambda: [signal_values(signal, timed) for signal in model.signals],
    ):
        # these errors are accepted, because the commands report them to the user
        with suppress(MapmoreError), np.errstate(all="ignore"):
            attempt()
