"""A stored type is a dataclass: its type hints say how it is written, read, checked and described.

The first text in the `Annotated` of a field is its description, the second its unit; other marks
check its value when a file is read (`domain.declared`). Letters in brackets before a description
name dimensions: all that is called `(k)` in an object, and in the objects inside of it, has one
length; `(k, M)` is a table, and `(k or 0)` may also be empty. A default is what files without the
field are read as, and is not written.

Units in brackets name the quantity whose unit applies: `[target]` is the modelled quantity,
`[variables.0]` the first segmented variable, `[*]` the quantity that a part is named after.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from annotated_types import Gt, Interval

from mapmore_cli.domain.declared import Checked
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Scaling, SegmentedCurve
from mapmore_cli.domain.foreign import is_one_line
from mapmore_cli.domain.models import Body, Formula, Model, Pieces
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import FitResult, Validation
from mapmore_cli.modelling.kinds import kinds

ARRAY = "array"
"""The key of a reference to a dataset."""

TYPES = {np.float64: "<f8", np.int64: "<i8", np.bool_: "|u1"}
"""Types of arrays in a file; flags are not HDF5's enumeration, which MATLAB reads as text."""

DEEPEST = 60
"""Fields within fields: ten sums of sums."""

NO_UNIT = "-"

Put = Callable[[str, Any, str, str], None]
"""Stores an array under its path, with its description and unit."""
Take = Callable[[str, str, int], Any]
"""Returns the array under a path, of a type and number of dimensions."""


class Invalid(Exception):
    """A file is not what the format says: `where` is the path inside of it, `what` is wrong there."""

    def __init__(self, where: str, what: str) -> None:
        super().__init__(f"{where.lstrip('/') or 'the root'}, {what}")


@contextmanager
def stored_at(where: str) -> Iterator[None]:
    """Turn what h5py raises while it reads into Invalid. Only calls of h5py stand in the block."""
    try:
        yield
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        why = str(fault).strip("'\"").splitlines()[0] if str(fault) else type(fault).__name__
        raise Invalid(where, f"cannot be read ({why})") from fault


@dataclass(frozen=True)
class SegmentationFile:
    """Where every training curve is cut."""

    curves: Annotated[tuple[SegmentedCurve, ...], "training curves"]


# Type hints -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hint:
    """A type hint taken apart: the type without names and marks, and what was marked."""

    type: Any
    checks: tuple[Any, ...] = ()
    description: str = ""
    unit: str = ""

    @property
    def letters(self) -> list[str]:
        """The dimensions that the description declares."""
        match = re.match(r"\((\w+(?: or 0)?(?:, \w+)*)\) ", self.description)
        return match[1].split(", ") if match else []

    @property
    def members(self) -> list[Any]:
        """The types that a value may have, None left out; of any other hint, that one."""
        union = get_origin(self.type) in (Union, types.UnionType)
        return [one for one in get_args(self.type) if one is not type(None)] if union else [self.type]


@cache
def taken_apart(hint: Any) -> Hint:
    """Return a hint without aliases (NumPy has `NDArray` as one from 2.5 on) and annotations."""
    marks: list[Any] = []
    while True:
        alias = get_origin(hint) or hint
        if alias is Annotated:
            marks, hint = [*hint.__metadata__, *marks], get_args(hint)[0]
        elif hasattr(alias, "__value__"):
            hint = alias.__value__[get_args(hint)] if get_args(hint) else alias.__value__
        else:
            words = [mark for mark in marks if isinstance(mark, str)]
            checks = tuple(mark for mark in marks if not isinstance(mark, str))
            return Hint(hint, checks, *words[:2])


@cache
def stored_fields(type_: type) -> dict[str, tuple[Any, Any]]:
    """Return hint and default of every stored field, by name."""
    hints = get_type_hints(type_, include_extras=True)
    stored = [one for one in fields(type_) if one.metadata.get("stored", True)]
    made = {one.name: one.default_factory for one in stored if one.default_factory is not MISSING}
    return {one.name: (hints[one.name], made[one.name]() if one.name in made else one.default) for one in stored}


@cache
def bodies(hint: Any) -> dict[str, type]:
    """Return what a model consists of (`Body`), or what was fitted (`Any`), by its kind."""
    if hint not in (Body, Any):
        return {}
    found = {kind.name: kind.body if hint is Body else kind.fit for kind in kinds()}
    return {name: type_ for name, type_ in found.items() if type_ is not None}


def _step(key: str, place: int) -> str:
    """Return how a member is called in paths: its name, or its number where a name cannot be one."""
    return key if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", key) else f"{place:03d}"


# Writing ----------------------------------------------------------------------------------------


def _known_units(record: Any) -> dict[str, str]:
    """Return the units that an object knows, by the names that stand in brackets."""
    match record:
        case Dataset():
            units = {name: one.unit for name, one in record.quantities.items()}
            return units | {"level": f"[{record.level}]"}
        case Model():
            units = {one.name: one.unit for one in (*record.inputs, record.output)}
            return units | {"target": record.output.unit}
        case SegmentedCurve() | Pieces():
            level = {"level": f"[{record.level}]"} if isinstance(record, Pieces) else {}
            return level | {f"variables.{i}": f"[{name}]" for i, name in enumerate(record.variables)}
        case Scaling():
            return {"slopes": ", ".join(f"1/[{name}]" for name in record.variables)}
        case Formula():
            return {"level": f"[{record.level}]"}
        case Validation():
            return {**record.units, "target": next(iter(record.units.values()), "1")}
    return {}


def resolved(unit: str, units: Mapping[str, str]) -> str:
    """Return the unit with every known `[name]` replaced; a compound one in brackets before a power."""

    def known(match: re.Match[str]) -> str:
        name, power = match.groups()
        found = units.get(name, f"[{name}]")
        return f"({found}){power}" if power and re.search(r"[*/ ^]", found) else f"{found}{power}"

    return re.sub(r"\[([^\]]*)\](\^?)", known, unit)


def encoded(value: Any, hint: Any, put: Put, units: Mapping[str, str], path: str = "", outer: Hint | None = None) -> Any:
    """Return a value as JSON has it; its arrays are `put` under their paths."""
    own = taken_apart(hint)
    outer, kind = own if outer is None or own.description else outer, own.members[0]

    def part(value: Any, hint: Any, step: str, key: str) -> Any:
        within = Hint(outer.type, (), outer.description, outer.unit.replace("*", key))
        return encoded(value, hint, put, units, f"{path}/{step}", within)

    if isinstance(value, np.ndarray):
        put(path, value, outer.description or path, resolved(outer.unit or "1", units))
        return {ARRAY: path}
    if is_dataclass(value):
        known = {name: resolved(unit, units) for name, unit in _known_units(value).items()}
        units = {**units, **{name: resolved(unit, {**units, **known}) for name, unit in known.items()}}
        head = {"kind": next(name for name, one in bodies(kind).items() if one is type(value))} if bodies(kind) else {}
        found = {name: (getattr(value, name), *rest) for name, rest in stored_fields(type(value)).items()}
        return head | {
            name: encoded(one, hint, put, units, f"{path}/{name}")
            for name, (one, hint, default) in found.items()
            if not _same(one, default)
        }
    if isinstance(value, Mapping):
        inner = get_args(kind)[1]
        return {_line(key): part(one, inner, _step(key, i), key) for i, (key, one) in enumerate(value.items())}
    if isinstance(value, tuple | list):
        inner = get_args(kind)
        hints = inner[:1] * len(value) if inner[1:] == (...,) else inner
        return [part(one, hints[i], f"{i:03d}", str(i)) for i, one in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        return str(float(value))
    return _line(value) if isinstance(value, str) else value


def _same(value: Any, default: Any) -> bool:
    if default is MISSING or isinstance(value, np.ndarray):
        return False
    return bool(value == default) or (isinstance(value, float) and isinstance(default, float) and value != value and default != default)


def _line(text: str) -> str:
    if not is_one_line(text):
        what = f"the name {text!r} cannot be stored: it is not one line of valid text"
        raise DataError(what, "rename the file or column that it is of")
    return text


# Reading ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Decoder:
    """Puts a record together again; raises Invalid for what is not of its type.

    Fields that the format does not know are passed over where `lenient`.
    """

    take: Take
    lenient: bool = False

    def value(self, node: Any, hint: Any, path: str = "", letters: tuple[str, ...] = (), sizes: dict[str, int] | None = None) -> Any:
        """Return the value of a type; `sizes` are lengths of dimensions seen so far in the object."""
        own, sizes = taken_apart(hint), {} if sizes is None else sizes
        letters = tuple(own.letters) or letters
        if own.members != [own.type]:
            if node is None and type(None) in get_args(own.type):
                return None
            texts = [one for one in own.members if (taken_apart(one).type is str) == isinstance(node, str)]
            return self.value(node, (texts or own.members)[0], path, letters, sizes)
        found = self._plain(node, own.type, path, letters, sizes)
        for check in own.checks:
            if wrong := _wrong(found, check):
                raise Invalid(path, f"{wrong}: {str(found)[:60]!r}" if isinstance(found, str | int | float) else wrong)
        return found

    def _plain(self, node: Any, kind: Any, path: str, letters: tuple[str, ...], sizes: dict[str, int]) -> Any:
        origin, arguments = get_origin(kind), get_args(kind)
        if path.count("/") > DEEPEST:
            raise Invalid(path, f"lies more than {DEEPEST} fields deep")
        if origin is np.ndarray:
            return self._array(node, taken_apart(arguments[1]).type, path, letters, sizes)
        if kind is Any and node is None:
            return None
        if bodies(kind) and isinstance(node, dict):
            word = node.get("kind")
            if word not in tuple(bodies(kind)):
                raise Invalid(path, f"is of the kind {str(word)[:60]!r}, which is none of {', '.join(bodies(kind))}")
            inner = {name: one for name, one in node.items() if name != "kind"}
            return self._record(inner, bodies(kind)[word], path, sizes)
        if isinstance(kind, type) and is_dataclass(kind) and isinstance(node, dict):
            return self._record(node, kind, path, sizes)
        if origin in (dict, Mapping) and isinstance(node, dict):
            return {
                self.value(key, arguments[0], path): self.value(
                    one, arguments[1], f"{path}/{_step(key, i)}", letters, sizes if letters else None
                )
                for i, (key, one) in enumerate(node.items())
            }
        if origin is tuple and isinstance(node, list):
            many = arguments[1:] == (...,)
            if many:
                _compare(path, (len(node),), letters, sizes)
            if many or len(node) == len(arguments):
                hints = arguments[:1] * len(node) if many else arguments
                return tuple(self.value(one, hints[i], f"{path}/{i:03d}", (), dict(sizes)) for i, one in enumerate(node))
        return self._scalar(node, kind, path)

    def _scalar(self, node: Any, kind: Any, path: str) -> Any:
        if get_origin(kind) is Literal:
            if node not in get_args(kind):
                raise Invalid(path, f"is none of {', '.join(get_args(kind))}")
            return node
        if kind is float and (type(node) is int or node in ("nan", "inf", "-inf")):
            return float(node)
        if not isinstance(kind, type) or type(node) is not kind:
            raise Invalid(path, f"is no {getattr(kind, '__name__', str(kind))}")
        if kind is str and not is_one_line(node):
            raise Invalid(path, f"has control characters or line breaks: {node[:60]!r}")
        return node

    def _record(self, node: dict[str, Any], type_: type, path: str, sizes: dict[str, int]) -> Any:
        known = stored_fields(type_)
        for name in () if self.lenient else node.keys() - known.keys():
            raise Invalid(f"{path}/{name[:60]}", "is not known to this format")
        for name, (_, default) in known.items():
            if default is MISSING and name not in node:
                raise Invalid(f"{path}/{name}", "is missing")
        given = {name: hint for name, (hint, _) in known.items() if name in node}
        return type_(**{name: self.value(node[name], hint, f"{path}/{name}", (), sizes) for name, hint in given.items()})

    def _array(self, node: Any, number: Any, path: str, letters: tuple[str, ...], sizes: dict[str, int]) -> Any:
        if node != {ARRAY: path}:
            raise Invalid(path, "is no array of this path")
        number = get_args(number)[0]
        values = self.take(path, TYPES[number], max(1, len(letters))).astype(number, copy=False)
        _compare(path, values.shape, letters, sizes)
        values.setflags(write=False)  # several stages may be given the same
        return values


def _compare(path: str, shape: tuple[int, ...], letters: tuple[str, ...], sizes: dict[str, int]) -> None:
    """Raise Invalid where a length is not that of others with the same letter."""
    if shape == (0,) and letters and letters[0].endswith(" or 0"):
        return
    for length, letter in zip(shape, (one.removesuffix(" or 0") for one in letters), strict=False):
        if sizes.setdefault(letter, length) != length:
            raise Invalid(path, f"has {length} values, where others of ({letter}) have {sizes[letter]}")


def _wrong(value: Any, check: Any) -> str | None:
    """Return what is wrong with a value by a mark of its type; None for nothing, or no such mark."""
    match check:
        case Checked():
            return None if check.holds(value) else check.words
        case Gt():
            return None if value > check.gt else f"is not above {check.gt}"
        case Interval():
            least, most = -math.inf if check.ge is None else check.ge, math.inf if check.le is None else check.le
            return None if least <= value <= most else f"is not between {least} and {most}"
    return None


# The reference ----------------------------------------------------------------------------------


def described() -> str:
    """Return a section for every stored type, parts before wholes, for docs/file-format.md."""
    head = "| name | stored as | unit | what it is |\n|---|---|---|---|\n"
    sections: dict[type, str] = {}

    def walk(type_: type) -> None:
        sections[type_] = ""
        rows = ""
        for name, (hint, default) in stored_fields(type_).items():
            own, (form, parts) = taken_apart(hint), _form(hint)
            for part in parts:
                if part not in sections:
                    walk(part)
            form += "" if default is MISSING else " ?"
            unit = f"`{own.unit}`" if own.unit else NO_UNIT
            rows += f"| `{name}` | {form} | {unit} | {own.description or name.replace('_', ' ')} |\n".replace("\\|", "|")
        del sections[type_]
        sections[type_] = f"### {type_.__name__}\n\n{str(type_.__doc__).partition(chr(10))[0]}\n\n{head}{rows}\n"

    for root in (Dataset, SegmentationFile, FitResult, Model, Validation):
        walk(root)
    return "".join(sections.values())


def _form(hint: Any, letters: tuple[str, ...] = ()) -> tuple[str, list[type]]:
    """Return what the reference calls a type, and the stored types in it."""
    own = taken_apart(hint)
    kind, letters = own.type, tuple(own.letters) or letters
    origin, arguments = get_origin(kind), get_args(kind)

    def link(type_: type) -> str:
        return f"[{type_.__name__}](#{type_.__name__.lower()})"

    if own.members != [kind]:
        forms = [_form(one, letters) for one in own.members]
        optional = " or `null`" if type(None) in arguments else ""
        return " or ".join(form for form, _ in forms) + optional, [part for _, parts in forms for part in parts]
    if found := bodies(kind):
        return ", ".join(f"`{word}`: {link(type_)}" for word, type_ in found.items()), [*found.values()]
    if origin is np.ndarray:
        number = {"<f8": "float", "<i8": "int", "|u1": "flag"}[TYPES[get_args(taken_apart(arguments[1]).type)[0]]]
        return f"`{number}[{',' * (len(letters) - 1)}]`", []
    if origin in (dict, Mapping):
        form, parts = _form(arguments[1], letters)
        return f"members {form}", parts
    if origin is tuple:
        form, parts = _form(arguments[0])
        return f"list of {form}" if arguments[1:] == (...,) else f"{len(arguments)} times {form}", parts
    if isinstance(kind, type) and is_dataclass(kind):
        return link(kind), [kind]
    return f"`{'text' if kind is str or origin is Literal else kind.__name__}`", []
