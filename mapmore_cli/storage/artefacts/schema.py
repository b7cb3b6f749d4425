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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np
from annotated_types import Interval

from mapmore_cli.domain.declared import Checked, prose
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Scaling, SegmentedCurve
from mapmore_cli.domain.foreign import is_one_line
from mapmore_cli.domain.models import Body, Model, Pieces
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
WORDS = {str: "text", Literal: "text", types.NoneType: "null"}
"""What the reference calls types."""

Letters = tuple[str, ...]
Sizes = dict[str, int]
"""Dimensions, and the lengths of those seen so far in an object."""

Units = Mapping[str, str]
"""Units by the names of quantities."""

Put = Callable[[str, Any, str, str], None]
"""Stores an array under its path, with its description and unit."""
Take = Callable[[str, str, int], Any]
"""Returns the array under a path, of a type and number of dimensions."""


class Invalid(Exception):
    """A file is not what the format says: `where` is the path inside of it, `what` is wrong
    there.
    """

    def __init__(self, where: str, what: str) -> None:
        super().__init__(f"{where.lstrip('/') or 'the root'}, {what}")


@contextmanager
def stored_at(where: str) -> Iterator[None]:
    """Turn what h5py raises while it reads into Invalid. Only calls of h5py stand in the block."""
    try:
        yield
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        why = (str(fault) or type(fault).__name__).partition("\n")[0]
        raise Invalid(where, f"cannot be read ({why})") from fault


@dataclass(frozen=True)
class SegmentationFile:
    """Where every training curve is cut."""

    curves: Annotated[tuple[SegmentedCurve, ...], "training curves"]


# Type hints -------------------------------------------------------------------------------------


class Hint(NamedTuple):
    """A type hint taken apart.

    - `kind`: the type, without what stands in its brackets; Union where there are several.
    - `inner`: what stands in its brackets; of an array, the type of its numbers.
    - `checks`, `letters`, `description`, `unit`: what was marked.
    """

    kind: Any
    inner: tuple[Any, ...]
    checks: tuple[Any, ...] = ()
    letters: Letters = ()
    description: str = ""
    unit: str = ""


@cache
def taken_apart(hint: Any) -> Hint:
    """Return a hint without annotations and aliases (NumPy has `NDArray` as one from 2.5 on)."""
    marks: list[Any] = []
    while (alias := get_origin(hint) or hint) is Annotated or hasattr(alias, "__value__"):
        if alias is Annotated:
            marks, hint = [*hint.__metadata__, *marks], hint.__origin__
        else:
            hint = alias.__value__[get_args(hint)] if get_args(hint) else alias.__value__
    words = [*(mark for mark in marks if isinstance(mark, str)), "", ""]
    match = re.match(r"\((\w+(?: or 0)?(?:, \w+)*)\) ", words[0])
    inner = get_args(get_args(hint)[1]) if alias is np.ndarray else get_args(hint)
    checks = tuple(mark for mark in marks if not isinstance(mark, str))
    letters = tuple(match[1].split(", ")) if match else ()
    return Hint(Union if alias is types.UnionType else alias, inner, checks, letters, *words[:2])


@cache
def stored_fields(type_: Any) -> dict[str, tuple[Any, Any]]:
    """Return hint and default of every stored field, by name."""
    hints, found = get_type_hints(type_, include_extras=True), {}
    for one in fields(type_):
        if one.metadata.get("stored", True):
            made = one.default if one.default_factory is MISSING else one.default_factory()
            found[one.name] = hints[one.name], made
    return found


@cache
def bodies(kind: Any) -> dict[str, type]:
    """Return what a model consists of (`Body`), or what was fitted (`Any`), by its kind."""
    if kind not in (Body, Any):
        return {}
    return {one.name: type_ for one in kinds() if (type_ := one.body if kind is Body else one.fit)}


def _step(key: Any, place: int) -> str:
    """Return how a member is called in paths: its name, or its number where a name cannot be
    one.
    """
    return key if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", str(key)) else f"{place:03d}"


def _hints(own: Hint, count: int) -> Sequence[Any]:
    """Return the hints of so many members of a mapping or a tuple."""
    each = own.inner[own.kind is Mapping]
    return (
        [each] * count
        if own.kind is Mapping or own.inner[1:] == (...,)
        else [*own.inner, *[each] * count][:count]
    )


# Writing ----------------------------------------------------------------------------------------


def _known_units(record: Any) -> Units:
    """Return the units that an object knows, by the names that stand in brackets."""
    match record:
        case Dataset():
            return {name: one.unit for name, one in record.quantities.items()}
        case Model():
            return {"target": record.output.unit} | {
                one.name: one.unit for one in (*record.inputs, record.output)
            }
        case SegmentedCurve() | Pieces():
            return {f"variables.{i}": f"[{name}]" for i, name in enumerate(record.variables)}
        case Scaling():
            return {"slopes": ", ".join(f"1/[{name}]" for name in record.variables)}
        case Validation():
            return {"target": next(iter(record.units.values()), "1")}
    return {}


def resolved(unit: str, units: Units) -> str:
    """Return the unit with every known `[name]` replaced; a compound one in brackets before a
    power.
    """

    def known(match: re.Match[str]) -> str:
        name, power = match.groups()
        found = units.get(name, f"[{name}]")
        return f"({found}){power}" if power and re.search(r"[*/ ^]", found) else f"{found}{power}"

    return re.sub(r"\[([^\]]*)\](\^?)", known, unit)


def encoded(
    value: Any, hint: Any, put: Put, units: Units, path: str = "", outer: tuple[str, str] = ("", "")
) -> Any:
    """Return a value as JSON has it; its arrays are `put` under their paths.

    `outer` are description and unit of the field that it is a part of.
    """
    own = taken_apart(hint)
    label = (own.description, own.unit) if own.description else outer
    if own.kind is Union:
        return encoded(value, own.inner[0], put, units, path, label)
    if isinstance(value, np.ndarray):
        put(path, value, label[0], resolved(label[1] or "1", units))
        return {ARRAY: path}
    if is_dataclass(value):
        units = {
            **units,
            **{name: resolved(unit, units) for name, unit in _known_units(value).items()},
        }
        document: dict[str, Any] = {}
        for word in (word for word, one in bodies(own.kind).items() if one is type(value)):
            document["kind"] = word
        for name, (inner, default) in stored_fields(type(value)).items():  # type: ignore[arg-type]
            if not _same(one := getattr(value, name), default):
                document[name] = encoded(one, inner, put, units, f"{path}/{name}")
        return document
    if isinstance(value, Mapping | tuple):
        parts = value if isinstance(value, Mapping) else dict(enumerate(value))
        document = {
            _line(key): encoded(
                one,
                part,
                put,
                units,
                f"{path}/{_step(key, i)}",
                (label[0], label[1].replace("*", str(key))),
            )
            for i, ((key, one), part) in enumerate(
                zip(parts.items(), _hints(own, len(parts)), strict=True)
            )
        }
        return document if parts is value else list(document.values())
    return str(value) if isinstance(value, float) and not math.isfinite(value) else _line(value)


def _same(value: Any, default: Any) -> bool:
    """Whether a value is the default; NaN is the same as NaN."""
    return not isinstance(value, np.ndarray) and bool(
        value == default or (value != value and default != default)
    )


def _line(value: Any) -> Any:
    if isinstance(value, str) and not is_one_line(value):
        what = f"the name {value!r} cannot be stored: it is not one line of valid text"
        raise DataError(what, "rename the file or column that it is of")
    return value


# Reading ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Decoder:
    """Puts a record together again; raises Invalid for what is not of its type.

    Fields that the format does not know are passed over where `lenient`.
    """

    take: Take
    lenient: bool = False

    def value(self, node: Any, hint: Any, path: str, letters: Letters, sizes: Sizes) -> Any:
        """Return the value of a type; `sizes` are lengths of dimensions seen so far in the
        object.
        """
        own = taken_apart(hint)
        letters = own.letters or letters
        if own.kind is Union:
            if node is None and types.NoneType in own.inner:
                return None
            fitting = (
                one
                for one in own.inner
                if (taken_apart(one).kind in (str, Literal)) == isinstance(node, str)
            )
            return self.value(node, next(fitting, own.inner[0]), path, letters, sizes)
        found = self._plain(node, own, path, letters, sizes)
        for check in own.checks:
            if wrong := wrong_with(found, check):
                raise Invalid(path, wrong + (f": {found[:60]!r}" if isinstance(found, str) else ""))
        return found

    def _plain(self, node: Any, own: Hint, path: str, letters: Letters, sizes: Sizes) -> Any:
        kind, many = own.kind, own.inner[1:] == (...,)
        if path.count("/") > DEEPEST:
            raise Invalid(path, f"lies more than {DEEPEST} fields deep")
        if kind is np.ndarray and node == {ARRAY: path}:
            return self._array(path, own.inner[0], letters, sizes)
        if bodies(kind) and isinstance(node, dict):
            word, inner = (
                node.get("kind"),
                {name: one for name, one in node.items() if name != "kind"},
            )
            if word not in (*bodies(kind),):
                raise Invalid(
                    path,
                    f"is of the kind {str(word)[:60]!r}, which is none of "
                    f"{', '.join(bodies(kind))}",
                )
            return self._record(inner, bodies(kind)[word], path, sizes)
        if is_dataclass(kind) and isinstance(node, dict):
            return self._record(node, kind, path, sizes)
        if kind is tuple and isinstance(node, list) and (many or len(node) == len(own.inner)):
            if many:
                _compare(path, (len(node),), letters, sizes)
            parts, hints = enumerate(node), _hints(own, len(node))
            return tuple(
                self.value(one, hints[i], f"{path}/{i:03d}", (), {**sizes}) for i, one in parts
            )
        if kind is Mapping and isinstance(node, dict):
            parts = enumerate(node.items())
            return {
                self.value(key, own.inner[0], path, (), {}): self.value(
                    one, own.inner[1], f"{path}/{_step(key, i)}", letters, sizes if letters else {}
                )
                for i, (key, one) in parts
            }
        return _scalar(node, own, path)

    def _record(self, node: dict[str, Any], type_: Any, path: str, sizes: dict[str, int]) -> Any:
        known = stored_fields(type_)
        needed = {name for name, (_, default) in known.items() if default is MISSING}
        for name in (needed - node.keys()) | (
            set() if self.lenient else node.keys() - known.keys()
        ):
            raise Invalid(
                f"{path}/{name[:60]}",
                "is missing" if name in known else "is not known to this format",
            )
        given = {name: hint for name, (hint, _) in known.items() if name in node}
        return type_(
            **{
                name: self.value(node[name], hint, f"{path}/{name}", (), sizes)
                for name, hint in given.items()
            }
        )

    def _array(self, path: str, number: Any, letters: Letters, sizes: Sizes) -> Any:
        values = self.take(path, TYPES[number], max(1, len(letters))).astype(number, copy=False)
        _compare(path, values.shape, letters, sizes)
        values.setflags(write=False)  # several stages may be given the same
        return values


def _scalar(node: Any, own: Hint, path: str) -> Any:
    if own.kind is Literal and node not in own.inner:
        raise Invalid(path, f"is none of {', '.join(own.inner)}")
    if own.kind is float and (type(node) is int or node in ("nan", "inf", "-inf")):
        return float(node)
    expected = {Literal: str, Any: types.NoneType}.get(own.kind, own.kind)
    if type(node) is not expected:
        raise Invalid(path, f"is no {expected.__name__}")  # type: ignore[attr-defined]
    if expected is str and not is_one_line(node):
        raise Invalid(path, f"has control characters or line breaks: {node[:60]!r}")
    return node


def _compare(path: str, shape: tuple[int, ...], letters: Letters, sizes: Sizes) -> None:
    """Raise Invalid where a length is not that of others with the same letter."""
    for length, letter in zip(shape, letters, strict=False):
        name = letter.removesuffix(" or 0")
        if (length or name == letter) and sizes.setdefault(name, length) != length:
            raise Invalid(path, f"has {length} values, where others of ({name}) have {sizes[name]}")


def wrong_with(value: Any, check: Any) -> str:
    """Return what is wrong with a value by a mark of its type; nothing where no mark says so."""
    if isinstance(check, Interval):
        low, high = (
            -math.inf if check.ge is None else check.ge,
            math.inf if check.le is None else check.le,
        )
        check = Checked(f"is not between {low} and {high}", lambda value: low <= value <= high)
    return "" if not isinstance(check, Checked) or check.holds(value) else check.words


# The reference ----------------------------------------------------------------------------------


def described() -> str:
    """Return a section for every stored type, parts before wholes, for docs/file-format.md."""
    head = "| name | stored as | unit | what it is |\n|---|---|---|---|\n"
    sections: dict[str, str] = {}

    def form(hint: Any) -> str:
        """Return what a type is called; the sections of the types in it are written first."""
        own = taken_apart(hint)
        if own.kind is np.ndarray:
            return f"`{own.inner[0].__name__}[{',' * (len(own.letters) - 1)}]`"
        if found := bodies(own.kind):
            return ", ".join(f"`{word}`: {form(type_)}" for word, type_ in found.items())
        if is_dataclass(own.kind):
            return section(own.kind)
        if own.kind in (Union, tuple, Mapping):
            head = {Union: "", tuple: "list of ", Mapping: "object of "}[own.kind]
            return head + " or ".join(
                dict.fromkeys(
                    form(one) for one in own.inner[own.kind is Mapping :] if one is not ...
                )
            )
        return f"`{WORDS.get(own.kind, own.kind.__name__)}`"

    def section(type_: Any) -> str:
        name = type_.__name__
        link = f"[{name}](#{name.lower()})"
        if name in sections:
            return link
        sections[name] = ""
        rows = ""
        for field, (hint, default) in stored_fields(type_).items():
            own = taken_apart(hint)
            unit, optional = (
                f"`{own.unit}`" if own.unit else NO_UNIT,
                "" if default is MISSING else " ?",
            )
            rows += (
                f"| `{field}` | {form(hint)}{optional} | {unit} | {own.description or field} |\n"
            )
        del sections[name]
        sections[name] = (
            f"### {name}\n\n{prose(type_.__doc__).partition(chr(10))[0]}\n\n{head}{rows}\n"
        )
        return link

    for root in (Dataset, SegmentationFile, FitResult, Model, Validation):
        section(root)
    return "".join(sections.values())
