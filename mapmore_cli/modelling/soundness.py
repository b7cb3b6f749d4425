"""Whether a model that somebody stored can be evaluated: asked once, when it is read.

Types and single values were checked before. Here parts have to fit together: a model is refused
where its kind says so (the verb `faults`), or where a trial on a few rows ends in an error of the
program instead of an answer.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mapmore_cli.domain.arrays import Columns
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import CurveRange, Model, Sum
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.signals.rates import signal_values
from mapmore_cli.modelling.validation.intervals import INTERVAL, half_widths_of

ROWS = 17
"""Rows of the trial: a prime, so that inputs go through their ranges in different orders."""


def unsound(model: Model) -> str | None:
    """Return why a model cannot be evaluated; None where it can."""
    try:
        for one in _every(model):
            names = [quantity.name for quantity in one.inputs]
            if len({*names}) < len(names):
                return f"the model {one.name} has two inputs of one name"
            for fault in kinds.kind_of(one).verb("faults", lambda _model: ())(one):
                return f"of the model {one.name}: {fault}"
        _try(model)
    except Exception as error:
        reason = f"{type(error).__name__}: {error}".splitlines()[0][:200]
        return f"the model cannot be evaluated, since its parts do not fit each other ({reason})"
    return None


def _every(model: Model) -> Iterator[Model]:
    yield model
    if isinstance(model.body, Sum):
        for part in model.body.parts:
            for one in part.models:
                yield from _every(one)


def _try(model: Model) -> None:
    """Do with a model what commands do; an answer that explains itself is one."""
    columns = _columns(model)
    kinds.equations(model)
    kinds.parameters(model)
    kinds.fed_back(model)
    with np.errstate(all="ignore"):
        for attempt in (_simulate, _write, _bound, _follow):
            try:
                attempt(model, columns)
            except MapmoreError:  # which commands tell
                continue


def _simulate(model: Model, columns: Columns) -> None:
    kinds.outside_range(model, columns)
    kinds.simulate(model, columns)
    if kinds.runs_over_time(model):
        kinds.one_step_ahead(model, columns)


def _write(model: Model, _columns: Columns) -> None:
    program_of(model)


def _bound(model: Model, columns: Columns) -> None:
    if model.left_out is not None:
        half_widths_of(model, columns, INTERVAL)


def _follow(model: Model, columns: Columns) -> None:
    for signal in model.signals:
        signal_values(signal, columns)


def _columns(model: Model) -> dict[str, np.ndarray]:
    """Return rows within and around the training range, one step of the model apart."""
    models = [*_every(model)]
    ranges: list[CurveRange] = [one for part in models for one in getattr(part.body, "ranges", ())]
    names = dict.fromkeys(quantity.name for quantity in (*model.inputs, model.output))
    names |= dict.fromkeys(name for one in models for name in kinds.fed_back(one))
    names |= dict.fromkeys(signal.of for signal in model.signals)
    columns = {}
    for place, name in enumerate(names, start=1):
        ends = [end for one in ranges for end in one.limits.get(name, ())]
        ends += [one.level for one in ranges if name == model.level and one.level is not None]
        low, high = (min(ends), max(ends)) if ends else (0.0, 1.0)
        share = (np.arange(ROWS) * place % ROWS) / (ROWS - 1) * 1.2 - 0.1
        columns[name] = low + (high - low) * share
    steps = _steps(models)
    columns["time"] = np.arange(ROWS) * (steps[0] if steps else 1.0)
    return columns


def _steps(models: list[Model]) -> list[float]:
    """Return the times between samples that parts with memory have, s."""
    found = [memory.states.step for one in models for memory in one.memories]
    return found + [one.body.motion.step for one in models if hasattr(one.body, "motion")]
