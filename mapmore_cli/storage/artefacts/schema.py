"""A stored type is a dataclass: its type hints say how it is written, read, checked and described.

The first text in the `Annotated` of a field is its description, the second its unit; other marks
check its value when a file is read (`domain.declared`). Letters in brackets before a description
name dimensions: all that is called `(k)` in an object, and in the objects inside of it, has one
length; `(k, M)` is a table, and `(k or 0)` may also be empty. A default is what files without the
field are read as, and is not written.

Units in brackets name the quantity whose unit applies: `[target]` is the modelled quantity,
`[variables.0]` the first segmented variable, `[*]` the quantity that a part is named after. The
unit of an object is that of what it models.
"""

from __future__ import annotations

import math
import re
import types
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, Union, get_args, get_origin, get_type_hints

import numpy as np
from annotated_types import Interval

from mapmore_cli.domain.declared import Checked
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Fit, Scaling, SegmentedCurve
from mapmore_cli.domain.foreign import is_one_line
from mapmore_cli.domain.models import Body, Model, Pieces
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Validation
from mapmore_cli.modelling.kinds import kinds

ARRAY, FROM, SHAPE = "array", "from", "shape"
"""The keys of a reference to a dataset, or to a part of one that many members share."""

TYPES = {np.float64: "<f8", np.int64: "<i8", np.bool_: "|u1"}
"""Types of arrays in a file; flags are not HDF5's enumeration, which MATLAB reads as text."""

DEEPEST = 60
"""Fields within fields: ten sums of sums."""

NO_UNIT = "-"
Letters = tuple[str, ...]
Units = Mapping[str, str]
"""Units by the names of quantities."""

Numbers = np.ndarray[Any, np.dtype[Any]]
"""An array of one of the `TYPES`."""

Reference = dict[str, Any]
"""How the document refers to an array."""

Put = Callable[[str, Numbers, str, str], Reference]
"""Stores an array under its path, with its description and unit; returns how the document refers to
it.
"""


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
    checks = tuple(mark for mark in marks if isinstance(mark, Checked | Interval))
    letters = tuple(match[1].split(", ")) if match else ()
    return Hint(Union if alias is types.UnionType else alias, inner, checks, letters, *words[:2])


@cache
def stored_fields(type_: Any) -> dict[str, tuple[Any, Any]]:
    """Return hint and default of every stored field, by name."""
    hints, found = get_type_hints(type_, include_extras=True), {}
    for field in fields(type_):
        if field.metadata.get("stored", True):
            made = field.default if field.default_factory is MISSING else field.default_factory()
            found[field.name] = hints[field.name], made
    return found


@cache
def bodies(kind: object) -> dict[str, type]:
    """Return what a model consists of (`Body`), or what was fitted (`Fit`), by its kind."""
    if kind not in (Body, Fit):
        return {}
    return {
        model_kind.name: type_
        for model_kind in kinds()
        if (type_ := model_kind.body if kind is Body else model_kind.fit)
    }


def step_to(key: object, place: int) -> str:
    """Return how a member is called in paths: its name, or its number where a name cannot be
    one.
    """
    name = str(key)
    return name if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name) else f"{place:03d}"


def shared_path(path: str) -> str:
    """Return where the arrays of all members of lists lie one after the other: `all` in place of
    the number of each. Further outputs (`others`) have units of their own.
    """
    return re.sub(r"(?<!/others)/\d{3,}(?=/|$)", "/all", path)


def hints_of_members(own: Hint, count: int) -> Sequence[Any]:
    """Return the hints of so many members of a mapping or a tuple."""
    each = own.inner[own.kind is Mapping]
    return (
        [each] * count
        if own.kind is Mapping or own.inner[1:] == (...,)
        else [*own.inner, *[each] * count][:count]
    )


# Writing ----------------------------------------------------------------------------------------


def units_of(record: object) -> Units:
    """Return the units that an object knows, by the names that stand in brackets."""
    match record:
        case Dataset():
            units = {name: quantity.unit for name, quantity in record.quantities.items()}
            return {**units, "target": units.get(record.target, "1")}
        case Model():
            return {"target": record.output.unit} | {
                quantity.name: quantity.unit for quantity in (*record.inputs, record.output)
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

    return re.sub(r"\[([^\]]*)\](\^?)", known, unit) if "[" in unit else unit


def encoded(
    value: object,
    hint: object,
    put: Put,
    units: Units,
    path: str = "",
    outer: tuple[str, str] = ("", ""),
) -> object:
    """Return a value as JSON has it; its arrays are `put` under their paths.

    `outer` are description and unit of the field that it is a part of.
    """
    if value is None or isinstance(value, bool | int | float | str):
        return _scalar(value)
    own = taken_apart(hint)
    label = (own.description, own.unit) if own.description else outer
    if own.kind is Union:
        return encoded(value, own.inner[0], put, units, path, label)
    if isinstance(value, np.ndarray):
        return put(path, value, label[0], resolved(label[1] or "1", units))
    if is_dataclass(value):
        known = {"target": label[1] or "[target]", **units_of(value)}
        units = {**units, **{name: resolved(unit, units) for name, unit in known.items()}}
        document: dict[object, object] = {}
        for word in (word for word, one in bodies(own.kind).items() if one is type(value)):
            document["kind"] = word
        for name, (inner, default) in stored_fields(type(value)).items():  # type: ignore[arg-type]
            member = getattr(value, name)
            if not _same(member, default):
                document[name] = encoded(member, inner, put, units, f"{path}/{name}")
        return document
    if isinstance(value, range):
        return [value.start, value.stop]
    if isinstance(value, Mapping | tuple):
        parts = value if isinstance(value, Mapping) else dict(enumerate(value))
        document = {
            _scalar(key): encoded(
                one,
                part,
                put,
                units,
                f"{path}/{step_to(key, i)}",
                (label[0], label[1].replace("*", str(key))),
            )
            for i, ((key, one), part) in enumerate(
                zip(parts.items(), hints_of_members(own, len(parts)), strict=True)
            )
        }
        return document if parts is value else list(document.values())
    raise TypeError(f"{path}: {type(value).__name__} cannot be stored")


def _same(value: object, default: object) -> bool:
    """Whether a value is the default; NaN is the same as NaN."""
    return not isinstance(value, np.ndarray) and bool(
        value == default or (value != value and default != default)
    )


def _scalar(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, str) and not is_one_line(value):
        what = f"the name {value!r} cannot be stored: it is not one line of valid text"
        raise DataError(what, "rename the file or column that it is of")
    return value
