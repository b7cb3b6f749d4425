"""Convert numbers that are read from a spec or a file to the unit of the model. All arrays in the
program are in the unit of the model.

Common units are converted with a table of exact factors, which a test compares with pint. Pint
knows all other units. Pint is imported only if such a unit occurs, because loading it takes 0.4 s
of processor time, while a run that is up to date takes 0.6 s.

A pressure is a gauge pressure, which is zero in the open air: `psig` is the same as `psi`. An
absolute pressure, for example in `psia`, is larger by 101.325 kPa.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from contextlib import suppress
from difflib import get_close_matches
from fractions import Fraction
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.recording import BaseUnits

if TYPE_CHECKING:
    from pint import Unit, UnitRegistry

N = TypeVar("N", float, Array)

CANONICAL: Mapping[str, str] = MappingProxyType(
    {
        "time": "s",
        "pressure": "kPa",
        "strain": "1",
        "force": "N",
        "length": "m",
        "displacement": "m",
        "load": "N",
        "input": "V",
    }
)
"""The quantities with a fixed meaning, and their default units in the model."""

_NO_CHANGES: Mapping[str, str] = MappingProxyType({})
_NAMED_DIMENSIONS = {
    "s": "a time", "kPa": "a pressure", "N": "a force", "m": "a length", "V": "a voltage",
        "1": "a plain number",
    "kg": "a mass", "1/s": "a rate", "kPa/s": "a pressure rate", "m/s": "a speed",
        "K": "a temperature", "A": "a current",
}  # fmt: skip
_EVERYDAY: Mapping[str, tuple[str, Fraction]] = {
    unit: (dimension, Fraction(factor))
    for dimension, factors in {
        "pressure": {
            "Pa": "1",
            "hPa": "100",
            "kPa": "1000",
            "MPa": "1e6",
            "mbar": "100",
            "bar": "1e5",
        },
        "length": {"m": "1", "cm": "0.01", "mm": "0.001", "um": "1e-6"},
        "time": {"s": "1", "ms": "0.001", "us": "1e-6", "ns": "1e-9", "min": "60", "h": "3600"},
        "force": {"N": "1", "mN": "0.001", "daN": "10", "kN": "1000"},
        "voltage": {"V": "1", "mV": "0.001"},
        "mass": {"kg": "1", "g": "0.001"},
        "number": {"1": "1", "%": "0.01", "permille": "0.001"},
    }.items()
    for unit, factor in factors.items()
}
"""Dimension of each common unit, and its factor relative to the first unit of that dimension."""
_PRESSURES = (
    "Pa",
    "hPa",
    "kPa",
    "MPa",
    "mbar",
    "bar",
    "psi",
    "mmHg",
    "inHg",
    "mmH2O",
    "cmH2O",
    "inH2O",
)
_ABSOLUTE = {unit: f"{unit}_abs" if unit.endswith("Pa") else f"{unit}a" for unit in _PRESSURES}
"""Names of units of absolute pressure. `kPaa` is not among them, because it is more likely a typing
error.
"""
_AIR = 101325  # pressure of the standard atmosphere, Pa
_WEIGHTS = {"kg": "kgf", "g": "gf", "lb": "lbf"}
_COMMON = [
    *_EVERYDAY,
    *_PRESSURES,
    *("in", *_WEIGHTS.values(), "N*m", "degC", "K", "kPa/ms"),
    *(f"{unit}/s" for unit in ("1", "%", "mm", "m", "N", "V", "Pa", "kPa", "bar", "psi")),
]
"""Units among which a suggestion for a misspelt unit is chosen."""
_KNOWN = {
    *_COMMON,
    *_ABSOLUTE.values(),
    *("lb", "N*mm", "degF", "deg", "mdeg", "rad", "mrad", "rpm", "Hz", "A", "mA", "ohm", "W"),
}
_SPELLINGS = {
    spelling: unit
    for unit, spellings in {
        "s": "sec, secs, second, seconds",
        "ms": "msec, msecs, milliseconds",
        "min": "minute, minutes",
        "h": "hr, hrs, hour, hours",
        "%": "pct, perc, percent",
        "permille": "‰",
        "1": "-, frac, fraction, ratio",
        "N": "newton, newtons",
        "lbf": "lbs",
        "kgf": "kp",
        "g": "gram, grams",
        "kg": "kilogram, kilograms",
        "um": "µm, μm",
        "in": "inch, inches",
        "N*m": "N m, N.m, N-m",
        "degC": "°c, deg c, celsius",
        "degF": "°f, deg f, fahrenheit",
        "deg": "°, degree, degrees",
        "rad": "radian, radians",
        "V": "volt, volts",
        "ohm": "Ω",
        "rpm": "u/min, r/min",
    }.items()
    for spelling in spellings.split(", ")
}
"""Other spellings of units. A spelling in small letters matches any capitals."""
_GAUGE = re.compile(
    rf"(?<![^\W\d_])({'|'.join(_PRESSURES)})"
    r"((?<!pa)a|g|[ _]?\([ag]\)|[ _]?\(?(?:abs|absolute|gauge)\)?)(?![^\W\d_])",
    re.IGNORECASE,
)
"""A unit of pressure that says whether it is gauge or absolute: `psig`, `bar(a)`, `kPa abs`."""
_ANY_CASE = {unit.casefold(): unit for unit in _KNOWN}
_BRACKETS = re.compile(r"[\[(]([^][()]+)[])]$")
_POWER = re.compile(r"(\w+?)(?:\^?([23])|([²³]))$")

# this pattern splits a text into a number and a unit in only one way
_QUANTITY = re.compile(r"([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)(.*)", re.ASCII | re.DOTALL)
_FACTOR = r"\(*(?:1|%|[^\W\d]\w*)(?:(?:\^|\*\*)-?\d)?\)*"
_UNIT = re.compile(rf"{_FACTOR}(?:(?:\s*[*/·]\s*|\s+){_FACTOR})*")
# torques are usually written `Nm`, but pint takes `Nm` for a measure of yarn (`number_meter`)
_TORQUE = re.compile(r"\b([mk]?N)(m|mm|cm)\b")
_LONGEST_UNIT = 60
_BASE = {
    "kilogram": "kg", "meter": "m", "second": "s", "ampere": "A", "kelvin": "K", "mole": "mol",
        "candela": "cd", "radian": "rad",
}  # fmt: skip


def default_unit(
    name: str, changes: Mapping[str, str] = _NO_CHANGES, rates: Mapping[str, str] = _NO_CHANGES
) -> str:
    """Return the unit of a quantity in the model. It is the unit in `changes` (the section `units`
    of the spec), otherwise the default unit of this quantity, otherwise `1`.

    A rate has the unit of its quantity per unit of time, for example `kPa/s` for `pressure_rate`.
    `rates` maps rates with other names to their quantities. `step_pressure` has the unit of the
    pressure.
    """
    if name in changes:
        return changes[name]
    # A rate that is derived from itself is left out, because the recursion would not end. A check
    # of the spec reports this mistake.
    others = {key: of for key, of in rates.items() if key != name}
    if name in rates or name.endswith("_rate"):
        of = rates.get(name, name.removesuffix("_rate"))
        return f"{default_unit(of, changes, others)}/{default_unit('time', changes)}"
    if name.startswith("step_"):
        return default_unit(name.removeprefix("step_"), changes, others)
    return CANONICAL.get(name, "1")


def is_canonical(name: str) -> bool:
    """Return True if the name of a quantity has a fixed meaning, as `pressure` has, or if it is the
    rate of such a quantity.
    """
    return name in CANONICAL or (
        name.endswith("_rate") and is_canonical(name.removesuffix("_rate"))
    )


def convert(values: N, source_unit: str, target_unit: str, *, difference: bool = False) -> N:
    """Convert values, or a `difference` of two values, to another unit. 1 K is -272.15 degC as a
    value, but 1 degC as a difference.

    Raises SpecError for an unknown unit or two units of different dimensions; the message names
    both.
    """
    source_unit, target_unit = _spelt(source_unit), _spelt(target_unit)
    if source_unit == target_unit:
        return values
    factor = _everyday_factor(source_unit, target_unit)
    if factor is not None:
        return values * factor
    source, target = _pint_unit(source_unit), _pint_unit(target_unit)
    if source.dimensionality != target.dimensionality:
        raise SpecError(
            f"unit {source_unit!r} ({_dimension(source_unit)}) cannot be converted to "
            f"{target_unit!r} ({_dimension(target_unit)})",
            _suggestion(source_unit, target_unit)
            or (
                "write a plain number; if it belongs to a quantity that has a unit, declare this "
                f"unit, for example `units: {{name: {source_unit}}}`"
                if target_unit == "1"
                else f"give a unit of the same dimension as {target_unit!r}"
            ),
        )
    if difference:
        source, target = _without_zero(source), _without_zero(target)
    converted = _registry().Quantity(values, source).to(target).magnitude
    if isinstance(values, np.ndarray):
        return np.asarray(converted, dtype=np.float64)
    return float(converted)


def _spelt(unit: str) -> str:
    """Return a unit in the spelling of mapmore: `psig` is `psi`, `psi abs` is `psia`, `°C/s` is
    `degC/s`.
    """
    text = _TORQUE.sub(r"\1*\2", spell_pressures(unit.strip())).replace("·", "*")
    factors = [text] if _ours(text) else re.split(r"([*/])", text)
    return "".join(_ours(factor) or factor for factor in factors)


def spell_pressures(text: str) -> str:
    """Return a text in which pressures are spelt as mapmore spells them: `P (bar(a))` becomes `P
    (bara)`.
    """

    def ours(pressure: re.Match[str]) -> str:
        unit = _ANY_CASE[pressure[1].casefold()]
        is_absolute = pressure[2].strip(" _(").casefold().startswith("a")
        return _ABSOLUTE[unit] if is_absolute else unit

    return _GAUGE.sub(ours, text)


def _ours(unit: str) -> str | None:
    """Return mapmore's spelling of one factor of a unit, for example `mm^2` for `mm2`. Return None
    if mapmore has no other spelling of this factor.
    """
    power = _POWER.fullmatch(unit)
    if power is not None and power[1] in _KNOWN:
        return f"{power[1]}^{power[2] or '²³'.index(power[3]) + 2}"
    return _SPELLINGS.get(unit) or _SPELLINGS.get(unit.casefold())


def _everyday_factor(source_unit: str, target_unit: str) -> float | None:
    source, target = _everyday(source_unit), _everyday(target_unit)
    if source is None or target is None or source[0] != target[0]:
        return None
    return float(source[1] / target[1])


def _everyday(unit: str) -> tuple[tuple[str, ...], Fraction] | None:
    """Return the dimensions of a common unit, or of a rate `unit/time`, and its factor to the base
    unit; None for any other unit, which pint converts.
    """
    match [_EVERYDAY.get(part) for part in unit.split("/")]:
        case [(dimension, factor)]:
            return (dimension,), factor
        case [(dimension, factor), ("time", duration)]:
            return (dimension, "time"), factor / duration
    return None


def is_quantity(text: str) -> bool:
    """Return True for a text that starts with a number and continues with something else, for
    example `250 kPa`.
    """
    match = _QUANTITY.fullmatch(text.strip())
    return match is not None and bool(match[2])


def split_quantity(text: str) -> tuple[float, str | None]:
    """Return the number and the unit of a quantity; the unit is None for a plain number. Raises
    SpecError for any other text.
    """
    match = _QUANTITY.fullmatch(text.strip())
    if match is None:
        raise SpecError(
            f"{text[:_LONGEST_UNIT]!r} is not a number with a unit", "write it as `250 kPa`"
        )
    return float(match[1]), match[2].lstrip() or None


def parse_quantity(text: str, unit: str, *, difference: bool = False) -> float:
    """Convert a text such as `1.1 bar` to a number in `unit`, as a value or as a `difference` of
    two values: `parse_quantity("1.1 bar", "kPa")` is 110. A plain number is returned unchanged.

    Raises SpecError for a text that is not a number with a unit, an unknown unit, or a unit of
    another dimension.
    """
    number, source_unit = split_quantity(text)
    # the result is rounded to 15 digits, so that 1.1 bar is 110 kPa, not 110.00000000000001 kPa
    if source_unit is None:
        return number
    return float(f"{convert(number, source_unit, unit, difference=difference):.15g}")


def check_unit(unit: str) -> None:
    """Raise SpecError for an unknown unit."""
    if _spelt(unit) not in _KNOWN:
        _pint_unit(unit)


def is_kept(unit: str) -> bool:
    """Return True if a quantity without a fixed meaning can have this unit in the model, for
    example `mm` or `deg`. Return False for `1`, `%` and unknown units.
    """
    everyday = _everyday(_spelt(unit))
    if everyday is not None:
        return everyday[0] != ("number",)
    try:
        return _spelt(unit) in ("deg", "rad") or not _pint_unit(unit).dimensionless
    except SpecError:
        return False


def unit_of(text: str, like: str | None = None) -> str | None:
    """Return the unit that a text names, in mapmore's spelling; None if it names no common unit.

    The text is a unit, or ends with a unit in brackets: `psig` and `P (PSI)` give `psi`, `[bar(a)]`
    gives `bara`. With `like`, the unit must be convertible to it. If `like` is a force, a mass
    means its weight: `kg` gives `kgf`.
    """
    whole = _spelt(text)
    bracket = _BRACKETS.search(whole)
    word = _spelt(bracket[1]) if bracket else whole
    # without `like`, the case of a single letter matters: `s` and `S` are different units
    unit = _ANY_CASE.get(word.casefold(), word) if like is not None or len(word) > 1 else word
    factors = [factor.partition("^")[0] for factor in re.split(r"[*/]", unit)]
    if (unit not in _KNOWN and not _KNOWN.issuperset(factors)) or unit.casefold() == "n/a":
        return None
    if like is None:
        return unit
    meant = (unit, _WEIGHTS.get(unit, unit))
    return next((candidate for candidate in meant if can_convert(candidate, like)), None)


def unit_of_file(text: str, like: str) -> str | None:
    """Return the unit that a text in a file gives (`BAR`, `psig`, `seconds since 2020-01-01`), in
    mapmore's spelling; None for an unknown unit.

    If the text can mean several units, the unit that can be converted to `like` is used.
    """
    text = text.split(" since ")[0]
    word = text.strip(" []()")
    spellings = [word, word.lower()] if len(word) > len("torr") else [word]  # `Newton`, not `Nm`
    rare = (unit for unit in spellings if can_convert(unit, like))
    return unit_of(text, like) or next(rare, None) or unit_of(text)


def can_convert(unit: str, other: str) -> bool:
    """Return True if two units have the same dimension."""
    with suppress(SpecError):
        convert(0.0, unit, other)
        return True
    return False


def is_same(unit: str, other: str) -> bool:
    """Return True if every quantity has the same number in both units, for example in N*m and J."""
    try:
        return np.allclose(convert(np.array([0.0, 1.0]), unit, other), [0.0, 1.0], rtol=1e-9)
    except SpecError:
        return False


def base_units(unit: str) -> BaseUnits | None:
    """Return a unit in base units of the SI; None for an unknown unit, or for a unit with
    fractional powers.
    """
    try:
        parsed = _pint_unit(unit)
    except SpecError:
        return None
    zero, unit_value = (_registry().Quantity(value, parsed).to_base_units() for value in (0.0, 1.0))
    powers = {_BASE.get(name, name): cast(float, power) for name, power in unit_value.unit_items()}
    if not all(
        name in _BASE.values() and float(power).is_integer() for name, power in powers.items()
    ):
        return None
    offset = float(zero.magnitude)
    return BaseUnits(
        float(f"{float(unit_value.magnitude) - offset:.15g}"),
        offset,
        {name: int(power) for name, power in sorted(powers.items())},
    )


@functools.cache
def _registry() -> UnitRegistry[float]:
    """Return pint's units, extended by absolute pressures."""
    import pint

    registry: UnitRegistry[float] = pint.UnitRegistry()
    for unit, absolute in _ABSOLUTE.items():
        pascals = registry.Quantity(1.0, unit).to("Pa").magnitude
        registry.define(f"{absolute} = {pascals!r} Pa; offset: {-_AIR}")
    return registry


@functools.cache
def _pint_unit(unit: str) -> Unit:
    """Return pint's unit; `1` is dimensionless. The grammar is checked first, because pint would
    compute `m**9**9**9`.
    """
    text = _spelt(unit)
    if len(text) <= _LONGEST_UNIT and _UNIT.fullmatch(text):
        spelled, registry = text.replace("%", "percent"), _registry()
        try:
            return registry.parse_units("" if spelled == "1" else spelled)
        # pint and its tokenizer raise a dozen types of errors, all for a malformed unit
        except Exception:
            pass
    shown = unit if len(unit) <= _LONGEST_UNIT else f"{unit[:_LONGEST_UNIT]}..."
    raise SpecError(
        f"unit {shown!r} is unknown",
        _suggestion(unit)
        or "write units as `kPa`, `mm`, `ms`, `%`, `kPa/s`, or `1` for a plain number",
    )


def _without_zero(unit: Unit) -> Unit:
    """Return pint's unit for differences of values. For a unit whose zero is not the natural zero,
    such as degC, pint has a separate unit of differences.
    """
    zero = _registry().Quantity(0.0, unit)
    width: Unit = (zero - zero).units
    return width


def _dimension(unit: str) -> str:
    here = _pint_unit(unit).dimensionality
    return next(
        (
            words
            for known, words in _NAMED_DIMENSIONS.items()
            if _pint_unit(known).dimensionality == here
        ),
        str(here),
    )


def _suggestion(unit: str, wanted: str = "") -> str | None:
    """Return a suggestion for a misspelt unit. Wrong capitals (`kpa`) come first, because they are
    the most common slip. If a force is `wanted`, a mass is replaced by its weight.
    """
    if unit in _WEIGHTS and wanted and can_convert(wanted, "N"):
        return f"did you mean `{_WEIGHTS[unit]}`, the weight of a mass?"
    if unit in _COMMON:
        return None
    same_letters = [known for known in _COMMON if known.casefold() == unit.strip().casefold()]
    near = same_letters or get_close_matches(unit, _COMMON, n=1, cutoff=0.6)
    return f"did you mean `{near[0]}`?" if near else None
