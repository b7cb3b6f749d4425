"""Read the numbers in the name of a file, a folder or a sheet, with the unit or the word beside
each number.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from mapmore_cli.checking.names import read_label
from mapmore_cli.study.units import unit_of

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
UNITS = {
    word.casefold(): (quantity, str(unit_of(word, like)))
    for quantity, (like, words_of_units) in _WRITTEN.items()
    for word in words_of_units.split()
}
# a unit of length or `%` does not identify the quantity, so the word beside the number is used
BY_WORD = ("length", "percent")
RUNS = (
    "test|run|rep|repeat|trial|take|try|no|nr|num|cycle|loop|log|file|data|set|exp|experiment|part"
    "|rec|record|recording|meas|measurement|messung|versuch|v|version|sheet|step|id|trace"
)
_SPECIMENS = "sample|specimen|muscle|actuator|prototype|device|unit|dut|pam|session|day|[a-z]"
_REPEATS = re.compile(f"{RUNS}|{_SPECIMENS}", re.IGNORECASE)
"""Pattern of words and single letters whose number counts recordings or specimens."""
NUMBER = re.compile(
    rf"(?:(?P<word>[^\W\d_]+)(?P<sign>[\s_=:.-]*?))?(?<![\d.])(?P<number>\d+(?:[.,]\d+)?)"
    rf"(?:[\s_]?(?P<unit>{'|'.join(sorted(map(re.escape, UNITS), key=len, reverse=True))})"
    rf"(?![^\W\d_]))?",
    re.IGNORECASE,
)
_CAMEL = re.compile(r".*[^\W\d_A-Z](?=[A-Z])")


class NameNumber(NamedTuple):
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
        by_unit = UNITS[self.unit][0] if self.unit else ""
        if label is not None and label.quantity not in ("input", "time") and len(self.word) > 1:
            return label.quantity
        if by_unit and by_unit not in BY_WORD:
            return by_unit
        if self.is_set and label is not None:
            return label.quantity
        word = re.sub(r"\W", "", self.word, flags=re.ASCII)
        return word if word and not _REPEATS.fullmatch(word) else by_unit

    @property
    def shown(self) -> str:
        """The number as it is written in the name, with its word and its unit."""
        return f"{self.word}{' ' if self.word else ''}{self.value:g}{self.unit}"


def is_repeat(word: str) -> bool:
    """Return True for a word of several letters, for example `run` or `sample`, whose number counts
    recordings or specimens.
    """
    return len(word) > 1 and _REPEATS.fullmatch(word) is not None


def numbers_in(name: str) -> list[NameNumber]:
    """Return the numbers of a name, in order."""
    return [
        NameNumber(
            _CAMEL.sub("", match["word"] or ""),
            (match["unit"] or "").casefold(),
            float(match["number"].replace(",", ".")),
            "=" in (match["sign"] or ""),
        )
        for match in NUMBER.finditer(name)
    ]
