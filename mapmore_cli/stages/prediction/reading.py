"""What has to be known to predict: the inputs, and for rates, directions and memory the course of time."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from mapmore_cli.domain.models import Model, Signal
from mapmore_cli.modelling.kinds import fed_back, runs_over_time


@dataclass(frozen=True)
class Reading:
    """What is read of a table.

    Attributes
    ----------
    columns
        Quantities without which a row has no prediction.
    signals
        Quantities that follow from the columns over time.
    outputs
        Measured outputs that a model with memory goes on from; they may be empty once it runs.
    over_time
        Whether rows belong to recordings, and `time` is among the columns.
    """

    columns: tuple[str, ...]
    signals: tuple[Signal, ...] = ()
    outputs: tuple[str, ...] = ()
    over_time: bool = False


def reading_of(model: Model, given: Collection[str]) -> Reading:
    """Every input by its own name where it is `given`, else by the signal that it is; `time` where there are signals or memory."""
    signals = tuple(signal for signal in model.signals if signal.name not in given)
    over_time = bool(signals) or runs_over_time(model)
    wanted = [quantity.name for quantity in model.inputs] + [signal.of for signal in signals]
    derived = {signal.name for signal in signals}
    columns = dict.fromkeys(name for name in (["time"] if over_time else []) + wanted if name not in derived)
    return Reading(tuple(columns), signals, fed_back(model), over_time)
