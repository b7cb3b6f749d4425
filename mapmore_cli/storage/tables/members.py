"""Files that hold trees of arrays: how an address is followed, and how its arrays become a table.

A format gives its top as a `Member`; the rest is the same for all.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.table import RawTable, SourceColumn, TableRequest, known_names

Selection = tuple[int | slice, ...]
"""An index in brackets, `:` being a whole axis."""

EVERY = "[*]"
_STEP = re.compile(r"(?P<separator>[./]?)(?:(?P<name>[^./\[\]]+)|\[(?P<index>[^\[\]]*)\])")


@dataclass(frozen=True)
class Address:
    """Steps from the top of a file: names of members, and selections of elements; `text` is how the spec spells it."""

    text: str
    steps: tuple[str | Selection, ...]


def parse_address(text: str) -> Address:
    """Return the steps of an address: names after `.` or `/`, and 0-based indices in brackets. Raises DataError."""
    steps: list[str | Selection] = []
    position = 0
    while position < len(text):
        step = _STEP.match(text, position)
        if step is None or (step["separator"] and step["name"] is None):
            raise DataError(f"'{text}' is no address", "Write names and 0-based indices, as `run.P`, `train[3].y[:,0]` or `group/dataset`.")
        steps.append(step["name"].strip() if step["name"] is not None else _selection(step["index"], text))
        position = step.end()
    return Address(text, tuple(steps))


def _selection(inside: str, text: str) -> Selection:
    def one(part: str) -> int | slice:
        if part == ":":
            return slice(None)
        if re.fullmatch(r"\d+", part):
            return int(part)
        raise DataError(f"'{text}': '[{inside}]' is no index", "Write 0-based numbers and `:`, as `y[:,0]`; only `root` may end in `[*]`.")

    return tuple(one(part.strip()) for part in inside.split(","))


def _impossible(_: Any) -> Any:
    raise TypeError("the member is of another kind")


@dataclass(frozen=True)
class Member:
    """A struct or group, a collection, or an array inside a file, as its format reads it.

    - `kind`: what it is, in words: `a struct array of 5`.
    - `names`, `member`: the names of its members, empty where it has none, and how to get one.
    - `count`, `element`: the number of its elements, None where it is no collection, and how to get one, from 0.
    - `values`, `shape`: for an array: reads a selection of it, `()` being all; raises IndexError. And its size along each axis.
    """

    kind: str
    names: Sequence[str] = ()
    member: Callable[[str], Member] = _impossible
    count: int | None = None
    element: Callable[[int], Member] = _impossible
    values: Callable[[Selection], Any] = _impossible
    shape: tuple[int, ...] = ()

    @property
    def is_array(self) -> bool:
        """True for what holds values rather than members."""
        return not self.names and self.count is None


def tables(top: Member, request: TableRequest) -> list[RawTable]:
    """Return the recordings below `request.root`: one, or one for every element where it ends in `[*]`.

    Members of a group that have none of the columns are left out, and told.

    Raises DataError for an address that leads nowhere, arrays that are not columns of numbers, and columns of different length.
    """
    root = request.root or ""
    every = root.endswith(EVERY)
    base = _follow(top, parse_address(root.removesuffix(EVERY)).steps, root, request.label)
    if not every:
        return [_table(base, request, f"{request.label}:{root}" if root else request.label)]
    elements = [base] if base.count is None and base.names else [base.element(i) for i in range(base.count or 0)]
    if not elements:
        raise DataError(
            f"{request.label}: `root: {root}` asks for every element of {base.kind}",
            f"Only cell arrays, struct arrays and groups have elements; say `root: {root.removesuffix(EVERY)}`.",
        )
    label = f"{request.label}:{root.removesuffix(EVERY)}"
    kept = [(i, element) for i, element in enumerate(elements) if not base.names or _has_some(element, request)]
    found = [_table(element, request, f"{label}[{i}]", i) for i, element in (kept or enumerate(elements))]
    if 0 < len(kept) < len(elements):
        told = f"{label}: {len(elements) - len(kept)} of {len(elements)} members have none of the columns, and are left out"
        found[0] = replace(found[0], doubts=(*found[0].doubts, told))
    return found


def _has_some(element: Member, request: TableRequest) -> bool:
    """Return True for an element in which a wanted column may be."""
    firsts = [parse_address(column).steps[:1] if isinstance(column, str) else () for column in request.columns]
    return any(not first or first[0] in element.names for first in firsts)


def _table(base: Member, request: TableRequest, label: str, element: int | None = None) -> RawTable:
    columns = {column: _column(base, f"[:,{column}]" if isinstance(column, int) else column, label) for column in request.columns}
    return table_of(columns, request, label, element)


def table_of(columns: Mapping[SourceColumn, Array], request: TableRequest, label: str, element: int | None = None) -> RawTable:
    """Return the columns as a table; where records may be incomplete the shortest column ends it. Raises DataError."""
    lengths = {column: len(values) for column, values in columns.items()}
    shortest, longest = min(lengths, key=lengths.__getitem__), max(lengths, key=lengths.__getitem__)
    n = lengths[shortest]
    if lengths[longest] > n and not request.incomplete:
        raise DataError(
            f"{label}: columns of different length: '{shortest}' has {n} samples, '{longest}' has {lengths[longest]}",
            "They do not belong to one log; bring them together with `join`. `missing: drop` ends all with the shortest.",
        )
    if n == 0:
        raise DataError(f"{label}: '{shortest}' holds no samples")
    trimmed = {column: values[:n] for column, values in columns.items()}
    return RawTable(trimmed, np.arange(n, dtype=np.int64), label, "index", element)


def _column(base: Member, address: str, label: str) -> Array:
    """Return the `(n,)` array at an address."""
    steps = parse_address(address).steps
    if not steps:
        raise DataError(f"{label}: a column has an empty address", "Name an array, as `run.P`.")
    selection = steps[-1] if isinstance(steps[-1], tuple) else ()
    member = _follow(base, steps[:-1] if selection else steps, address, label)
    if selection and not member.is_array:
        member, selection = _step(member, selection, address, label), ()
    if not member.is_array:
        raise DataError(f"{label}: '{address}' is {member.kind}, not an array of numbers", _further(member))
    try:
        values = np.asarray(member.values(selection))
    except IndexError:
        raise DataError(f"{label}: '{address}' reaches beyond {member.kind}", "Indices count from 0.") from None
    if sum(length > 1 for length in values.shape) > 1:
        name = address[: address.rindex("[")] if selection else address
        raise DataError(f"{label}: '{address}' is an array of {' x '.join(map(str, values.shape))}", f"Say which column, as `{name}[:,0]`.")
    return as_numbers(values.reshape(-1), f"{label}: '{address}'")


def as_numbers(values: Any, what: str) -> Array:
    """Return an array as numbers, time stamps in seconds since 1970; DataError, which begins with `what`, for text and the like."""
    array = np.asarray(values)
    if array.dtype.kind == "M":
        return np.asarray((array - np.datetime64(0, "s")) / np.timedelta64(1, "s"), dtype=np.float64)
    if array.dtype.kind not in "biuf":
        words = {"c": "complex numbers", "U": "text", "S": "text"}.get(array.dtype.kind, f"values of type {array.dtype}")
        raise DataError(f"{what} holds {words}, not real numbers")
    return np.asarray(array, dtype=np.float64)


def _follow(top: Member, steps: Sequence[str | Selection], address: str, label: str) -> Member:
    for step in steps:
        top = _step(top, step, address, label)
    return top


def _step(here: Member, step: str | Selection, address: str, label: str) -> Member:
    if isinstance(step, str):
        if step in here.names:
            return here.member(step)
        raise DataError(f"{label}: there is no '{step}' on the way to '{address}'", _further(here, step))
    index = step[0]
    if here.count is None or len(step) != 1 or not isinstance(index, int):
        raise DataError(f"{label}: '{address}' wants an element of {here.kind}", _further(here))
    if index >= here.count:
        raise DataError(f"{label}: there is no element {index} on the way to '{address}'", f"Elements count from 0 to {here.count - 1}.")
    return here.element(index)


def _further(here: Member, wanted: str = "") -> str:
    """Return what an address can go on with."""
    if here.names:
        return known_names(wanted, here.names, f"{here.kind.capitalize()} has")
    if here.count is not None:
        return f"It is {here.kind}: say which element, as `[0]`, or end `root` in `[*]` to read every one as a recording."
    return f"It is {here.kind}, which has no members."


MOST_VALUES, RATIO = 32_000_000, 100
"""Bytes of all arrays of a file that unpacks, and beyond that how many times its own size; logs shrink to a tenth, at most a fiftieth."""


def refuse_bombs(label: str, unpacked: float, packed: int) -> None:
    """Raise DataError for a file whose arrays declare to be far more than it holds, before a value is read."""
    if unpacked > max(MOST_VALUES, RATIO * packed):
        raise DataError(f"{label}: unpacks from {packed / 1e6:.2g} MB to {unpacked / 1e6:.0f} MB", "save the measurements alone")


_read: ContextVar[dict[str, int]] = ContextVar("_read")
"""Bytes of each array of the open file that was read so far, by its name."""


def refuse_other_files(file: Any, label: str) -> None:
    """Raise DataError for an open HDF5 file with links to other files, before one is followed: they may lead anywhere on this computer."""
    from h5py import h5l

    def other(name: bytes, info: Any) -> bytes | None:
        return name if info.type == h5l.TYPE_EXTERNAL else None

    if name := file.id.links.visit(other, info=True):
        raise DataError(f"{label}: '{name.decode(errors='replace')}' is a link to another file", "name that file itself in `files`")
    _read.set({})


def own_values(dataset: Any, selection: Selection = ()) -> Any:
    """Return the dataset, of which a selection is read next.

    Raises DataError where its values lie in other files (external storage, virtual datasets), and where all that was asked for of its file
    is far larger than the file.
    """
    if dataset.external or dataset.is_virtual:
        raise DataError(f"{dataset.name} takes its values from other files", "write the values into the file itself")
    read = _read.get({})
    lengths = [1 if isinstance(one, int) else length for one, length in zip_longest(selection, dataset.shape)]
    read[f"{dataset.name}{selection}"] = math.prod(lengths) * dataset.dtype.itemsize
    refuse_bombs(dataset.name, sum(read.values()), dataset.file.id.get_filesize())
    return dataset


def check_fit(selection: Selection, shape: Sequence[int]) -> None:
    """Raise IndexError, as NumPy does and h5py does not, for a selection beyond an array of a shape."""
    if len(selection) > len(shape) or any(isinstance(i, int) and i >= n for i, n in zip(selection, shape, strict=False)):
        raise IndexError(selection)


def natural(name: str) -> list[tuple[bool, int | str]]:
    """Sort key that puts run_2 before run_10."""
    return [(not part.isdigit(), int(part) if part.isdigit() else part) for part in re.split(r"(\d+)", name) if part]
