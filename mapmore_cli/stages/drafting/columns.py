"""Which column holds which quantity: by its title, and where that says nothing by its values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.spec.units import convert
from mapmore_cli.stages.inspection.labels import ColumnTitle, read_label, unit_in

STATES = 6  # different values, up to which a column is a state and not a measurement
SINCE_1970 = (1e8, 1e11)  # s, of any date within a lifetime
LOGGED = 1000  # samples of a record that a logger took
SLOWEST = 0.2  # s between samples of a logger
LARGEST_FRACTION = 1.5
BAR, PSI, PASCAL = 12.0, 150.0, 5000.0  # largest pressures in bar, psi and kPa
CLEAN_ZERO = 0.05  # of the largest value, that a pressure may lie below zero
NEAR_NAME = 0.15  # of the pressure in a name, and bar, that the median of a column may be off
JUMPS = 0.001  # of the steps of a clock, that may go back
DATE = 1e8
WANTED = ("time", "pressure", "strain", "force", "displacement", "length")

Raw = Mapping[str | int, Sequence[Array]]
"""Values of every column, one array `(n,)` for each file."""


@dataclass(frozen=True)
class Guess:
    """A quantity's column and unit, and why."""

    column: str | int
    unit: str
    why: str
    sure: bool

    def as_spec(self) -> dict[str, str | int]:
        """The column as the spec describes it."""
        return {"column": self.column} if self.unit == "1" else {"column": self.column, "unit": self.unit}


def guess_columns(
    titles: Mapping[str | int, str],
    raw: Raw,
    below: Mapping[str | int, str] | None = None,
    told: Sequence[float] = (),
    loaded: bool = False,
) -> dict[str, Guess]:
    """Guess the columns of the quantities, given the titles of those that have one, and the units `below` them.

    Where titles name a quantity twice, the one with a unit in it wins, then the plainer, then the first. Without titles, time is what
    never decreases; strain what stays below 1.5; and of the rest the pressure is what is never negative, or what goes with the pressures in
    bar that the names of the files have `told`. What is left is a force, or a position where the muscle is `loaded` by a weight.
    """
    labels = {column: label for column, title in titles.items() if (label := read_label(title)) is not None and column in raw}
    for column, text in (below or {}).items():
        if column in labels and labels[column].unit is None:
            labels[column] = replace(labels[column], unit=unit_in(labels[column].quantity, text))
    guesses: dict[str, Guess] = {}
    for quantity in WANTED:
        named = [column for column, label in labels.items() if label.quantity == quantity]
        if quantity == "force" and not named:  # testers call the force a load
            named = [column for column, label in labels.items() if label.quantity == "load" and np.ptp(np.concatenate(raw[column]))]
        if named:
            best = min(named, key=lambda column: (labels[column].unit is None, not labels[column].plain))
            guess = _by_title(quantity, best, labels[best], raw[best])
            if _possible(quantity, raw[best], guess.unit):
                guesses[quantity] = guess
    return guesses if titles else _by_values(raw, told, loaded)


def _by_title(quantity: str, column: str | int, label: ColumnTitle, values: Sequence[Array]) -> Guess:
    if label.unit is not None and _possible(quantity, values, label.unit):
        return Guess(column, label.unit, f"by its name; {range_of(values, label.unit)}", True)
    unit, why, sure = _unit_by_size(quantity, values)
    told = f"{quantity} by its name, {unit if unit != '1' else 'a fraction'} because {why}; {range_of(values, unit)}"
    if label.unit is not None:
        return Guess(column, unit, f"{told}; its name says {label.unit}, which no muscle reaches", False)
    return Guess(column, unit, told, sure)


def _possible(quantity: str, values: Sequence[Array], unit: str) -> bool:
    """False for what `check` refuses: a pressure above 5 MPa, a strain above 1.5."""
    largest = max(float(np.abs(one).max()) for one in values)
    match quantity:
        case "pressure":
            return convert(largest, unit, "kPa") <= PASCAL
        case "strain":
            return convert(largest, unit, "1") <= LARGEST_FRACTION
        case _:
            return True


def _unit_by_size(quantity: str, values: Sequence[Array]) -> tuple[str, str, bool]:
    """The unit that values of this size have, why, and whether that is beyond doubt."""
    largest = max(float(np.abs(one).max()) for one in values)
    match quantity:
        case "time":
            if SINCE_1970[0] < largest < SINCE_1970[1]:
                return "s", "its stamps are dates, read as seconds since 1970", True
            step = float(np.median(np.diff(values[0]))) if len(values[0]) > 1 else 0.0
            if len(values[0]) >= LOGGED and step > SLOWEST:
                return "ms", f"a step of {step:g} s would be slow for a logger", False
            return "s", f"its step is {step:.3g}", True
        case "pressure":
            if largest > PASCAL:
                return "Pa", f"{largest:.0f} kPa would burst anything", False
            if largest <= BAR:
                return "bar", f"it ends at {largest:.3g}", False
            return "kPa", f"it ends at {largest:.0f}" + ("" if largest > PSI else ", which may be psi"), largest > PSI
        case "strain":
            return ("%", f"it reaches {largest:.3g}", True) if largest > LARGEST_FRACTION else ("1", f"it reaches {largest:.3g}", True)
        case "force":
            return "N", "nothing else is said", True
        case _:
            return ("mm", f"it reaches {largest:.3g}", False) if largest > LARGEST_FRACTION else ("m", f"it reaches {largest:.3g}", False)


def _by_values(raw: Raw, told: Sequence[float], loaded: bool) -> dict[str, Guess]:
    """Quantities of columns whose titles say nothing; none of them is certain."""
    left = {column: values for column, values in raw.items() if not is_state(values)}
    guesses: dict[str, Guess] = {}

    def take(quantity: str, column: str | int, why: str) -> None:
        values = left.pop(column)
        unit, of_unit, _ = _unit_by_size(quantity, values)
        guesses[quantity] = Guess(
            column, unit, f"{why}; {unit if unit != '1' else 'a fraction'}, as {of_unit}; {range_of(values, unit)}", False
        )

    for column, values in left.items():
        medians = np.array([float(np.median(one)) for one in values])
        if len(medians) == len(told) > 1 and np.allclose(medians, told, rtol=NEAR_NAME, atol=NEAR_NAME):
            guesses["pressure"] = Guess(column, "bar", f"its values are those in the names of the files; {range_of(values, 'bar')}", True)
            left = {other: others for other, others in left.items() if other != column}
            break
    clocks = [column for column, values in left.items() if all(is_clock(one) for one in values)]
    if clocks and len(left) > 2:
        take("time", min(clocks, key=lambda column: max(abs(one[0]) for one in left[column])), "it never decreases")
        left = {column: values for column, values in left.items() if column not in clocks}  # dates, and counters of samples
    small = [column for column, values in left.items() if max(np.abs(one).max() for one in values) <= LARGEST_FRACTION]
    if "pressure" in guesses and len(left) > 1:
        swings = sorted(left, key=lambda column: float(np.ptp(np.concatenate(left[column]))))
        take("displacement", swings[-2], "it moves, and its place is a guess")
        take("force", swings[-1], "it moves most")
        return guesses
    if small and len(left) > 2:
        take("strain", small[0], "it is the smallest")
    clean = max(left, key=lambda column: _lowest(left[column]), default=None)
    if clean is not None and len(left) > 1 and _lowest(left[clean]) > -CLEAN_ZERO:
        take("pressure", clean, "it is never negative")
        rest = max(left, key=lambda column: float(np.ptp(np.concatenate(left[column]))))
        if loaded and "strain" not in guesses:
            take("displacement", rest, "it is what is left, and a position where the names of the files tell a load")
        else:
            take("force", rest, "it is what is left: a force, or a position (`displacement`)? Values do not tell")
    return guesses


def _lowest(values: Sequence[Array]) -> float:
    """The least value relative to the largest, at most 0: a pressure over atmosphere is never negative, a force has an offset."""
    pooled = np.concatenate(values)
    least = float(pooled.min())
    return least / float(np.abs(pooled).max()) if least < 0 else 0.0


def is_clock(values: Array) -> bool:
    """True for what hardly ever decreases, and for dates, in whatever unit they count."""
    steps = np.diff(values)
    return bool(np.ptp(values) > 0 and np.mean(steps < 0) <= JUMPS) or float(np.abs(values).max()) > DATE


def is_state(values: Sequence[Array]) -> bool:
    """True for a column with a handful of values in many samples, as a valve's state."""
    return sum(map(len, values)) > 20 * STATES and len(np.unique(np.concatenate(values))) < STATES and _whole(values)


def _whole(values: Sequence[Array]) -> bool:
    return all((one == np.round(one)).all() for one in values)


def range_of(values: Sequence[Array], unit: str) -> str:
    """From where to where values go, in words."""
    low, high = min(one.min() for one in values), max(one.max() for one in values)
    return f"{low:.4g} to {high:.4g}{'' if unit == '1' else f' {unit}'}"
