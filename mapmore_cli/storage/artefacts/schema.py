"""Use the type hints of a dataclass to write, read, check and describe it in files.

The first text in the `Annotated` of a field is its description, the second its unit; other
annotations check its value when a file is read (`domain.declared`). Letters in brackets before a
description name dimensions: all arrays with the dimension `(k)` in an object, and in the objects
inside it, have the same length. `(k, M)` is a table, and `(k or 0)` may also be empty. If a field
has its default value, it is not written; when a file is read, a missing field gets the default.

A unit in brackets is the unit of another quantity: `[target]` of the modelled quantity,
`[variables.0]` of the first segmented variable, and `[*]` of the quantity whose name is the key of
the value.
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

from mapmore_cli.domain.declared import ValueCondition
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.fits import Fit, Scaling, SegmentedCurve
from mapmore_cli.domain.foreign import is_one_line
from mapmore_cli.domain.models import Body, Model, Pieces
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.domain.results import Validation
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.tables.cells import shortened

ARRAY, FROM, SHAPE = "array", "from", "shape"
"""Keys of a reference to a dataset, or to a part of a dataset that many members share."""

TYPES = {np.float64: "<f8", np.int64: "<i8", np.bool_: "|u1"}
"""Types of arrays in a file. Truth values are stored as bytes, because MATLAB reads the type that
HDF5 uses for them as text.
"""

DEEPEST = 60
"""Largest depth of nested fields; it allows ten sums of sums."""

NO_UNIT = "-"
Letters = tuple[str, ...]
Units = Mapping[str, str]
"""Units by the name of the quantity."""

Numbers = np.ndarray[Any, np.dtype[Any]]
"""An array of one of the `TYPES`."""

Reference = dict[str, Any]
"""Reference to an array in the document."""

Put = Callable[[str, Numbers, str, str], Reference]
"""Function that stores an array at its path, with its description and unit, and returns the
reference to it.
"""


LONGEST_PLACE = 200


class Invalid(Exception):
    """Error for a file that does not have the right format. `where` is the path inside the file,
    and `problem` describes the fault.
    """

    def __init__(self, where: str, problem: str) -> None:
        # the path is shortened, because in a damaged file a name may be very long
        super().__init__(f"{shortened(where.lstrip('/'), LONGEST_PLACE) or 'the root'}, {problem}")


@contextmanager
def stored_at(where: str) -> Iterator[None]:
    """Convert errors that h5py raises while it reads into Invalid. The context must contain only
    calls of h5py.
    """
    try:
        yield
    except (OSError, KeyError, ValueError, TypeError, RuntimeError) as fault:
        why = (str(fault) or type(fault).__name__).partition("\n")[0]
        raise Invalid(where, f"cannot be read ({why})") from fault


@dataclass(frozen=True)
class SegmentationFile:
    """Contents of a segmentation file: how all training curves are cut into segments."""

    curves: Annotated[tuple[SegmentedCurve, ...], "training curves"]


# Type hints -------------------------------------------------------------------------------------


class Hint(NamedTuple):
    """The parts of a type hint such as `Annotated[tuple[Curve, ...], "(k) training curves"]`.

    - `kind`: the type without its brackets; Union for several types.
    - `inner`: the contents of the brackets; for an array, the type of its numbers.
    - `checks`, `letters`, `description`, `unit`: what the annotations say: tests of the value,
      names of the dimensions, description and unit.
    """

    kind: Any
    inner: tuple[Any, ...]
    checks: tuple[Any, ...] = ()
    letters: Letters = ()
    description: str = ""
    unit: str = ""


@cache
def taken_apart(hint: Any) -> Hint:
    """Return the parts of a type hint. An alias is replaced by the type for which it stands. (Since
    NumPy 2.5, `NDArray` is such an alias.)
    """
    marks: list[Any] = []
    while (alias := get_origin(hint) or hint) is Annotated or hasattr(alias, "__value__"):
        if alias is Annotated:
            marks, hint = [*hint.__metadata__, *marks], hint.__origin__
        else:
            hint = alias.__value__[get_args(hint)] if get_args(hint) else alias.__value__
    words = [*(mark for mark in marks if isinstance(mark, str)), "", ""]
    match = re.match(r"\((\w+(?: or 0)?(?:, \w+)*)\) ", words[0])
    inner = get_args(get_args(hint)[1]) if alias is np.ndarray else get_args(hint)
    checks = tuple(mark for mark in marks if isinstance(mark, ValueCondition | Interval))
    letters = tuple(match[1].split(", ")) if match else ()
    return Hint(Union if alias is types.UnionType else alias, inner, checks, letters, *words[:2])


@cache
def stored_fields(type_: Any) -> dict[str, tuple[Any, Any]]:
    """Return the hint and the default of every stored field, by name."""
    hints, stored = get_type_hints(type_, include_extras=True), {}
    for field in fields(type_):
        if field.metadata.get("stored", True):
            made = field.default if field.default_factory is MISSING else field.default_factory()
            stored[field.name] = hints[field.name], made
    return stored


@cache
def bodies(kind: object) -> dict[str, type]:
    """Return the dataclasses that can stand in a field of the type `Body` (models) or `Fit` (fits),
    by the name of the kind of model. The result is empty for any other type.
    """
    if kind not in (Body, Fit):
        return {}
    return {
        model_kind.name: type_
        for model_kind in kinds()
        if (type_ := model_kind.body if kind is Body else model_kind.fit)
    }


def step_to(key: object, place: int) -> str:
    """Return the part of a path that leads to a member of a mapping: the key of the member, or, if
    the key begins with a digit or contains other characters than letters, digits and `_`, the
    number of the member.
    """
    name = str(key)
    return name if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name) else f"{place:03d}"


def shared_path(path: str) -> str:
    """Return the path of the dataset that all members of a list share for one of their arrays. It
    is the path of the array in one member, with `all` instead of the number of the member:
    `pieces/all/theta` for `pieces/003/theta`. Only members of `others` (further outputs) have
    separate datasets, because their units differ.
    """
    return re.sub(r"(?<!/others)/\d{3,}(?=/|$)", "/all", path)


def hints_of_members(hint: Hint, count: int) -> Sequence[Any]:
    """Return the type hint of each member of a tuple that has `count` members."""
    each = [hint.inner[0]] * count
    # in a damaged file, a tuple can have more or fewer members than its type hint
    return each if hint.inner[1:] == (...,) else [*hint.inner, *each][:count]


# Writing ----------------------------------------------------------------------------------------


def units_of(record: object) -> Units:
    """Return the units of the quantities in an object, by name. They are needed for fields whose
    unit is that of a quantity: the type hint of such a field has the name of the quantity in
    brackets, for example `[target]`, and `resolved` replaces the name by the unit.
    """
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
    """Return `unit` with every known `[name]` replaced by the unit of the quantity `name`. If a
    power follows, a compound unit is put in parentheses: `[x]^2` becomes `(N*m)^2`.
    """

    def known(match: re.Match[str]) -> str:
        name, power = match.groups()
        unit = units.get(name, f"[{name}]")
        return f"({unit}){power}" if power and re.search(r"[*/ ^]", unit) else f"{unit}{power}"

    return re.sub(r"\[([^\]]*)\](\^?)", known, unit)


def encoded(
    value: object,
    hint: object,
    put: Put,
    units: Units,
    path: str = "",
    outer: tuple[str, str] = ("", ""),
) -> object:
    """Return a value as objects that JSON can represent. Arrays are passed to `put`, which stores
    them at their paths and returns references to them.

    `outer` holds the description and unit of the field to which the value belongs.
    """
    if value is None or isinstance(value, SCALARS):
        return _scalar(value)
    form = taken_apart(hint)
    label = (form.description, form.unit) if form.description else outer
    if form.kind is Union:
        return encoded(value, form.inner[0], put, units, path, label)
    if isinstance(value, np.ndarray):
        return put(path, value, label[0], resolved(label[1] or "1", units))
    if is_dataclass(value):
        known = {**({"target": label[1]} if label[1] else {}), **units_of(value)}
        units = {**units, **{name: resolved(unit, units) for name, unit in known.items()}}
        document: dict[object, object] = {}
        for word in (word for word, body in bodies(form.kind).items() if body is type(value)):
            document["kind"] = word
        for name, (inner, default) in stored_fields(type(value)).items():  # type: ignore[arg-type]
            member = getattr(value, name)
            if not _same(member, default):
                document[name] = encoded(member, inner, put, units, f"{path}/{name}")
        return document
    if isinstance(value, range):
        return [value.start, value.stop]

    def part(key: object, step: str, member: object, member_hint: object) -> object:
        at = (label[0], label[1].replace("*", str(key)))
        return encoded(member, member_hint, put, units, f"{path}/{step}", at)

    if isinstance(value, Mapping):
        return {
            _scalar(key): part(key, step_to(key, i), member, form.inner[1])
            for i, (key, member) in enumerate(value.items())
        }
    if isinstance(value, tuple):
        hints = hints_of_members(form, len(value))
        return [part(i, f"{i:03d}", *pair) for i, pair in enumerate(zip(value, hints, strict=True))]
    raise TypeError(f"{path}: {type(value).__name__} cannot be stored")


SCALARS = (bool, int, float, str)


def _same(value: object, default: object) -> bool:
    """Return True if a value equals the default. Here, NaN equals NaN."""
    return (
        default is not MISSING
        and not isinstance(value, np.ndarray)
        and bool(value == default or (value != value and default != default))
    )


def _scalar(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, str) and not is_one_line(value):
        fault = f"the name {value!r} cannot be stored: it is not one line of valid text"
        raise DataError(fault, "rename the file or column that has this name")
    return value
