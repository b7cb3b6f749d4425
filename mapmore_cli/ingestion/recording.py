"""From one file and the logs joined to it to its recordings: everything that was left out is counted."""

from __future__ import annotations

import graphlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.fitting.kinds.dictionary import signal_of
from mapmore_cli.ingestion.clock import Clocked, clocked, found_shift, in_time_order, without_glitches
from mapmore_cli.ingestion.files import Log, Meter, Source
from mapmore_cli.ingestion.samples import Samples, located, read_tables, without_missing
from mapmore_cli.modelling import expressions as terms
from mapmore_cli.modelling.signals.rates import signal_values
from mapmore_cli.modelling.signals.sampling import align
from mapmore_cli.spec.sections.data import Data, Direction, Rate
from mapmore_cli.spec.sections.logs import Join, Keep
from mapmore_cli.spec.units import convert
from mapmore_cli.storage.spool import by_blocks, counted


def joined(tables: Sequence[Samples], source: Source, data: Data, units: Mapping[str, str], meter: Meter) -> list[Samples]:
    """Return the recordings of a file with the quantities of the logs that are joined to it, NaN where those have no value.

    Raises DataError for logs that do not fit: a different number of recordings or rows.
    """
    found = list(tables)
    for join, log in zip(data.join, source.joined, strict=True):
        others = _read(log, join, data, units, meter)
        if len(others) not in (1, len(found)):
            raise DataError(
                f"{log.name}: holds {len(others)} recordings, but {source.name} holds {len(found)}",
                "Join a file that holds as many, or one.",
            )
        pairs = zip(found, others if len(others) > 1 else others * len(found), strict=True)
        found = [
            replace(
                _by_row(first, second, join) if join.on == "row" else _by_time(first, second, join, units),
                doubts=(*first.doubts, *second.doubts),
            )
            for first, second in pairs
        ]
    return found


def _read(log: Log, join: Join, data: Data, units: Mapping[str, str], meter: Meter) -> list[Samples]:
    tables = read_tables(log, join, data.missing_rule, units, meter)
    if join.on == "row":
        return tables
    whole = [without_glitches(without_missing(samples, join, data.missing_rule.action), data.glitches) for samples in tables]
    return [in_time_order(samples, data.repeated_time) for samples in whole]


def _by_row(first: Samples, second: Samples, join: Join) -> Samples:
    if first.size != second.size:
        raise DataError(
            f"{second.label}: has {second.size} rows, but {first.label} has {first.size}", "Rows can only be paired in logs of one length."
        )
    return first.with_columns({name: second.columns[name] for name in join.quantities})


def _by_time(first: Samples, second: Samples, join: Join, units: Mapping[str, str]) -> Samples:
    shift, note = (convert(join.shift, "s", units["time"]), "") if join.shift != "auto" else found_shift(first, second, join, units)
    max_gap = None if join.max_gap is None else convert(join.max_gap, "s", units["time"])
    stamps, time = first.columns["time"], second.columns["time"] + shift
    columns = {name: align(stamps, time, second.columns[name], max_gap) for name in join.quantities}
    if np.isnan(columns[join.quantities[0]]).all():
        raise DataError(
            f"{second.label}: no sample at the time of {first.label}: with its shift it runs from {time[0]:g} to {time[-1]:g} "
            f"{units['time']}, the first log from {np.nanmin(stamps):g} to {np.nanmax(stamps):g}",
            "Look at `shift`, which is added to the time of the second log, and at `max_gap`.",
        )
    return replace(first.with_columns(columns), notes=(*first.notes, *([note] if note else [])))


@dataclass(frozen=True)
class ReadLog:
    """One log as recorded: its `pieces` in order of time, a single one where it has no gaps, and what was found in it."""

    pieces: tuple[Recording, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def read_recordings(source: Source, data: Data, units: Mapping[str, str], meter: Meter) -> list[ReadLog]:
    """Read a file and the logs that are joined to it, and bring them into the model's `units`.

    In this order: scale and offset, joined logs, missing values, constants, time stamps and gaps, even time steps, derived quantities,
    conditions to keep samples. Raises DataError naming file, row and column.
    """
    tables = read_tables(source, data, data.missing_rule, units, meter)
    return [_reading(samples, source, data, units) for samples in joined(tables, source, data, units, meter)]


def _reading(samples: Samples, source: Source, data: Data, units: Mapping[str, str]) -> ReadLog:
    samples = without_missing(samples, data, data.missing_rule.action)
    samples = samples.with_columns({name: _constant(value, samples.size) for name, value in source.constants.items()})
    whole = clocked(samples, data, units)
    finished = [_finished(piece, data, source.keep, units) for piece in whole.pieces if piece.size]
    left = [piece for piece in finished if piece.size]
    if not left:
        (finished or whole.pieces)[0].some()
    name = source.id if samples.element is None else f"{source.id}[{samples.element}]"
    names = [f"{name}#{number}" for number in range(1, len(left) + 1)] if len(whole.pieces) > 1 else [name]
    log = name if len(names) > 1 or names != [name] else ""
    recordings = tuple(_recording(name, source.name, piece, log) for name, piece in zip(names, left, strict=True))
    return ReadLog(recordings, (*samples.notes, *whole.notes), (*samples.doubts, *whole.warnings, *_emptied(whole, left)))


def _constant(value: float, size: int) -> Array:
    column: Array = counted(lambda rows: np.full(len(rows), value, dtype=np.float64), size)
    return column


def _emptied(whole: Clocked, left: list[Samples]) -> list[str]:
    """Return a warning where pieces of a recording are left out whole."""
    lost = len(whole.pieces) - len(left)
    return [f"{whole.pieces[0].label}: {lost} of {len(whole.pieces)} pieces between gaps have no sample left"] if lost else []


def _recording(name: str, source: str, samples: Samples, log: str) -> Recording:
    dropped = {reason: len(rows) for reason, rows in samples.left_out.items()}
    return Recording(name, source, samples.columns, samples.rows_read, dropped, log)


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
            values = _evaluated(expressions[name], samples)
        finite = by_blocks(np.isfinite, values)
        if not finite.all():
            at = int(np.argmin(finite))
            raise DataError(f"{samples.at(at)}: derive.{name} gives {values[at]}", "Mend the expression or the data.")
        samples = samples.with_columns({name: values})
    return samples


def _evaluated(expression: terms.Expression, samples: Samples) -> Array:
    names = [name for name in samples.columns if name in expression.names] or list(samples.columns)[:1]
    columns = [samples.columns[name] for name in names]
    values: Array = by_blocks(lambda *part: terms.evaluate(expression, dict(zip(names, part, strict=True)), len(part[0])), *columns)
    return values


def _kept(samples: Samples, condition: Keep, units: Mapping[str, str]) -> Samples:
    name = condition.quantity
    fulfils, reason = _condition(condition, name, "" if units[name] == "1" else f" {units[name]}")
    return samples.keep(by_blocks(fulfils, samples.columns[name]), reason)


def _condition(condition: Keep, name: str, unit: str) -> tuple[Callable[[Array], BoolArray], str]:
    """Return what is to hold for the values of a quantity, and the reason to leave out those for which it does not."""
    if (limit := condition.abs_below) is not None:
        return lambda values: np.abs(values) < limit, f"|{name}| >= {limit:g}{unit}"
    if (limit := condition.below) is not None:
        return lambda values: values < limit, f"{name} >= {limit:g}{unit}"
    if (limit := condition.above) is not None:
        return lambda values: values > limit, f"{name} <= {limit:g}{unit}"
    if condition.outside is not None:
        low, high = condition.outside
        return lambda values: (values < low) | (values > high), f"{name} from {low:g} to {high:g}{unit}"
    low, high = condition.between or (-np.inf, np.inf)
    return lambda values: (values >= low) & (values <= high), f"{name} outside {low:g} to {high:g}{unit}"
