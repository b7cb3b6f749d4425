"""Which column holds which quantity: by its title, and where that says nothing by its values."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.spec.units import convert, is_canonical
from mapmore_cli.study.drafting.answers import Answers
from mapmore_cli.study.inspection.evidence import ColumnTitle, leads, read_label, same_signals, unit_in

STATES = 6  # different values, up to which a column is a state and not a measurement
SINCE_1970 = (3e8, 3e10)  # s, of any date since 1980
FRACTIONS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of a second, that clocks count
LONGEST = 5.0  # s between samples, where a clock counts fractions of a second
LOGGED = 1000  # samples of a record that a logger took
SLOWEST = 0.2  # s between samples of a logger
LARGEST_FRACTION = 1.5
BAR, PSI, PASCAL = 12.0, 150.0, 5000.0  # largest pressures in bar, psi and kPa
CLEAN_ZERO = 0.05  # of the largest value, that a pressure may lie below zero
NEAR_NAME = 0.15  # of the pressure in a name, that the median of a column may be off
ALIKE = 1.5  # times the largest value of a command, that what was measured of it reaches at most
MOST_UNNAMED = 4  # columns without titles that may be pressure, position and force
NAMED = 10.0  # evidence that nothing but the names of the files gives
VOLTS = 10.5  # up to which a converter reads
UNITS_IN_NAMES = ("bar", "kPa", "psi", "mbar", "MPa", "Pa")
AIR = {"kPa": 101.325, "mbar": 1013.25, "bar": 1.01325, "Pa": 101325.0}
NEAR_AIR, LEAST_AIR = 0.015, 0.9
JUMPS = 0.001  # of the steps of a clock, that may go back
DATE = 1e8
WANTED = ("time", "pressure", "strain", "force", "displacement", "length")

Raw = Mapping[str | int, Sequence[Array]]
"""Values of every column, one array `(n,)` for each file."""


@dataclass(frozen=True)
class Guess:
    """A quantity's column and unit, and why; `rivals` are the columns that come next, the likeliest first.

    The quantity is `value * scale + offset` in `unit`; `unwrap` is the number at which its encoder begins anew.
    """

    column: str | int
    unit: str
    why: str
    sure: bool
    scale: float = 1.0
    offset: float = 0.0
    unwrap: float | None = None
    rivals: tuple[Guess, ...] = field(default=(), compare=False)

    def as_spec(self) -> dict[str, str | int | float]:
        """Return the column as the spec describes it."""
        changed = {"scale": self.scale} if self.scale != 1 else {}
        changed |= {"offset": self.offset} if self.offset else {}
        changed |= {"unwrap": self.unwrap} if self.unwrap else {}
        return {"column": self.column, **({} if self.unit == "1" else {"unit": self.unit}), **changed}


_IN_BRACKETS = re.compile(r"[\[(]\s*([^\W\d_][^\])]*|%)\s*[\])]")
"""What a title says in brackets, as a unit."""


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
            told_unit = _IN_BRACKETS.search(f"{titles[best]} [{(below or {}).get(best, '')}]")
            if told_unit is not None and labels[best].unit is None:
                guess = replace(guess, why=f"{guess.why}; its title says {told_unit[1]}, which is no unit of it", sure=False)
            if _possible(quantity, raw[best], guess.unit):
                guesses[quantity] = guess
    return guesses if titles else _by_values(raw, told, loaded)


TURNS = (360.0, 2 * np.pi, *(2.0**bits for bits in range(8, 25)))  # at which encoders begin anew
FULL, SMALL_STEP = 0.9, 0.25  # of a turn, that its values fill and a jump makes at least, and that a step makes at most


def turn_of(values: Sequence[Array]) -> float | None:
    """Return the number at which an encoder begins anew: a usual one that the values fill, and jump by, else None."""
    pooled = np.concatenate(values)
    low, high = float(pooled.min()), float(pooled.max())
    turn = next((one for one in TURNS if FULL * one <= high - low <= one and (low >= 0 or max(-low, high) <= one / 2)), None)
    if turn is None or high > turn:
        return None
    steps = np.abs(np.concatenate([np.diff(one) for one in values]))
    return turn if (steps >= FULL * turn).any() and not ((steps > SMALL_STEP * turn) & (steps < FULL * turn)).any() else None


def with_turns(guesses: Mapping[str, Guess], turns: Mapping[str | int, float]) -> dict[str, Guess]:
    """Return the guesses with what is to be unwrapped."""
    return {
        name: replace(one, unwrap=turns[one.column], why=f"{one.why}; it jumps by {turns[one.column]:g}: an encoder that wraps", sure=False)
        if one.column in turns
        else one
        for name, one in guesses.items()
    }


def told_guesses(answers: Answers, titles: Mapping[str | int, str], raw: Raw) -> dict[str, Guess]:
    """Return the columns that a person has named, all of them sure; DataError for one that holds no numbers.

    A unit that was not said is that of the title, else of the size of the values.
    """
    guesses = {}
    for name, told in answers.columns.items():
        if told.column not in raw:
            raise DataError(f"column {told.column} holds no numbers", f"name another column for {name}")
        unit, why, sure = told.unit, "as you said", True
        label = read_label(titles.get(told.column, ""))
        if unit is None and label is not None and label.quantity == name:
            unit = label.unit
        if unit is None and is_canonical(name):
            unit, of_unit, sure = _unit_by_size(name, raw[told.column])
            why = f"as you said; {unit if unit != '1' else 'a fraction'}, as {of_unit}"
        unit = unit or "1"
        guesses[name] = Guess(told.column, unit, f"{why}; {range_of(raw[told.column], unit)}", sure, told.scale, told.offset)
    return guesses


def _by_title(quantity: str, column: str | int, label: ColumnTitle, values: Sequence[Array]) -> Guess:
    if label.unit is not None and _possible(quantity, values, label.unit):
        return Guess(column, label.unit, f"by its name; {range_of(values, label.unit)}", True)
    unit, why, sure = _unit_by_size(quantity, values)
    told = f"{quantity} by its name, {unit if unit != '1' else 'a fraction'} because {why}; {range_of(values, unit)}"
    if label.unit is not None:
        return Guess(column, unit, f"{told}; its name says {label.unit}, which no muscle reaches", False)
    return Guess(column, unit, told, sure)


def _possible(quantity: str, values: Sequence[Array], unit: str) -> bool:
    """Return False for what `check` refuses: a pressure above 5 MPa, a strain above 1.5."""
    largest = max(float(np.abs(one).max()) for one in values)
    match quantity:
        case "pressure":
            return convert(largest, unit, "kPa") <= PASCAL
        case "strain":
            return convert(largest, unit, "1") <= LARGEST_FRACTION
        case _:
            return True


def _unit_by_size(quantity: str, values: Sequence[Array]) -> tuple[str, str, bool]:
    """Return the unit that values of this size have, why, and whether that is beyond doubt."""
    largest = max(float(np.abs(one).max()) for one in values)
    match quantity:
        case "time":
            since = next((unit for unit, part in {"s": 1.0, **FRACTIONS}.items() if SINCE_1970[0] < largest * part < SINCE_1970[1]), None)
            if since is not None:
                return since, f"its stamps are dates, read as {since} since 1970", True
            step = float(np.median(np.diff(values[0]))) if len(values[0]) > 1 else 0.0
            if len(values[0]) >= LOGGED and step > SLOWEST:
                unit = next((unit for unit, part in FRACTIONS.items() if step * part <= LONGEST), "ms")
                return unit, f"a step of {step:g} s would be slow for a logger", False
            return "s", f"its step is {step:.3g}", True
        case "pressure":
            resting = at_rest_like_air(values)
            if resting is not None and resting != "bar":
                return resting, f"it begins at {values[0][0]:.4g}, an atmosphere: absolute; an `offset` makes it gauge", False
            if largest > PASCAL:
                return "Pa", f"{largest:.0f} kPa would burst anything", False
            if largest <= BAR:
                return "bar", f"it ends at {largest:.3g}", False
            return "kPa", f"it ends at {largest:.0f}" + ("" if largest > PSI else ", which may be psi"), largest > PSI
        case "strain":
            return ("%", f"it reaches {largest:.3g}", True) if largest > LARGEST_FRACTION else ("1", f"it reaches {largest:.3g}", True)
        case "force" if _whole(values) and largest > STATES:
            return "N", "nothing else is said; whole numbers: counts of a converter?", False
        case "force":
            return "N", "nothing else is said", True
        case _:
            return ("mm", f"it reaches {largest:.3g}", False) if largest > LARGEST_FRACTION else ("m", f"it reaches {largest:.3g}", False)


def _by_values(raw: Raw, told: Sequence[float], loaded: bool) -> dict[str, Guess]:
    """Quantities of columns whose titles say nothing; none of them is certain.

    Each is the first of a ranked list. Of columns that are one signal in other units only one is taken.
    """
    left = {column: values for column, values in raw.items() if not is_state(values)}
    guesses: dict[str, Guess] = {}
    clocks = [column for column, values in left.items() if all(is_clock(one) for one in values)]
    moving = {column: values for column, values in left.items() if column not in clocks}
    scores = {column: pressure_evidence(values, told) for column, values in moving.items()}
    best = max(moving, key=lambda column: scores[column][0], default=None)
    named = best is not None and scores[best][0] >= NAMED
    twins = twins_of(moving, best if named else None)

    def take(quantity: str, ranked: Sequence[tuple[str | int, str]]) -> None:
        first, *others = [_guessed(quantity, column, f"{why}{_twins_told(column, twins)}", raw[column]) for column, why in ranked]
        same = [twin for twin, of in twins.items() if of == first.column]
        others += [_guessed(quantity, twin, f"the same signal as column {first.column}", raw[twin]) for twin in same]
        guesses[quantity] = replace(first, rivals=tuple(others))
        left.pop(first.column)

    if clocks and len(left) > 2:
        ranked = sorted(clocks, key=lambda column: max(abs(one[0]) for one in left[column]))
        take("time", [(column, "it never decreases") for column in ranked])
        left = {column: values for column, values in left.items() if column not in clocks}  # dates, and counters of samples
    left = {column: values for column, values in left.items() if column not in twins}
    if len(set(told)) > 1 and not named and len(left) > 1:  # the names tell the pressure, and no column does
        alike = sorted(left, key=lambda column: _strays(left[column]))
        position = "strain" if _largest(left[alike[0]]) <= LARGEST_FRACTION else "displacement"
        take(position, [(column, "it goes the same way in all files, and the pressure is in their names") for column in alike])
        take("force", [(column, "it changes with the pressure in the names of the files") for column in alike[:0:-1]])
        return guesses
    likely = sorted((one for one in left if one in moving and scores[one][0] > 0), key=lambda one: -scores[one][0])
    small = [column for column in left if _largest(left[column]) <= LARGEST_FRACTION and not (named and column == likely[0])]
    if len(left) > MOST_UNNAMED and not named:  # too many for a guess of what each is: what drives, and what follows
        if likely:
            take("pressure", [(column, scores[column][1]) for column in _without_commands(likely, left)])
        return guesses
    if small and len(left) > 2 and not named:
        take("strain", [(column, "it is the smallest") for column in small])
        likely = [column for column in likely if column in left]
    if likely and len(left) > 1:
        take("pressure", [(column, scores[column][1]) for column in likely])
        swings = sorted(left, key=lambda column: -float(np.ptp(np.concatenate(left[column]))))
        if len(left) > 1 and "strain" not in guesses and (named or len(raw) > len(left) + 2):
            take("displacement", [(column, "it moves, and its place is a guess") for column in (swings[1], swings[0], *swings[2:])])
            swings.pop(1)
        if loaded and not {"strain", "displacement"} & guesses.keys():
            why = "it is what is left, and a position where the names of the files tell a load"
            take("displacement", [(column, why) for column in swings])
        elif swings:
            words = "; whole numbers: counts of a converter? Then give its calibration, as `force:N*1.74-18.6`"
            why = "it is what is left: a force, or a position (`displacement`)? Values do not tell"
            take("force", [(column, why + (words if _whole(raw[column]) else "")) for column in swings])
    return guesses


def _strays(values: Sequence[Array]) -> float:
    """Return how far files differ in where they begin, end, and lie in between, of the range of all."""
    marks = np.array([np.quantile(one, (0.0, 0.5, 1.0)) for one in values])
    return float(np.max(np.ptp(marks, axis=0)) / (np.ptp(np.concatenate(values)) or 1.0))


def _guessed(quantity: str, column: str | int, why: str, values: Sequence[Array]) -> Guess:
    unit, of_unit, _ = _unit_by_size(quantity, values)
    return Guess(column, unit, f"{why}; {unit if unit != '1' else 'a fraction'}, as {of_unit}; {range_of(values, unit)}", False)


def _without_commands(ranked: Sequence[str | int], raw: Raw) -> list[str | int]:
    """Return the ranked columns. One as large that follows the first stands before it: it was measured, the first is its command."""
    for other in ranked[1:] if at_rest_like_air(raw[ranked[0]]) is None else []:  # two chambers may follow each other
        if 1 / ALIKE < _largest(raw[other]) / _largest(raw[ranked[0]]) < ALIKE and leads(
            np.concatenate(raw[ranked[0]]), np.concatenate(raw[other])
        ):
            return [other, *(column for column in ranked if column != other)]
    return list(ranked)


def _twins_told(column: str | int, twins: Mapping[str | int, str | int]) -> str:
    same = [str(twin) for twin, of in twins.items() if of == column]
    return f"; column {', '.join(same)} is the same signal in another unit, as a sensor's volts" if same else ""


def twins_of(raw: Raw, taken: str | int | None = None) -> dict[str | int, str | int]:
    """Return the columns that are another one times a constant, with that other one.

    The one that stands for all is what is `taken` already, else what leaves the range of a converter's volts, else the last.
    """
    columns = [column for column, values in raw.items() if np.ptp(np.concatenate(values))]
    families = same_signals([np.concatenate(raw[column]) for column in columns])
    found: dict[str | int, str | int] = {}
    for family in families:
        members = [columns[place] for place in family]
        best = max(members, key=lambda one: (one == taken, not _like_volts(raw[one]), columns.index(one)))
        found |= {member: best for member in members if member != best}
    return found


def _like_volts(values: Sequence[Array]) -> bool:
    return min(float(one.min()) for one in values) >= -CLEAN_ZERO * VOLTS and _largest(values) <= VOLTS


def _largest(values: Sequence[Array]) -> float:
    return max(float(np.abs(one).max()) for one in values)


def pressure_evidence(values: Sequence[Array], told: Sequence[float] = ()) -> tuple[float, str]:
    """How much speaks for a pressure, and what: nothing below zero, air at rest, and above all what names have `told` in bar."""
    medians = np.array([float(np.median(one)) for one in values])
    if len(medians) == len(told) > 1:
        unit = min(UNITS_IN_NAMES, key=lambda unit: _off_names(convert(medians, unit, "bar"), told))
        off = _off_names(convert(medians, unit, "bar"), told)
        if off <= NEAR_NAME:
            return (
                NAMED + 1 - off,
                f"its medians, {medians.min():.4g} to {medians.max():.4g} {unit}, are the pressures in the names of the files",
            )
    lowest = _lowest(values)
    if lowest <= -CLEAN_ZERO:
        return 0.0, "it is negative"
    resting = at_rest_like_air(values)
    score = 2 + lowest + (3 if resting else 0) - (1 if _whole(values) else 0)
    return score, "it is never negative" if resting is None else f"it begins at an atmosphere in {resting}, and is never below: absolute"


def _off_names(medians: Array, told: Sequence[float]) -> float:
    """Return the largest distance from the pressures in the names, relative to these, where none of them is zero."""
    return float(np.max(np.abs(medians - told) / np.maximum(np.abs(told), NEAR_NAME)))


def at_rest_like_air(values: Sequence[Array]) -> str | None:
    """Return the unit in which a column begins at the pressure of the air and never falls far below; None for none."""
    first, low = float(np.median([one[0] for one in values])), min(float(one.min()) for one in values)
    return next((unit for unit, air in AIR.items() if abs(first / air - 1) < NEAR_AIR and low > LEAST_AIR * air), None)


def _lowest(values: Sequence[Array]) -> float:
    """Return the least value relative to the largest, at most 0: a pressure over atmosphere is never negative, a force has an offset."""
    pooled = np.concatenate(values)
    least = float(pooled.min())
    return least / float(np.abs(pooled).max()) if least < 0 else 0.0


def is_clock(values: Array) -> bool:
    """Return True for what hardly ever decreases, and for dates, in whatever unit they count."""
    steps = np.diff(values)
    return bool(np.ptp(values) > 0 and np.mean(steps < 0) <= JUMPS) or float(np.abs(values).max()) > DATE


def is_state(values: Sequence[Array]) -> bool:
    """Return True for a column with a handful of values in many samples, as a valve's state."""
    return sum(map(len, values)) > 20 * STATES and len(np.unique(np.concatenate(values))) < STATES and _whole(values)


def _whole(values: Sequence[Array]) -> bool:
    return all((one == np.round(one)).all() for one in values)


def range_of(values: Sequence[Array], unit: str) -> str:
    """From where to where values go, in words."""
    low, high = min(one.min() for one in values), max(one.max() for one in values)
    return f"{low:.4g} to {high:.4g}{'' if unit == '1' else f' {unit}'}"
