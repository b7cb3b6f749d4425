"""Find the quantities whose values stand in the names of files, folders and sheets."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.annexes.drafting.answers import Hold
from mapmore_cli.annexes.drafting.name_numbers import UNITS, NameNumber, numbers_in
from mapmore_cli.checking.names import read_label
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.storage.readers import suffix_of
from mapmore_cli.storage.tables.lines import name_of_packed
from mapmore_cli.study.units import CANONICAL, can_convert, convert, default_unit


@dataclass(frozen=True)
class Series:
    """Numbers with the same word and the same unit in the names of files. `numbers` holds them by
    the index of the name that contains the number. The series is complete if each name contains one
    of the numbers.
    """

    numbers: dict[int, NameNumber]
    is_complete: bool

    @property
    def first(self) -> NameNumber:
        """The first number. All numbers of the series have the same word and unit."""
        return next(iter(self.numbers.values()))

    @property
    def values(self) -> list[float]:
        """The different values of the numbers, in ascending order."""
        return sorted({number.value for number in self.numbers.values()})

    @property
    def is_count(self) -> bool:
        """Return True if the numbers have no unit and their values are consecutive, for example 1,
        2, 3.
        """
        values = self.values
        return not self.first.unit and values == [values[0] + at for at in range(len(values))]


@dataclass(frozen=True)
class NamedCondition:
    """A quantity whose values are in the names of files: its unit, and a value for every recording.

    `why` says how the values are written in the names. `sure` is False if some name has no number;
    its value is then zero.
    """

    quantity: str
    unit: str
    values: tuple[float, ...]
    why: str = ""
    sure: bool = True

    @property
    def in_model_units(self) -> list[float]:
        """The values, converted to the unit in which models use the quantity."""
        unit = CANONICAL.get(self.quantity, self.unit)
        if not self.unit or not unit:
            return [*self.values]
        return [float(f"{convert(value, self.unit, unit):.12g}") for value in self.values]


def stem_of(name: str) -> str:
    """Return the name of a file with its folders, without the suffixes of its format."""
    stem = name_of_packed(name)
    return stem[: len(stem) - len(suffix_of(Path(name)))]


def told_by_names(
    names: Sequence[str], hold: Hold | None = None, known: Sequence[str] = ()
) -> tuple[list[NamedCondition], list[str]]:
    """Return the quantities that vary from name to name, and a remark on every number that seems
    only to count repetitions.

    `known` are the quantities in columns; their values are not taken from names. Consecutive
    numbers without a unit count repetitions, unless a person names them with `hold`.

    Raises
    ------
    UsageError
        If neither names nor columns contain what `hold` asks for.
    """
    every = _series_of(names)
    asked = None
    if hold is not None and hold.name not in ("none", *known):
        asked = _asked_for(hold, every)
    named = {*known, *([hold.name] if hold is not None else [])}
    conditions: list[NamedCondition] = []
    repeats: list[str] = []
    for series in every:
        quantity = series.first.quantity
        if series is asked and hold is not None:
            conditions.append(_condition(hold.name, hold.unit, series, names))
        elif quantity in named or len(series.values) == 1:
            continue
        elif not (series.is_complete and quantity) or series.is_count:
            repeats.append(f"{series.first.shown} ...")
        else:
            named.add(quantity)
            conditions.append(_condition(quantity, "", series, names))
    return conditions, repeats


def offers_of(names: Sequence[str]) -> Iterator[str]:
    """Yield tips about numbers that follow a single letter in all names and that may be levels,
    because they are not consecutive, for example `P100` and `P200`.
    """
    for series in _series_of(names):
        word = series.first.word
        if len(word) != 1 or not series.is_complete or series.first.unit or series.is_count:
            continue
        label = read_label(word)
        quantity = "pressure" if label is None or label.quantity == "time" else label.quantity
        levels = " ".join(f"{word}{value:g}" for value in series.values[:4])
        yield (
            f"the names of the files have {levels} ..., which are not used; if they are levels of "
            "a quantity, name it, for example with "
            f"`--hold {quantity}={word}:{default_unit(quantity)}`"
        )


def _series_of(names: Sequence[str]) -> list[Series]:
    """Return the series of numbers that have the same word and unit. If each name has several such
    numbers, the first number of each name belongs to one series, the second number to another.

    Numbers that are equal in all names are left out.
    """
    numbers_of_series: dict[tuple[str, str, int], dict[int, NameNumber]] = {}
    for place, name in enumerate(names):
        seen: Counter[tuple[str, str]] = Counter()
        for number in numbers_in(name):
            kind = (number.word.casefold(), number.unit)
            numbers_of_series.setdefault((*kind, seen[kind]), {})[place] = number
            seen[kind] += 1
    every = [Series(numbers, len(numbers) == len(names)) for numbers in numbers_of_series.values()]
    return [series for series in every if len(series.values) > 1 or not series.is_complete]


def _condition(quantity: str, unit: str, series: Series, names: Sequence[str]) -> NamedCondition:
    """Return a quantity whose values are the numbers in the names of files. If a name contains no
    number, its value is zero.
    """
    unit = UNITS[series.first.unit][1] if series.first.unit else unit
    numbers = series.numbers
    values = tuple(numbers[at].value if at in numbers else 0.0 for at in range(len(names)))
    zero = next((name for at, name in enumerate(names) if at not in numbers), None)
    why = f"{quantity} {' '.join(f'{value:g}' for value in sorted({*values}))} {unit}"
    why += f" (0 for {zero!r}, which has no number)" if zero is not None else ""
    return NamedCondition(quantity, unit, values, why, sure=zero is None)


def _asked_for(hold: Hold, every: Sequence[Series]) -> Series:
    """Return the numbers in the names of files that the option `--hold` asks for. Raises
    UsageError, which lists the numbers of the names, if no number fits the option.
    """
    for series in every:
        if _is_named_by(hold, series.first):
            return series
    listed = ", ".join(dict.fromkeys(series.first.shown for series in every))
    raise UsageError(
        f"--hold: no column is called {hold.name}, and no number in the names of files belongs "
        f"to {hold.name}",
        f"the names of the files contain {listed or 'no number that varies'}; write `--hold "
        f"{hold.name}=WORD:UNIT` with the word before the number that you mean, or `--hold "
        "none` if nothing was held constant",
    )


def _is_named_by(hold: Hold, number: NameNumber) -> bool:
    """Return True if the option `--hold` means this number: the option gives the word beside
    the number, the quantity of the number, or a unit to which the unit of the number can be
    converted.
    """
    word, name = number.word.casefold(), hold.name.casefold()
    if hold.word:
        return word.endswith(hold.word.casefold())
    is_word = min(len(word), len(name)) > 1 and (name.startswith(word) or word.startswith(name))
    has_unit = hold.unit and number.unit and can_convert(UNITS[number.unit][1], hold.unit)
    return number.quantity == hold.name or is_word or bool(has_unit)
