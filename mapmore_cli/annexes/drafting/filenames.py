"""What names of files, folders and sheets tell: which studies there are, and what was held."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.checking.names import read_label
from mapmore_cli.spec.units import convert, default_unit
from mapmore_cli.storage.readers import suffix_of

_HELD_IN = {
    **dict.fromkeys(("bar", "kPa", "psi", "mbar", "MPa", "Pa"), "pressure"),
    **dict.fromkeys(("pct", "percent", "%"), "strain"),
    **dict.fromkeys(("mm", "cm"), "displacement"),
    **dict.fromkeys(("kg", "kilograms?", "grams?", "g"), "load"),
}
"""The quantity that a number in this unit tells."""

UNIT = rf"({'|'.join(_HELD_IN)})(?![a-z])"
"""A unit behind a number in names that tell what was held."""

_SPELT = {"pct": "%", "percent": "%", "%": "%", "k": "kgf", "g": "gf"}
_SPELT |= {unit.casefold(): unit for unit, of in _HELD_IN.items() if of in ("pressure",)}
_NUMBER = re.compile(rf"(\d+(?:[.,]\d+)?)\s*(?:{UNIT}|(?![a-z0-9]))", re.IGNORECASE)
_REPEAT = re.compile(r"(?:test|run|rep|repeat|trial|take|try|no|nr|cycle)?\d{1,2}", re.IGNORECASE)
_SPECIMEN = re.compile(
    r"(?:specimens?|samples?|muscles?|actuators?|prototypes?|devices?|units?|dut|pam|s)[-#.]*",
    re.IGNORECASE,
)
_OF_SPECIMEN = re.compile(r"\d{1,3}|[A-Za-z]")
_APART = re.compile(
    rf"{_SPECIMEN.pattern}(?:{_OF_SPECIMEN.pattern})|\d+(?:[.,]\d+)?(?:mm|cm|m|in)|\D+",
    re.IGNORECASE,
)
"""One specimen, a size, or a word without a number: what tells studies apart."""
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
    """Return the words of a file's name without its suffixes; `10 psi` is one word."""
    stem = name[:-3] if name.casefold().endswith(".gz") else name
    stem = stem[: len(stem) - len(suffix_of(Path(name)))]
    stem = re.sub(rf"(?<=\d)\s+(?={UNIT})", "", stem, flags=re.IGNORECASE)
    return [word for word in re.split(r"[_\s/]+", stem) if word]


def read_names(names: Sequence[str]) -> list[NameParts]:
    """Compare names word by word; where they have different numbers of words they say nothing.

    Among the words that vary, specimens (`S1`, `muscleA`, `Sample 2`), sizes (`10cm`) and words
    without numbers tell groups apart, and `Test8` is a repeat. Of the others that have a number
    the last one is the condition; one with a unit comes first.
    """
    split = [words_of(name) for name in names]
    if len({len(one) for one in split}) != 1:
        return [NameParts() for _ in names]
    places = list(enumerate(zip(*split, strict=True)))
    groups = [place for place, column in places if _tells_apart(column, split[0][:place])]
    numbered = [
        (all((number_in(word) or (0.0, None))[1] for word in column), place)
        for place, column in places
        if len(set(column)) > 1
        and place not in groups
        and any(map(number_in, column))
        and not all(map(_REPEAT.fullmatch, column))
    ]
    held = max(numbered)[1] if numbered else None
    return [
        NameParts(tuple(one[place] for place in groups), None if held is None else one[held])
        for one in split
    ]


def _tells_apart(column: Sequence[str], before: Sequence[str]) -> bool:
    """Return True for words at one place of all names, behind those before it in the first one."""
    if len(set(column)) == 1 or all(
        _TRAINS.fullmatch(one) or _TESTS.fullmatch(one) for one in column
    ):
        return False
    of_specimen = bool(before) and _SPECIMEN.fullmatch(before[-1]) is not None
    return all(map(_APART.fullmatch, column)) or (
        of_specimen and all(map(_OF_SPECIMEN.fullmatch, column))
    )


def number_in(word: str) -> tuple[float, str | None] | None:
    """Return the number of a word with its unit of pressure, length or mass, or `%`: (25, None) of
    `kinked25`, (19, "mm") of `kinked19mm2`.
    """
    match = _NUMBER.search(word)
    if match is None:
        return None
    unit = match[2] and match[2].casefold()
    known = unit and (_SPELT.get(unit) or _SPELT.get(unit[0], unit))
    return float(match[1].replace(",", ".")), known


def tests_of(files: Sequence[Path]) -> list[str]:
    """Return the names of files that say `test` or `validation`, where all others say `train`."""
    tests, trains = (
        {file for file in files if any(map(said.fullmatch, words_of(file.name)))}
        for said in (_TESTS, _TRAINS)
    )
    divided = tests and trains and not tests & trains and len(tests) + len(trains) == len(files)
    return [file.name for file in files if divided and file in tests]


@dataclass(frozen=True, order=True)
class Told:
    """What a name says about the held quantity, in the model's unit, and how."""

    value: float = 0.0
    why: str = ""


def held_in_names(
    conditions: Sequence[str | None], hold: tuple[str, str] | None
) -> tuple[str, list[Told]] | None:
    """Return the held quantity by the names of files or sheets, and its value for each; None where
    they say nothing.

    A unit tells the quantity: millimetres are a contraction, but `L=180mm` is a length; a mass is
    a load. Numbers without a unit are `hold`, the quantity and the unit that a person names. A name
    without a number stands for zero.
    """
    told = {word: number_in(word) for word in conditions if word is not None}
    numbers = [number for number in told.values() if number is not None]
    units = {unit for _, unit in numbers}
    if None in conditions or len(told) < 2 or not numbers or (None in units and hold is None):
        return None
    kinds = {_quantity_of(word, number[1], hold) for word, number in told.items() if number}
    if len(kinds) != 1:
        return None
    (quantity,) = kinds
    usual = hold[1] if hold and hold[0] == quantity and hold[1] else default_unit(quantity)
    return quantity, [_told_by(str(word), told[str(word)], quantity, usual) for word in conditions]


def _quantity_of(word: str, unit: str | None, hold: tuple[str, str] | None) -> str:
    label = read_label(word)
    if unit in ("mm", "cm") and label is not None and label.quantity == "length":
        return "length"
    if unit is None and hold is not None:
        return hold[0]
    return "load" if unit in ("kgf", "gf") else _HELD_IN[str(unit)]


def _told_by(word: str, number: tuple[float, str | None] | None, quantity: str, usual: str) -> Told:
    if number is None:
        return Told(0.0, f"'{word}' has no number: taken as {quantity} 0")
    value, unit = number[0], number[1] or usual
    shown = f"{value:g}{'' if unit == '1' else f' {unit}'}"
    why = f"'{word}' taken as {quantity} {shown}: say what was measured"
    return Told(float(f"{convert(value, unit, default_unit(quantity)):.12g}"), why)
