"""What names say: titles of columns, and words in names of files, folders and sheets."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.storage.readers import suffix_of

POSITIONS = ("strain", "displacement", "length")
"""Quantities that say how far a muscle has contracted, the most telling first."""

_WORDS = {
    "time": ("t", "time", "times", "timestamp", "seconds", "elapsed", "zeit", "clock", "tout"),
    "pressure": ("p", "press", "pressure", "druck", "pression", "gauge"),
    "strain": ("eps", "epsilon", "e", "strain", "contraction", "dehnung", "kontraktion", "ε"),
    "force": ("f", "force", "kraft", "tension", "pull", "loadcell"),
    "displacement": (
        "d",
        "x",
        "disp",
        "displacement",
        "position",
        "pos",
        "stroke",
        "extension",
        "elongation",
        "travel",
        "weg",
    ),
    "length": ("l", "len", "length"),
    "load": ("load", "weight", "mass"),
    "input": (
        "u",
        "v",
        "input",
        "voltage",
        "valve",
        "duty",
        "pwm",
        "dac",
        "regulator",
        "solenoid",
        "pump",
    ),
}
_OF_WORD = {word: quantity for quantity, words in _WORDS.items() for word in words}
_COMMANDS = {"cmd", "command", "setpoint", "set", "desired", "demand", "reference", "ref"}


def _spelt(units: str, **others: str) -> dict[str, str]:
    return {unit.casefold(): unit for unit in units.split()} | others


_PRESSURES, _LENGTHS = _spelt("Pa hPa kPa MPa bar mbar psi mmHg"), _spelt("um mm cm m in")
_FORCES = _spelt("N kN mN lbf kgf gf", lbs="lbf", kg="kgf", g="gf")
_PARTS = {"pct": "%", "percent": "%", "perc": "%", "%": "%"}
_UNITS = {
    "time": _spelt("s ms us ns min h", sec="s", secs="s", seconds="s", msec="ms"),
    "pressure": _PRESSURES,
    "strain": _PARTS | dict.fromkeys(("frac", "fraction", "ratio", "1"), "1"),
    "force": _FORCES,
    "displacement": _LENGTHS,
    "length": _LENGTHS,
    "load": _FORCES,
    "input": _spelt("V mV") | dict.fromkeys(_PRESSURES, ""),
}
"""Units of quantities by how they are written, in small letters."""


@dataclass(frozen=True)
class ColumnTitle:
    """A column's name, read: the `quantity` it names, and its `unit` where the name has one.

    `plain` is True where nothing else stands in the name: `force_N` is plainer than
    `force_N_total`.
    """

    quantity: str
    unit: str | None
    plain: bool


def read_label(name: str) -> ColumnTitle | None:
    """Return what a column's name says: `pressure_kPa` and `P [kPa]` are pressures in kPa; None for
    a name that says nothing.

    The first word that names a quantity decides, and a unit is looked for behind it; without such a
    word, a unit of pressure does.
    """
    apart = re.sub(
        r"(?<=[a-z]{3})(?=[A-Z])|(?<=\bp)(?=[LRAB]\b)", " ", name
    )  # camel case, and `pL` of a pair; kPa and MPa stay whole
    words = _words(apart)
    place = next((i for i, word in enumerate(words) if word in _OF_WORD), None)
    commanded = bool(_COMMANDS & {*words})
    if place is None and not commanded:
        unit = next(
            (_PRESSURES[word] for word in words if word in _PRESSURES and len(word) > 2), None
        )
        return ColumnTitle("pressure", unit, plain=False) if unit else None
    if place is None:
        return ColumnTitle("input", None, plain=len(words) == 1)
    quantity = "input" if commanded else _OF_WORD[words[place]]
    units = [_UNITS[quantity][word] for word in words[place + 1 :] if word in _UNITS[quantity]]
    return ColumnTitle(
        quantity, (units[0] or None) if units else None, plain=len(words) == 1 + bool(units)
    )


def unit_in(quantity: str, text: str) -> str | None:
    """Return the unit of a quantity that a text holds, as `[kN]` under a column's name; None for
    none.
    """
    units = _UNITS.get(quantity, {})
    return next((units[word] or None for word in _words(text) if word in units), None)


def _words(text: str) -> list[str]:
    return [word.casefold() for word in re.findall(r"%|[^\W\d_]+|\d+", text)]


# Names of files
# --------------------------------------------------------------------------------------------------

PRESSURES_IN_NAMES = ("bar", "kPa", "psi", "mbar", "MPa", "Pa")
UNIT = rf"({'|'.join(PRESSURES_IN_NAMES)}|pct|percent|%|mm|cm)(?![a-z])"
"""A unit of pressure, strain or length, behind a number in names that tell what was held."""

_REPEAT = re.compile(r"(?:test|run|rep|repeat|trial|take|try|no|nr|cycle)?\d{1,2}", re.IGNORECASE)
_REPEAT_WORD = re.compile(r"test|run|rep|repeat|trial|take|try|no|nr", re.IGNORECASE)
_SPECIMEN = re.compile(
    r"(?:specimens?|samples?|muscles?|actuators?|prototypes?|devices?|units?|dut|pam|s)[-#.]*",
    re.IGNORECASE,
)
_OF_SPECIMEN = re.compile(r"\d{1,3}|[A-Za-z]", re.IGNORECASE)
_ONE_SPECIMEN = re.compile(f"{_SPECIMEN.pattern}(?:{_OF_SPECIMEN.pattern})", re.IGNORECASE)
_SIZE = re.compile(r"\d+(?:[.,]\d+)?(?:mm|cm|m|in)", re.IGNORECASE)
_NUMBER = re.compile(rf"(\d+(?:[.,]\d+)?)\s*(?:{UNIT}|(?![a-z0-9]))", re.IGNORECASE)
_MASS = re.compile(r"(\d+(?:[.,]\d+)?)[\s_-]*(kg|g|grams?|kilograms?)(?![a-z])", re.IGNORECASE)
_TRAINS = re.compile(r"train|training|estimation|identification", re.IGNORECASE)
_TESTS = re.compile(r"test|testing|val|valid|validation", re.IGNORECASE)


@dataclass(frozen=True)
class NameParts:
    """What one name says among the others.

    `group` holds the words that tell studies apart (sizes of a muscle, kinds), `condition` the one
    that may say what was held.
    """

    group: tuple[str, ...] = ()
    condition: str | None = None


def words_of(name: str) -> list[str]:
    """Return the words of a file's name, without its suffixes, after those of the folder before it;
    `10 psi` is one word.
    """
    stem = name[:-3] if name.casefold().endswith(".gz") else name
    stem = stem[: len(stem) - len(suffix_of(Path(name)))]
    stem = re.sub(rf"(?<=\d)\s+(?={UNIT})", "", stem, flags=re.IGNORECASE)
    return [word for word in re.split(r"[_\s/]+", stem) if word]


def read_names(names: Sequence[str]) -> list[NameParts]:
    """Compare names word by word; where they have different numbers of words they say nothing.

    Among the words that vary, specimens (`S1`, `muscleA`, `Sample 2`), sizes (`10cm`) and words
    without numbers tell groups apart, `Test8` is a repeat, and the last one of the others that some
    of the names have a number in is the condition; one with a unit comes first.
    """
    split = [words_of(name) for name in names]
    if len({len(words) for words in split}) != 1:
        return [NameParts() for _ in names]
    kinds = [
        _kind(column, split[0][:place]) for place, column in enumerate(zip(*split, strict=True))
    ]
    numbered = [place for place, kind in enumerate(kinds) if kind == "condition"]
    united = [
        place
        for place in numbered
        if all((number_in(words[place]) or (0.0, None))[1] for words in split)
    ]
    held = (united or numbered)[-1] if numbered else None
    return [
        NameParts(
            tuple(word for word, kind in zip(words, kinds, strict=True) if kind == "group"),
            None if held is None else words[held],
        )
        for words in split
    ]


def _kind(column: Sequence[str], before: Sequence[str]) -> str:
    """Return what words at one place of all names are, given the words before it in the first
    one.
    """

    def all_match(*patterns: re.Pattern[str]) -> bool:
        return all(any(pattern.fullmatch(word) for pattern in patterns) for word in column)

    last = before[-1] if before else ""
    if len(set(column)) == 1:
        return "constant"
    if all_match(_TRAINS, _TESTS):
        return "repeat"
    if all_match(_REPEAT) and (
        _REPEAT_WORD.fullmatch(last) or not any(word.isdigit() for word in column)
    ):
        return "repeat"
    if (
        all_match(_SIZE)
        or all_match(_ONE_SPECIMEN)
        or (_SPECIMEN.fullmatch(last) and all_match(_OF_SPECIMEN))
    ):
        return "group"
    return "condition" if any(map(number_in, column)) else "group"


def number_in(word: str) -> tuple[float, str | None] | None:
    """Return the number of a word with its unit of pressure or length, or `%`: (25, None) of
    `kinked25`, (19, "mm") of `kinked19mm2`.
    """
    found = _NUMBER.search(word)
    return found and (
        _number(found[1]),
        (_PRESSURES | _PARTS | _LENGTHS)[found[2].casefold()] if found[2] else None,
    )


def mass_in(name: str) -> tuple[float, str] | None:
    """Return the mass in kg that a name tells, and its text, as `200 grams`; None for none."""
    found = _MASS.search(name)
    return found and (
        _number(found[1]) * (1.0 if found[2].casefold().startswith("k") else 1e-3),
        found[0],
    )


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def tests_of(files: Sequence[Path]) -> list[Path]:
    """Return the files whose names say `test` or `validation`, where all others say `train`; else
    none.
    """
    tests, trains = (
        {file for file in files if any(map(said.fullmatch, words_of(file.name)))}
        for said in (_TESTS, _TRAINS)
    )
    divided = tests and trains and not tests & trains and len(tests) + len(trains) == len(files)
    return [file for file in files if divided and file in tests]
