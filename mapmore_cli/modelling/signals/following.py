"""Quantities that follow from others over time: in a recording at ingest, in a table at prediction."""

from __future__ import annotations

from collections.abc import Sequence

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.models import Signal
from mapmore_cli.modelling.signals.direction import direction
from mapmore_cli.modelling.signals.rates import rate


def signal_values(signal: Signal, columns: Columns) -> Array:
    """A signal over one recording, `(n,)`, from the quantity that it follows from and, for a rate, the `time`.

    Raises
    ------
    DataError
        Where the window of a rate holds too few samples.
    """
    source = columns[signal.of]
    if signal.kind == "direction":
        return direction(source, signal.dead_band)
    return signal.factor * rate(columns["time"] * signal.seconds, source, signal.window, signal.order)


def with_signals(signals: Sequence[Signal], columns: Columns) -> dict[str, Array]:
    """The columns of one recording with every signal that they lack."""
    found = dict(columns)
    for signal in signals:
        if signal.name not in found:
            found[signal.name] = signal_values(signal, found)
    return found


def needed_signals(signals: Sequence[Signal], inputs: Sequence[str]) -> tuple[Signal, ...]:
    """Those of the signals that the inputs follow from, each after the one that it needs itself."""
    wanted = set(inputs)
    kept: list[Signal] = []
    for signal in reversed(signals):
        if signal.name in wanted:
            wanted.add(signal.of)
            kept.insert(0, signal)
    return tuple(kept)
