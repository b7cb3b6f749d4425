"""What the name of a column says: which quantity it holds, in which unit."""

from __future__ import annotations

import re
from dataclasses import dataclass

_WORDS = {
    "time": ("t", "time", "times", "timestamp", "seconds", "elapsed", "zeit", "clock"),
    "pressure": ("p", "press", "pressure", "druck", "pression", "gauge"),
    "strain": ("eps", "epsilon", "e", "strain", "contraction", "dehnung", "kontraktion", "ε"),
    "force": ("f", "force", "kraft", "tension", "pull", "loadcell"),
    "displacement": ("d", "x", "disp", "displacement", "position", "pos", "stroke", "extension", "weg"),
    "length": ("l", "len", "length"),
    "load": ("load", "weight", "mass"),
    "input": ("u", "v", "input", "command", "cmd", "voltage", "setpoint"),
}
_UNITS = {
    "time": {"s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "us": "us", "min": "min", "h": "h"},
    "pressure": {"pa": "Pa", "hpa": "hPa", "kpa": "kPa", "mpa": "MPa", "bar": "bar", "mbar": "mbar", "psi": "psi", "mmhg": "mmHg"},
    "strain": {"pct": "%", "percent": "%", "perc": "%", "%": "%", "frac": "1", "fraction": "1", "ratio": "1", "1": "1"},
    "force": {"n": "N", "kn": "kN", "mn": "mN", "lbf": "lbf", "kgf": "kgf"},
    "displacement": {"um": "um", "mm": "mm", "cm": "cm", "m": "m", "in": "in"},
    "length": {"um": "um", "mm": "mm", "cm": "cm", "m": "m", "in": "in"},
    "load": {"n": "N", "kn": "kN", "lbf": "lbf", "kgf": "kgf"},
    "input": {"v": "V", "mv": "mV", **dict.fromkeys(("pa", "kpa", "bar", "psi"), "")},
}
_OF_WORD = {word: quantity for quantity, words in _WORDS.items() for word in words}
_ONLY_PRESSURE = {unit for unit in _UNITS["pressure"] if len(unit) > 2}


@dataclass(frozen=True)
class ColumnTitle:
    """A column's name, read: the `quantity` it names, and its `unit` where the name has one.

    `plain` is True where nothing else stands in the name: `force_N` is plainer than `force_N_total`.
    """

    quantity: str
    unit: str | None
    plain: bool


def read_label(name: str) -> ColumnTitle | None:
    """What a column's name says: `pressure_kPa` and `P [kPa]` are pressures in kPa; None for a name that says nothing.

    The first word that names a quantity decides, and a unit is looked for behind it; without such a word, a unit of pressure does.
    """
    words = [word.casefold() for word in re.findall(r"%|[^\W\d_]+|\d+", _apart(name))]
    place = next((i for i, word in enumerate(words) if word in _OF_WORD), None)
    if place is None:
        unit = next((word for word in words if word in _ONLY_PRESSURE), None)
        return ColumnTitle("pressure", _UNITS["pressure"][unit], plain=False) if unit else None
    quantity = "input" if {"cmd", "command", "setpoint"} & set(words) else _OF_WORD[words[place]]
    units = _UNITS[quantity]
    found = [i for i in range(place + 1, len(words)) if words[i] in units]
    unit = units[words[found[0]]] if found else None
    return ColumnTitle(quantity, unit or None, plain=len(words) == 1 + bool(found))


def unit_in(quantity: str, text: str) -> str | None:
    """The unit of a quantity that a text holds, as `[kN]` under a column's name; None for none."""
    words = [word.casefold() for word in re.findall(r"%|[^\W\d_]+|\d+", text)]
    return next((_UNITS[quantity][word] or None for word in words if word in _UNITS.get(quantity, {})), None)


def _apart(name: str) -> str:
    """The name with its camel-case words apart; units as kPa and MPa stay whole."""
    return re.sub(r"(?<=[a-z]{3})(?=[A-Z])", " ", name)
