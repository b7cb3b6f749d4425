"""What names say: titles of columns, and words in names of files, folders and sheets."""

from __future__ import annotations

import re
from dataclasses import dataclass

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
_COMMANDS = {
    *("cmd", "command", "setpoint", "set", "desired", "demand", "reference", "ref"),
    *("simulated", "simulation", "sim"),
}


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
    # camel case, and `pL` of a pair; kPa and MPa stay whole
    apart = re.sub(r"(?<=[a-z]{3})(?=[A-Z])|(?<=\bp)(?=[LRAB]\b)", " ", name)
    parts = words(apart)
    named = [place for place, word in enumerate(parts) if word in _OF_WORD]
    named = [place for place in named if not place or parts[place] != "v"]  # volts of `y_V`
    quantity = "input" if _COMMANDS & {*parts} else _OF_WORD[parts[named[0]]] if named else None
    if quantity is None:
        unit = next(
            (_PRESSURES[word] for word in parts if word in _PRESSURES and len(word) > 2), None
        )
        return ColumnTitle("pressure", unit, plain=False) if unit else None
    behind = parts[named[0] + 1 :] if named else []
    unit = next((_UNITS[quantity][word] for word in behind if word in _UNITS[quantity]), None)
    return ColumnTitle(quantity, unit or None, plain=len(parts) == 1 + (unit is not None))


def unit_in(quantity: str, text: str) -> str | None:
    """Return the unit of a quantity that a text holds, as `[kN]` under a column's name; None for
    none.
    """
    units = _UNITS.get(quantity, {})
    return next((units[word] or None for word in words(text) if word in units), None)


def words(text: str) -> list[str]:
    """Return the words and numbers of a text in small letters; `%` is one."""
    return [word.casefold() for word in re.findall(r"%|[^\W\d_]+|\d+", text)]
