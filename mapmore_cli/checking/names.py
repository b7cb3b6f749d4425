"""Find quantities and units in names: in column names, and in names of files, folders and
sheets.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from mapmore_cli.study.units import CANONICAL, spell_pressures, unit_of

POSITIONS = ("strain", "displacement", "length")
"""Quantities that measure how far a muscle has contracted, the most informative first."""

_WORDS = {
    "time": "t time times timestamp seconds elapsed zeit uhrzeit clock tout temps tiempo tempo tijd"
    " время 时间 時間",
    "pressure": "p press pressure druck pression presión presion pressione pressão druk gauge"
    " давление 压力 圧力",
    "strain": "eps epsilon e strain contraction dehnung kontraktion ε déformation deformation"
    " deformación deformacion deformazione contracción contrazione 应变",
    "force": "f force kraft tension pull loadcell effort fuerza forza força kracht сила усилие 力"
    " 拉力 推力",
    "displacement": "d x disp displacement position pos stroke extension elongation travel weg"
    " shortening déplacement deplacement desplazamiento spostamento verplaatsing перемещение 位移"
    " 変位",
    "length": "l len length länge laenge longueur longitud lunghezza lengte длина 长度",
    "load": "load weight mass",
    "input": "u v input voltage valve duty pwm dac regulator solenoid pump",
}
_OF_WORD = {word: quantity for quantity, words in _WORDS.items() for word in words.split()}
_WORD = re.compile(r"%|[^\W\d_]+|\d+")
_TOKEN = re.compile(r"%|[^\W_][^\s_()\[\],;:%-]*(?:(?<=Pa)_abs)?")
_COMMANDS = {
    *("cmd", "command", "setpoint", "set", "desired", "demand", "reference", "ref"),
    *("simulated", "simulation", "sim"),
}


@dataclass(frozen=True)
class ColumnTitle:
    """The meaning of a column's name: the `quantity` that it names, and its `unit` if the name has
    one.

    `plain` is True if the name contains nothing else: `force_N` is plainer than `force_N_total`.
    """

    quantity: str
    unit: str | None
    plain: bool


def read_label(name: str) -> ColumnTitle | None:
    """Return the meaning of a column's name, for example a pressure in kPa for `pressure_kPa` and
    for `P [kPa]`; None for a name without a known meaning.

    The first word that names a quantity is used, and a unit is expected after this word. If no word
    names a quantity, but the name contains a unit of pressure, the column is a pressure.
    """
    # split camel case (`forceSensor`) and `pL` (left pressure), but not the units kPa and MPa
    apart = re.sub(
        r"(?<=[a-z]{3})(?=[A-Z])|(?<=\bp)(?=[LRAB]\b)", " ", spell_pressures(name).replace("_", " ")
    )
    parts = [(match[0].casefold(), match.end()) for match in _WORD.finditer(apart)]
    named = [(word, end) for word, end in parts if word in _OF_WORD]
    # `V` after a quantity, as in `y_V`, means volts
    named = [
        word_and_end for word_and_end in named if word_and_end == parts[0] or word_and_end[0] != "v"
    ]
    is_command = any(word in _COMMANDS for word, _ in parts)
    quantity = "input" if is_command else _OF_WORD[named[0][0]] if named else None
    if quantity is None:
        long = (word for word in _TOKEN.findall(apart) if len(word) > len("Pa"))
        unit = unit_in("pressure", " ".join(long))
        return ColumnTitle("pressure", unit, plain=False) if unit else None
    behind = spell_pressures(apart[named[0][1] :]) if named else ""
    unit = unit_in(quantity, behind)
    is_plain = named[:1] == parts[:1] and len(_TOKEN.findall(behind)) == (unit is not None)
    return ColumnTitle(quantity, unit, is_plain)


def unit_in(quantity: str, text: str) -> str | None:
    """Return the unit of a quantity that a text contains, for example `[kN]` below a column's name;
    None if the text contains no unit.
    """
    like = CANONICAL.get(quantity)
    if like is None:
        return None
    units = [unit_of(word, like) for word in _TOKEN.findall(spell_pressures(text))]
    known = [unit for unit in units if unit is not None]
    # a unit other than `in` is preferred, because `in` is a preposition in a name such as `x in mm`
    return next((unit for unit in known if unit != "in"), next(iter(known), None))
