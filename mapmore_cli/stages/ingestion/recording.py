"""From one file to its recordings: samples in the model's units, with everything that was left out counted."""

from __future__ import annotations

import graphlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling import terms
from mapmore_cli.modelling.signals.following import signal_values
from mapmore_cli.spec.sections.data import Data, Direction, Rate
from mapmore_cli.spec.sections.keep import Keep
from mapmore_cli.stages.ingestion.clock import Clocked, clocked
from mapmore_cli.stages.ingestion.files import Source
from mapmore_cli.stages.ingestion.joining import joined
from mapmore_cli.stages.ingestion.meter import Meter
from mapmore_cli.stages.ingestion.samples import Samples, located
from mapmore_cli.stages.ingestion.tables import read_tables, without_missing
from mapmore_cli.stages.signals import signal_of


@dataclass(frozen=True)
class Reading:
    """One log as recorded: its `pieces` in order of time, a single one where it has no gaps, and what was found in it."""

    pieces: tuple[Recording, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def read_recordings(source: Source, data: Data, units: Mapping[str, str], meter: Meter) -> list[Reading]:
    """Read a file and the logs that are joined to it, and bring them into the model's `units`.

    In this order: scale and offset, joined logs, missing values, constants, time stamps and gaps, even time steps, derived quantities,
    conditions to keep samples. Raises DataError naming file, row and column.
    """
    tables = read_tables(source, data, data.missing, units, meter)
    return [_reading(samples, source, data, units) for samples in joined(tables, source, data, units, meter)]


def _reading(samples: Samples, source: Source, data: Data, units: Mapping[str, str]) -> Reading:
    samples = without_missing(samples, data, data.missing)
    samples = samples.with_columns({name: np.full(samples.size, value) for name, value in source.constants.items()})
    whole = clocked(samples, data, units)
    finished = [_finished(piece, data, source.keep, units) for piece in whole.pieces if piece.size]
    left = [piece for piece in finished if piece.size]
    if not left:
        (finished or whole.pieces)[0].some()
    name = source.id if samples.element is None else f"{source.id}[{samples.element}]"
    names = [f"{name}#{number}" for number in range(1, len(left) + 1)] if len(whole.pieces) > 1 else [name]
    recordings = tuple(_recording(name, source.name, piece) for name, piece in zip(names, left, strict=True))
    return Reading(recordings, whole.notes, (*whole.warnings, *_emptied(whole, left)))


def _emptied(whole: Clocked, left: list[Samples]) -> list[str]:
    """A warning where pieces of a recording are left out whole."""
    lost = len(whole.pieces) - len(left)
    return [f"{whole.pieces[0].label}: {lost} of {len(whole.pieces)} pieces between gaps have no sample left"] if lost else []


def _recording(name: str, source: str, samples: Samples) -> Recording:
    dropped = {reason: len(rows) for reason, rows in samples.left_out.items()}
    return Recording(name, source, samples.columns, samples.rows_read, dropped)


def _finished(samples: Samples, data: Data, keep: Sequence[Keep], units: Mapping[str, str]) -> Samples:
    samples = _derived(samples, data.derive, units)
    for condition in (*data.keep, *keep):
        samples = _kept(samples, condition, units)
    return samples


def _derived(samples: Samples, derive: Mapping[str, str | Rate | Direction], units: Mapping[str, str]) -> Samples:
    """Add the quantities of `derive`, each after those that it depends on."""
    expressions = {name: terms.parse(rule) for name, rule in derive.items() if isinstance(rule, str)}
    signals = {name: signal_of(name, rule, units) for name, rule in derive.items() if not isinstance(rule, str)}
    needs = {name: {signals[name].of} if name in signals else set(expressions[name].names) for name in derive}
    order = [name for name in graphlib.TopologicalSorter(needs).static_order() if name in derive]
    for name in order:
        if name in signals:
            with located(samples.label):
                values = signal_values(signals[name], samples.columns)
        else:
            values = terms.evaluate(expressions[name], samples.columns, samples.size)
        if not np.isfinite(values).all():
            at = int(np.argmin(np.isfinite(values)))
            raise DataError(f"{samples.at(at)}: derive.{name} gives {values[at]}", "Mend the expression or the data.")
        samples = samples.with_columns({name: values})
    return samples


def _kept(samples: Samples, condition: Keep, units: Mapping[str, str]) -> Samples:
    name = condition.quantity
    values = samples.columns[name]
    unit = "" if units[name] == "1" else f" {units[name]}"
    if condition.abs_below is not None:
        return samples.keep(np.abs(values) < condition.abs_below, f"|{name}| >= {condition.abs_below:g}{unit}")
    if condition.below is not None:
        return samples.keep(values < condition.below, f"{name} >= {condition.below:g}{unit}")
    if condition.above is not None:
        return samples.keep(values > condition.above, f"{name} <= {condition.above:g}{unit}")
    if condition.outside is not None:
        low, high = condition.outside
        return samples.keep((values < low) | (values > high), f"{name} from {low:g} to {high:g}{unit}")
    low, high = condition.between or (-np.inf, np.inf)
    return samples.keep((values >= low) & (values <= high), f"{name} outside {low:g} to {high:g}{unit}")
