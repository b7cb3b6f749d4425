"""Find numbers in names of files, folders and sheets, with the unit or the word beside them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mapmore_cli.annexes.drafting.answers import Hold
from mapmore_cli.annexes.drafting.spelling import words
from mapmore_cli.checking.names import read_label
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.storage.readers import suffix_of
from mapmore_cli.storage.tables.lines import name_of_packed
from mapmore_cli.study.units import CANONICAL, can_convert, convert, default_unit, unit_of

_WRITTEN = {
    "pressure": ("kPa", "Pa hPa kPa MPa bar mbar psi psig barg"),
    "load": ("N", "g gram grams kg kilograms"),
    "temperature": ("degC", "degC °C"),
    "voltage": ("V", "V mV"),
    "current": ("A", "mA"),
    "frequency": ("Hz", "Hz"),
    "length": ("m", "mm cm um"),
    "percent": ("%", "% pct percent"),
}
"""For each quantity, one of its units, and all units that are recognised in names of files."""
_UNITS = {
    word.casefold(): (quantity, str(unit_of(word, like)))
    for quantity, (like, words_of_units) in _WRITTEN.items()
    for word in words_of_units.split()
}
# quantities for which the word beside a number in a name says more than the unit
_BY_WORD = ("length", "percent")
_RUNS = (
    "test|run|rep|repeat|trial|take|try|no|nr|num|cycle|loop|log|file|data|set|exp|experiment|part"
    "|rec|record|recording|meas|measurement|messung|versuch|v|version|sheet|step|id|trace"
)
_SPECIMENS = "sample|specimen|muscle|actuator|prototype|device|unit|dut|pam|session|day|[a-z]"
_REPEATS = re.compile(f"{_RUNS}|{_SPECIMENS}", re.IGNORECASE)
"""Pattern of words and single letters whose number counts recordings or specimens."""
_NUMBER = re.compile(
    rf"(?:(?P<word>[^\W\d_]+)(?P<sign>[\s_=:.-]*?))?(?<![\d.])(?P<number>\d+(?:[.,]\d+)?)"
    rf"(?:[\s_]?(?P<unit>{'|'.join(sorted(map(re.escape, _UNITS), key=len, reverse=True))})"
    rf"(?![^\W\d_]))?",
    re.IGNORECASE,
)
_CAMEL = re.compile(r".*[^\W\d_A-Z](?=[A-Z])")
_TRAINS = {"train", "training", "estimation", "identification"}
_TESTS = {"test", "testing", "val", "valid", "validation"}


class Number(NamedTuple):
    """A number in the name of a file, the word before the number, and its unit. The word and the
    unit are empty texts if the name has no such word or unit.

    `is_set` is True if an equals sign stands before the number.
    """

    word: str
    unit: str
    value: float
    is_set: bool = False

    @property
    def quantity(self) -> str:
        """Quantity of the number: from the word beside it if the word names a quantity, otherwise
        from the unit.
        """
        label = read_label(self.word)
        by_unit = _UNITS[self.unit][0] if self.unit else ""
        if label is not None and label.quantity not in ("input", "time") and len(self.word) > 1:
            return label.quantity
        if by_unit and by_unit not in _BY_WORD:
            return by_unit
        if self.is_set and label is not None:
            return label.quantity
        word = re.sub(r"\W", "", self.word, flags=re.ASCII)
        return word if len(word) > 1 and not _REPEATS.fullmatch(word) else by_unit

    @property
    def shown(self) -> str:
        """The number as it is written in the name, with its word and its unit."""
        return f"{self.word}{' ' if self.word else ''}{self.value:g}{self.unit}"


Series = dict[int, Number]
"""Numbers with the same word and unit, by the index of their names."""


@dataclass(frozen=True)
class Condition:
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
        """The values in the unit of the model."""
        unit = CANONICAL.get(self.quantity, self.unit)
        written = self.unit or unit
        return [
            float(f"{convert(value, written, unit):.12g}") if unit else value
            for value in self.values
        ]


def is_repeat(word: str) -> bool:
    """Return True for a word of several letters that stands beside a count of recordings or
    specimens.
    """
    return len(word) > 1 and _REPEATS.fullmatch(word) is not None


def stem_of(name: str) -> str:
    """Return the name of a file with its folders, without the suffixes of its format."""
    stem = name_of_packed(name)
    return stem[: len(stem) - len(suffix_of(Path(name)))]


def numbers_in(name: str) -> list[Number]:
    """Return the numbers of a name, in order."""
    return [
        Number(
            _CAMEL.sub("", match["word"] or ""),
            (match["unit"] or "").casefold(),
            float(match["number"].replace(",", ".")),
            "=" in (match["sign"] or ""),
        )
        for match in _NUMBER.finditer(name)
    ]


def told_by_names(
    names: Sequence[str], hold: Hold | None = None, known: Sequence[str] = ()
) -> tuple[list[Condition], list[str]]:
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
    conditions: list[Condition] = []
    repeats: list[str] = []
    for numbers in every:
        first = next(iter(numbers.values()))
        if numbers is asked and hold is not None:
            conditions.append(_told_quantity(hold.name, hold.unit, numbers, names))
        elif first.quantity in named or len(_values(numbers)) == 1:
            continue
        elif len(numbers) < len(names) or not first.quantity or _is_count(numbers):
            repeats.append(f"{first.shown} ...")
        else:
            named.add(first.quantity)
            conditions.append(_told_quantity(first.quantity, "", numbers, names))
    return conditions, repeats


def offers_of(names: Sequence[str]) -> Iterator[str]:
    """Yield tips about numbers that follow a single letter in all names and that may be levels,
    because they are not consecutive, for example `P100` and `P200`.
    """
    for numbers in _series_of(names):
        first = next(iter(numbers.values()))
        if len(first.word) != 1 or len(numbers) < len(names) or first.unit or _is_count(numbers):
            continue
        label = read_label(first.word)
        quantity = "pressure" if label is None or label.quantity == "time" else label.quantity
        unit = default_unit(quantity)
        levels = " ".join(f"{first.word}{value:g}" for value in _values(numbers)[:4])
        yield (
            f"the names of the files have {levels} ..., which are not used; if they are levels of "
            f"a quantity, name it, for example with `--hold {quantity}={first.word}:{unit}`"
        )


def _values(numbers: Series) -> list[float]:
    return sorted({one.value for one in numbers.values()})


def _is_count(numbers: Series) -> bool:
    """Return True for consecutive whole numbers without a unit."""
    values = _values(numbers)
    has_unit = any(one.unit for one in numbers.values())
    return not has_unit and values == [values[0] + place for place in range(len(values))]


def _series_of(names: Sequence[str]) -> list[Series]:
    """Return the series of numbers that have the same word and unit, each by the index of the name
    that contains the number. If each name has several such numbers, the first number of each name
    belongs to one series, the second number to another.

    Numbers that are equal in all names are left out.
    """
    series: dict[tuple[str, str, int], Series] = {}
    for place, name in enumerate(names):
        seen: Counter[tuple[str, str]] = Counter()
        for number in numbers_in(name):
            kind = (number.word.casefold(), number.unit)
            series.setdefault((*kind, seen[kind]), {})[place] = number
            seen[kind] += 1
    return [
        numbers
        for numbers in series.values()
        if len(_values(numbers)) > 1 or len(numbers) < len(names)
    ]


def _told_quantity(quantity: str, unit: str, numbers: Series, names: Sequence[str]) -> Condition:
    """Return a quantity whose values are the `numbers` in the names of files. A name without a
    number gives the value zero.
    """
    written = next(iter(numbers.values())).unit
    unit = _UNITS[written][1] if written else unit
    values = tuple(numbers[place].value if place in numbers else 0.0 for place in range(len(names)))
    zero = next((name for place, name in enumerate(names) if place not in numbers), None)
    why = f"{quantity} {' '.join(f'{value:g}' for value in sorted({*values}))} {unit}"
    why += f" (0 for {zero!r}, which has no number)" if zero is not None else ""
    return Condition(quantity, unit, values, why, sure=zero is None)


def _asked_for(hold: Hold, series: Sequence[Series]) -> Series:
    """Return the numbers in the names of files that the option `--hold` asks for. Raises
    UsageError, which lists the numbers of the names, if no number fits the option.
    """
    asked = next(
        (numbers for numbers in series if _is_named_by(hold, next(iter(numbers.values())))), None
    )
    if asked is None:
        listed = ", ".join(dict.fromkeys(next(iter(numbers.values())).shown for numbers in series))
        raise UsageError(
            f"--hold: no column is called {hold.name}, and no number in the names of files belongs "
            f"to {hold.name}",
            f"the names of the files contain {listed or 'no number that varies'}; write `--hold "
            f"{hold.name}=WORD:UNIT` with the word before the number that you mean, or `--hold "
            "none` if nothing was held constant",
        )
    return asked


def _is_named_by(hold: Hold, number: Number) -> bool:
    """Return True if the option `--hold` means this number: the option gives the word beside
    the number, the quantity of the number, or a unit to which the unit of the number can be
    converted.
    """
    word, name = number.word.casefold(), hold.name.casefold()
    if hold.word:
        return word.endswith(hold.word.casefold())
    is_word = min(len(word), len(name)) > 1 and (name.startswith(word) or word.startswith(name))
    has_unit = hold.unit and number.unit and can_convert(_UNITS[number.unit][1], hold.unit)
    return number.quantity == hold.name or is_word or bool(has_unit)


def numbered_groups(names: Sequence[str], group: str) -> Condition:
    """Return a quantity whose value for each file is the number of its group. The group is found
    in the name of the file.
    """
    groups = group_words(names, group)
    apart = sorted({*groups})
    values = tuple(apart.index(word) + 1.0 for word in groups)
    return Condition(group, "", values, f"{group} 1 is {apart[0]!r}, and so on")


def group_words(names: Sequence[str], group: str) -> list[str]:
    """Return the text of each name that distinguishes groups: the number or letter after the word
    `group`, or the number after its first letter, such as `s1` for a sample. Without such a number
    or letter, the text is the words of the name, including specimens and sizes such as `10cm`, but
    without other numbers. In a name without words, the text is the whole name.
    """
    behind = re.compile(
        rf"{re.escape(group)}\w*?[\s_#=.-]*(\d+|[A-Za-z])(?![^\W\d_])", re.IGNORECASE
    )
    letter = re.compile(rf"(?<![^\W\d_]){re.escape(group[0])}(\d+)", re.IGNORECASE)
    marks, letters = (
        [match[1] if (match := way.search(name)) else "" for name in names]
        for way in (behind, letter)
    )
    bare = [_NUMBER.sub(_without_number, name) for name in names]
    ways = (texts for texts in (marks, letters, bare) if all(texts) and len(set(texts)) > 1)
    return next(ways, list(names))


def _without_number(match: re.Match[str]) -> str:
    """Return the text that replaces a word and its number in a name: the word alone, or an empty
    text if the number counts repeats. A specimen or a size stays unchanged.
    """
    word, unit = match["word"] or "", (match["unit"] or "").casefold()
    if unit:
        return match[0] if _UNITS[unit][0] in _BY_WORD else word
    return "" if not word or re.fullmatch(_RUNS, word, re.IGNORECASE) else match[0]


def tests_of(files: Sequence[Path]) -> list[str]:
    """Return the names of files that contain `test` or `validation`, if all others contain
    `train`.
    """
    tests, trains = (
        {file for file in files if marks & {*words(file.stem)}} for marks in (_TESTS, _TRAINS)
    )
    divided = tests and trains and not tests & trains and len(tests) + len(trains) == len(files)
    return [file.name for file in files if divided and file in tests]
