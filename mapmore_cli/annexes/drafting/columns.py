"""Which column holds which quantity: by its title, and where that says nothing by its values; and
what drives what, where neither does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapmore_cli.annexes.drafting.answers import Answers
from mapmore_cli.annexes.drafting.draft import Column, Guess, Raw, range_of
from mapmore_cli.checking.evidence import leads, same_signals, untold
from mapmore_cli.checking.names import (
    POSITIONS,
    PRESSURES_IN_NAMES,
    ColumnTitle,
    read_label,
    unit_in,
)
from mapmore_cli.checking.rules.units import (
    LARGEST_PRESSURE,
    LARGEST_STRAIN,
    LONGEST_STEP,
    PRESSURE_IN_BAR,
    SAMPLES_OF_A_LOGGER,
)
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.spec.units import convert, is_canonical

WANTED = ("time", "pressure", "strain", "force", "displacement", "length")
STATES = 6  # different values, up to which a column is a state and not a measurement
SINCE_1970 = (3e8, 3e10)  # s, of any date since 1980
FRACTIONS = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of a second, that clocks count
LONGEST = 5.0  # s between samples, where a clock counts fractions of a second
PSI = 150.0  # largest pressure in psi
CLEAN_ZERO = 0.05  # of the largest value, that a pressure may lie below zero
NEAR_NAME = 0.15  # of the pressure in a name, that the median of a column may be off
ALIKE = 1.5  # times the largest value of a command, that what was measured of it reaches at most
MOST_UNNAMED = 4  # columns without titles that may be pressure, position and force
NAMED = 10.0  # evidence that nothing but the names of the files gives
VOLTS = 10.5  # up to which a converter reads
AIR = {"kPa": 101.325, "mbar": 1013.25, "bar": 1.01325, "Pa": 101325.0}
NEAR_AIR, LEAST_AIR = 0.015, 0.9
JUMPS = 0.001  # of the steps of a clock, that may go back
DATE = 1e8
TURNS = (360.0, 2 * np.pi, *(2.0**bits for bits in range(8, 25)))  # at which encoders begin anew
FULL, SMALL_STEP = (
    0.9,
    0.25,
)  # of a turn, that its values fill and a jump makes at least, and that a step makes at most
# of the spread of a named column, that what drives leaves at most where the last one is taken
TOLD = 0.5
CLOSE = 0.05  # of the spread, that errors differ where the later column is taken
STANDS_STILL = 0.05  # of the range of another pressure
_IN_BRACKETS = re.compile(
    r"[\[(]\s*([^\W\d_][^\])]*|%)\s*[\])]"
)  # what a title says there, as a unit


@dataclass(frozen=True)
class Table:
    """The columns of numbers of some files, the titles of those that have one, the texts below
    these, and where encoders begin anew.
    """

    titles: Mapping[Column, str]
    raw: Raw
    below: Mapping[Column, str] = field(default_factory=dict)
    turns: Mapping[Column, float] = field(default_factory=dict)


def guess_columns(
    table: Table, told: Sequence[float] = (), loaded: bool = False
) -> dict[str, Guess]:
    """Guess the columns of the quantities.

    Where titles name a quantity twice, the one with a unit in it wins, then the plainer, then the
    first. Without titles, time is what never decreases; strain what stays below 1.5; and of the
    rest the pressure is what is never negative, or what goes with the pressures in bar that the
    names of the files have `told`. What is left is a force, or a position where the muscle is
    `loaded` by a weight.
    """
    if not table.titles:
        return _by_values(table.raw, told, loaded)
    labels: dict[Column, ColumnTitle] = {}
    for column in (one for one in table.titles if one in table.raw):
        label = read_label(table.titles[column])
        if label is not None:
            labels[column] = replace(
                label, unit=label.unit or unit_in(label.quantity, table.below.get(column, ""))
            )
    guesses: dict[str, Guess] = {}
    for quantity in WANTED:
        named = [column for column, label in labels.items() if label.quantity == quantity]
        if quantity == "force" and not named:  # testers call the force a load
            named = [
                column
                for column, label in labels.items()
                if label.quantity == "load" and span(table.raw[column])
            ]
        if named:
            best = min(
                named, key=lambda column: (labels[column].unit is None, not labels[column].plain)
            )
            guess = _by_title(quantity, best, labels[best].unit, table)
            if _possible(quantity, table.raw[best], guess.unit):
                guesses[quantity] = guess
    return guesses


def _by_title(quantity: str, column: Column, named: str | None, table: Table) -> Guess:
    """Return the guess of a column whose title names the quantity, and perhaps a unit."""
    values = table.raw[column]
    if named is not None and _possible(quantity, values, named):
        return Guess(column, named, f"by its name; {range_of(values, named)}")
    unit, of_unit, sure = _unit_by_size(quantity, values, " because ")
    why = f"{quantity} by its name, {of_unit}"
    bracketed = _IN_BRACKETS.search(f"{table.titles[column]} [{table.below.get(column, '')}]")
    if named is not None:
        return Guess(column, unit, f"{why}; its name says {named}, which no muscle reaches", False)
    if bracketed is not None:
        return Guess(
            column, unit, f"{why}; its title says {bracketed[1]}, which is no unit of it", False
        )
    return Guess(column, unit, why, sure)


def told_guesses(answers: Answers, table: Table) -> dict[str, Guess]:
    """Return the columns that a person has named, all of them sure; DataError for one that holds no
    numbers.

    A unit that was not said is that of the title, else of the size of the values.
    """
    guesses = {}
    for name, told in answers.columns.items():
        if told.column not in table.raw:
            raise DataError(
                f"column {told.column} holds no numbers", f"name another column for {name}"
            )
        values = table.raw[told.column]
        label = read_label(table.titles.get(told.column, ""))
        unit, sure = told.unit, True
        if not unit and label is not None and label.quantity == name:
            unit = label.unit or ""
        of_unit = range_of(values, unit or "1")
        if not unit and is_canonical(name):
            unit, of_unit, sure = _unit_by_size(name, values)
        guesses[name] = replace(told, unit=unit or "1", why=f"{told.why}; {of_unit}", sure=sure)
    return guesses


def turn_of(values: Sequence[Array]) -> float | None:
    """Return the number at which an encoder begins anew: a usual one that the values fill, and jump
    by, else None.
    """
    low, high = min(one.min() for one in values), max(one.max() for one in values)
    turn = next(
        (
            one
            for one in TURNS
            if FULL * one <= high - low <= one and (low >= 0 or max(-low, high) <= one / 2)
        ),
        None,
    )
    if turn is None or high > turn:
        return None
    steps = np.abs(np.concatenate([np.diff(one) for one in values]))
    return (
        turn
        if (steps >= FULL * turn).any()
        and not ((steps > SMALL_STEP * turn) & (steps < FULL * turn)).any()
        else None
    )


# What numbers say
# --------------------------------------------------------------------------------------------------


def span(values: Sequence[Array]) -> float:
    """Return from the least to the largest value."""
    return float(np.ptp(np.concatenate(values)))


def _largest(values: Sequence[Array]) -> float:
    return max(float(np.abs(one).max()) for one in values)


def _lowest(values: Sequence[Array]) -> float:
    """Return the least value relative to the largest, at most 0: a pressure over atmosphere is
    never negative, a force has an offset.
    """
    least = min(float(one.min()) for one in values)
    return least / _largest(values) if least < 0 else 0.0


def _whole(values: Sequence[Array]) -> bool:
    return all((one == np.round(one)).all() for one in values)


def _is_clock(values: Sequence[Array]) -> bool:
    """Return True for what hardly ever decreases in any file, and for dates, in whatever unit they
    count.
    """
    return all(
        (np.ptp(one) > 0 and np.mean(np.diff(one) < 0) <= JUMPS) or float(np.abs(one).max()) > DATE
        for one in values
    )


def _is_state(values: Sequence[Array]) -> bool:
    """Return True for a column with a handful of values in many samples, as a valve's state."""
    return (
        sum(map(len, values)) > 20 * STATES
        and len(np.unique(np.concatenate(values))) < STATES
        and _whole(values)
    )


def _at_rest_like_air(values: Sequence[Array]) -> str | None:
    """Return the unit in which a column begins at the pressure of the air and never falls far
    below; None for none.
    """
    first, low = (
        float(np.median([one[0] for one in values])),
        min(float(one.min()) for one in values),
    )
    return next(
        (
            unit
            for unit, air in AIR.items()
            if abs(first / air - 1) < NEAR_AIR and low > LEAST_AIR * air
        ),
        None,
    )


def _possible(quantity: str, values: Sequence[Array], unit: str) -> bool:
    """Return False for what `check` refuses: a pressure above 5 MPa, a strain above 1.5."""
    usual, most = {"pressure": ("kPa", LARGEST_PRESSURE), "strain": ("1", LARGEST_STRAIN)}.get(
        quantity, (unit, np.inf)
    )
    return bool(convert(_largest(values), unit, usual) <= most)


def _unit_by_size(
    quantity: str, values: Sequence[Array], link: str = ", as "
) -> tuple[str, str, bool]:
    """Return the unit that values of this size have, why in words, with their range, and whether
    that is beyond doubt.
    """
    unit, why, sure = _sized(quantity, values)
    return (
        unit,
        f"{unit if unit != '1' else 'a fraction'}{link}{why}; {range_of(values, unit)}",
        sure,
    )


def _sized(quantity: str, values: Sequence[Array]) -> tuple[str, str, bool]:
    largest = _largest(values)
    reaches = f"it reaches {largest:.3g}"
    match quantity:
        case "time":
            since = next(
                (
                    unit
                    for unit, part in {"s": 1.0, **FRACTIONS}.items()
                    if SINCE_1970[0] < largest * part < SINCE_1970[1]
                ),
                None,
            )
            if since is not None:
                return since, f"its stamps are dates, read as {since} since 1970", True
            step = float(np.median(np.diff(values[0]))) if len(values[0]) > 1 else 0.0
            if len(values[0]) >= SAMPLES_OF_A_LOGGER and step > LONGEST_STEP:
                unit = next(
                    (unit for unit, part in FRACTIONS.items() if step * part <= LONGEST), "ms"
                )
                return unit, f"a step of {step:g} s would be slow for a logger", False
            return "s", f"its step is {step:.3g}", True
        case "pressure":
            resting = _at_rest_like_air(values)
            if resting is not None and resting != "bar":
                return (
                    resting,
                    f"it begins at {values[0][0]:.4g}, an atmosphere: absolute; an `offset` "
                    "makes it gauge",
                    False,
                )
            if largest > LARGEST_PRESSURE:
                return "Pa", f"{largest:.0f} kPa would burst anything", False
            if largest <= PRESSURE_IN_BAR[1]:
                return "bar", f"it ends at {largest:.3g}", False
            return (
                "kPa",
                f"it ends at {largest:.0f}" + ("" if largest > PSI else ", which may be psi"),
                largest > PSI,
            )
        case "strain":
            return "%" if largest > LARGEST_STRAIN else "1", reaches, True
        case "force":
            counts = _whole(values) and largest > STATES
            return (
                "N",
                "nothing else is said"
                + ("; whole numbers: counts of a converter?" if counts else ""),
                not counts,
            )
        case _:
            return "mm" if largest > LARGEST_STRAIN else "m", reaches, False


def pressure_evidence(values: Sequence[Array], told: Sequence[float] = ()) -> tuple[float, str]:
    """How much speaks for a pressure, and what: nothing below zero, air at rest, and above all what
    names have `told` in bar.
    """
    medians = np.array([float(np.median(one)) for one in values])
    if len(medians) == len(told) > 1:
        scale = np.maximum(np.abs(told), NEAR_NAME)
        offs = {
            unit: float(np.max(np.abs(convert(medians, unit, "bar") - told) / scale))
            for unit in PRESSURES_IN_NAMES
        }
        unit, off = min(offs.items(), key=lambda item: item[1])
        if off <= NEAR_NAME:
            names = (
                f"its medians, {medians.min():.4g} to {medians.max():.4g} {unit}, are the "
                "pressures in the names of the files"
            )
            return NAMED + 1 - off, names
    lowest = _lowest(values)
    if lowest <= -CLEAN_ZERO:
        return 0.0, "it is negative"
    resting = _at_rest_like_air(values)
    score = 2 + lowest + (3 if resting else 0) - (1 if _whole(values) else 0)
    return (
        score,
        "it is never negative"
        if resting is None
        else f"it begins at an atmosphere in {resting}, and is never below: absolute",
    )


def twins_of(raw: Raw, taken: Column | None = None) -> dict[Column, Column]:
    """Return the columns that are another one times a constant, with that other one.

    The one that stands for all is what is `taken` already, else what leaves the range of a
    converter's volts, else the last.
    """

    def rank(column: Column) -> tuple[bool, bool, int]:
        like_volts = (
            min(float(one.min()) for one in raw[column]) >= -CLEAN_ZERO * VOLTS
            and _largest(raw[column]) <= VOLTS
        )
        return column == taken, not like_volts, columns.index(column)

    columns = [column for column, values in raw.items() if span(values)]
    found: dict[Column, Column] = {}
    for family in same_signals([np.concatenate(raw[column]) for column in columns]):
        members = [columns[place] for place in family]
        best = max(members, key=rank)
        found |= {member: best for member in members if member != best}
    return found


def _by_values(raw: Raw, told: Sequence[float], loaded: bool) -> dict[str, Guess]:
    """Quantities of columns whose titles say nothing; none of them is certain.

    Each is the first of a ranked list. Of columns that are one signal in other units only one is
    taken.
    """
    left = {column: values for column, values in raw.items() if not _is_state(values)}
    guesses: dict[str, Guess] = {}
    clocks = [column for column, values in left.items() if _is_clock(values)]
    scores = {
        column: pressure_evidence(values, told)
        for column, values in left.items()
        if column not in clocks
    }
    best = max(scores, key=lambda column: scores[column][0], default=None)
    named = best is not None and scores[best][0] >= NAMED
    twins = twins_of({column: left[column] for column in scores}, best if named else None)

    def take(quantity: str, ranked: Sequence[Column], why: str = "") -> None:
        first, *others = [
            _guessed(quantity, column, why or scores[column][1], raw[column], twins)
            for column in ranked
        ]
        same = [twin for twin, of in twins.items() if of == first.column]
        others += [
            _guessed(quantity, twin, f"the same signal as column {first.column}", raw[twin], {})
            for twin in same
        ]
        guesses[quantity] = replace(first, rivals=tuple(others))
        left.pop(first.column)

    if clocks and len(left) > 2:
        take(
            "time",
            sorted(clocks, key=lambda column: max(abs(one[0]) for one in left[column])),
            "it never decreases",
        )
        left = {
            column: values for column, values in left.items() if column not in clocks
        }  # dates, and counters of samples
    left = {column: values for column, values in left.items() if column not in twins}
    if (
        len(set(told)) > 1 and not named and len(left) > 1
    ):  # the names tell the pressure, and no column does
        alike = sorted(left, key=lambda column: _strays(left[column]))
        position = "strain" if _largest(left[alike[0]]) <= LARGEST_STRAIN else "displacement"
        take(
            position, alike, "it goes the same way in all files, and the pressure is in their names"
        )
        take("force", alike[:0:-1], "it changes with the pressure in the names of the files")
        return guesses
    likely = sorted(
        (one for one in left if one in scores and scores[one][0] > 0),
        key=lambda one: -scores[one][0],
    )
    small = [
        column
        for column in left
        if _largest(left[column]) <= LARGEST_STRAIN and not (named and column == likely[0])
    ]
    if (
        len(left) > MOST_UNNAMED and not named
    ):  # too many for a guess of what each is: what drives, and what follows
        if likely:
            take("pressure", _without_commands(likely, left))
        return guesses
    if small and len(left) > 2 and not named:
        take("strain", small, "it is the smallest")
        likely = [column for column in likely if column in left]
    if likely and len(left) > 1:
        take("pressure", likely)
        swings = sorted(left, key=lambda column: -span(left[column]))
        if len(left) > 1 and "strain" not in guesses and (named or len(raw) > len(left) + 2):
            take(
                "displacement",
                (swings[1], swings[0], *swings[2:]),
                "it moves, and its place is a guess",
            )
            swings.pop(1)
        if loaded and not {"strain", "displacement"} & guesses.keys():
            take(
                "displacement",
                swings,
                "it is what is left, and a position where the names of the files tell a load",
            )
        elif swings:
            take("force", swings, A_FORCE_OR_ELSE)
    return guesses


A_FORCE_OR_ELSE = "it is what is left: a force, or a position (`displacement`)? Values do not tell"


def _guessed(
    quantity: str, column: Column, why: str, values: Sequence[Array], twins: Mapping[Column, Column]
) -> Guess:
    unit, of_unit, _ = _unit_by_size(quantity, values)
    same = ", ".join(str(twin) for twin, of in twins.items() if of == column)
    counts = (
        "; whole numbers: counts of a converter? Then give its calibration, as `force:N*1.74-18.6`"
    )
    why += counts if why == A_FORCE_OR_ELSE and _whole(values) else ""
    why += (
        f"; column {same} is the same signal in another unit, as a sensor's volts" if same else ""
    )
    return Guess(column, unit, f"{why}; {of_unit}", False)


def _strays(values: Sequence[Array]) -> float:
    """Return how far files differ in where they begin, end, and lie in between, of the range of
    all.
    """
    marks = np.array([np.quantile(one, (0.0, 0.5, 1.0)) for one in values])
    return float(np.max(np.ptp(marks, axis=0)) / (span(values) or 1.0))


def _without_commands(ranked: Sequence[Column], raw: Raw) -> list[Column]:
    """Return the ranked columns. One as large that follows the first stands before it: it was
    measured, the first is its command.
    """
    first = raw[ranked[0]]
    for other in (
        ranked[1:] if _at_rest_like_air(first) is None else []
    ):  # two chambers may follow each other
        as_large = 1 / ALIKE < _largest(raw[other]) / _largest(first) < ALIKE
        if as_large and leads(np.concatenate(first), np.concatenate(raw[other])):
            return [other, *(column for column in ranked if column != other)]
    return list(ranked)


# What drives, and what follows
# --------------------------------------------------------------------------------------------------


def guess_others(
    table: Table, known: Mapping[str, Guess]
) -> tuple[dict[str, Guess], list[str], str] | None:
    """Guess what drives and what follows where names say too little; None where not two columns
    move.

    Returns the columns by names made of their titles, the inputs, and the target. A force follows
    the position. Pressures drive, all of them; without another column they follow the commands.
    What is left is ranked by how well the drives tell it.
    """
    raw, titles = table.raw, table.titles
    position = next(
        (one for one in POSITIONS if one in known and _varies(raw[known[one].column])), ""
    )
    force = known["force"] if "force" in known and _varies(raw[known["force"].column]) else None
    if force is not None and position and "pressure" not in known:
        why = (
            f"{known[position].why}; no pressure was found: name its column, `set` it beside "
            "the files, or `join` its log"
        )
        guesses = {name: known[name] for name in ("time", position, "force") if name in known}
        return (
            {**guesses, position: replace(known[position], why=why, sure=False)},
            [position],
            "force",
        )
    clock = next((column for column in raw if _is_clock(raw[column])), None)
    guesses = {name: known[name] for name in ("time",) if name in known}
    if not guesses and clock is not None:
        guesses["time"] = Guess(
            clock, "s", f"it never decreases; {range_of(raw[clock], 's')}", False
        )
    moving = {
        column: values
        for column, values in raw.items()
        if _varies(values) and not _is_clock(values)
    }
    twins = twins_of(moving, known["pressure"].column if "pressure" in known else None)
    moving = {column: values for column, values in moving.items() if column not in twins}
    commands = [
        column
        for column in moving
        if (label := read_label(titles.get(column, ""))) is not None and label.quantity == "input"
    ]
    pressures = {one.column: one for one in _pressures_of(titles, moving, known)}
    drives = [*pressures] if moving.keys() - pressures.keys() - {*commands} else []
    commands = (
        commands if len(commands) < len(moving) else commands[:1]
    )  # `u_V` and `y_V`: both are volts
    drives = drives or commands or [*pressures] or [*moving][:1]
    left = [column for column in moving if column not in drives and column not in commands]
    if not drives or not left:
        return None
    by_pressure = drives == [*pressures]
    names = ["pressure", *(f"pressure_{number}" for number in range(2, len(drives) + 1))]
    if (
        by_pressure
        and force is not None
        and position
        and {force.column, known[position].column} <= {*left}
    ):
        inputs = dict(zip(names, pressures.values(), strict=True))
        return (
            {**guesses, **inputs, position: known[position], "force": force},
            [*inputs, position],
            "force",
        )
    errors = {column: untold([raw[one] for one in drives], raw[column]) for column in left}
    near = [column for column in reversed(left) if errors[column] <= min(errors.values()) + CLOSE]
    ranked = [
        *near,
        *sorted((column for column in left if column not in near), key=errors.__getitem__),
    ]
    if titles and errors[left[-1]] < TOLD:  # who names columns puts what matters last
        ranked = [left[-1], *(column for column in ranked if column != left[-1])]
    follows = {
        column: f"all but {errors[column]:.0%} of it is told by what drives" for column in ranked
    }
    names = (
        [*names, *names_of(ranked[:1], titles, ["response"])]
        if by_pressure
        else names_of([*drives, ranked[0]], titles)
    )
    for name, column in zip(names, [*drives, ranked[0]], strict=True):
        unit = pressures[column].unit if by_pressure and column in pressures else ""
        what = f"follows: {follows[column]}" if column in follows else "drives"
        why = (
            f"taken as what {what}{'' if unit else ', without a unit'}; "
            f"{range_of(raw[column], unit or '1')}"
        )
        guesses[name] = Guess(column, unit or "1", why, False)
    rivals = tuple(
        Guess(column, "1", f"{follows[column]}; {range_of(raw[column])}", False)
        for column in ranked[1:]
    )
    guesses[names[-1]] = replace(guesses[names[-1]], rivals=rivals)
    return guesses, names[:-1], names[-1]


def _pressures_of(
    titles: Mapping[Column, str], raw: Raw, known: Mapping[str, Guess]
) -> list[Guess]:
    """All pressures that move: the known one, others by their titles, and those that rest at an
    atmosphere as it does.

    Of two that rise and fall together the one that comes later was measured, and the other is its
    command.
    """
    first = known.get("pressure")
    if first is None or first.column not in raw:
        return []
    found = [first]
    here = raw[first.column]
    air = _at_rest_like_air(here)
    for column, values in raw.items():
        label = read_label(titles.get(column, ""))
        by_title = label is not None and label.quantity == "pressure"
        by_value = not titles and air is not None and _at_rest_like_air(values) == air
        if (
            column != first.column
            and (by_title or by_value)
            and span(values) > STANDS_STILL * span(here)
        ):
            unit = label.unit if label is not None and label.unit else first.unit
            found.append(
                Guess(column, unit, f"a pressure as well; {range_of(values, unit)}", False)
            )
    return found


def count_pressures(table: Table, guesses: Mapping[str, Guess]) -> int:
    """Return how many pressures move, without those that are one of the others in another unit."""
    twins = twins_of(table.raw, guesses["pressure"].column if "pressure" in guesses else None)
    raw = {column: values for column, values in table.raw.items() if column not in twins}
    return len(_pressures_of(table.titles, raw, guesses))


def _varies(values: Sequence[Array]) -> bool:
    return span(values) > 0 and not _is_state(values)


def names_of(
    columns: Sequence[Column], titles: Mapping[Column, str], usual: Sequence[str] = ()
) -> list[str]:
    """Names of quantities for columns, each its own; without titles `drive`, `drive_2` ... and
    `response`, or the `usual` ones.
    """
    made = [
        re.sub(r"\W+", "_", titles.get(column, ""), flags=re.ASCII).strip("_")[:40]
        for column in columns
    ]
    possible = all(
        re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) and not is_canonical(name) for name in made
    )
    plain = [f"drive_{number}" if number > 1 else "drive" for number in range(1, len(columns))]
    return made if possible and len(set(made)) == len(made) else [*usual] or [*plain, "response"]
