"""Read files that contain a tree of arrays, such as MAT and HDF5 files: find the array at an
address, and combine arrays to a table. The reader of a format returns the root of the tree as a
`Member`; everything else is the same for all formats.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NoReturn

import numpy as np

from mapmore_cli.domain.arrays import Array, by_blocks
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    Cut,
    Noted,
    RawTable,
    SourceColumn,
    TableRequest,
    known_names,
)
from mapmore_cli.storage.tables.cells import DATES, CellReader, NotANumber
from mapmore_cli.storage.tables.thousands import may_be_grouped, refuse_grouped

Values = np.ndarray[Any, np.dtype[Any]]
"""Numbers, texts or time stamps as stored in a file."""

Selection = tuple[int | slice, ...]
"""An index in brackets; `:` stands for a whole axis."""

EVERY = "[*]"
_STEP = re.compile(r"(?P<separator>[./]?)(?:(?P<name>[^./\[\]]+)|\[(?P<index>[^\[\]]*)\])")


def _impossible(_: object) -> NoReturn:
    raise TypeError("the member is of another kind")


@dataclass(frozen=True)
class Member:
    """A part of a file with a tree of arrays: a struct or group with named members, a collection of
    numbered elements, or an array.

    - `kind`: description in words, such as `a struct array of 5`.
    - `names`: names of the members; empty if there are none.
    - `member`: function that returns the member with a name.
    - `count`: number of elements; None if it is no collection.
    - `element`: function that returns the element with a 0-based index.
    - `values`: for an array, function that reads a selection of it; `()` selects everything. It
      raises IndexError for a selection outside of the array.
    - `shape`: for an array, size along each axis.
    - `noted`: information in the file about an array.
    - `breaks_off`: for the root, evidence that the file is incomplete.
    """

    kind: str
    names: Sequence[str] = ()
    member: Callable[[str], Member] = _impossible
    count: int | None = None
    element: Callable[[int], Member] = _impossible
    values: Callable[[Selection], Values] = _impossible
    shape: tuple[int, ...] = ()
    noted: Noted = field(default_factory=Noted)
    breaks_off: Cut | None = None

    @property
    def is_array(self) -> bool:
        """Return True for an array, which holds values instead of members."""
        return not self.names and self.count is None

    @cached_property
    def _counts(self) -> Mapping[str, int]:
        """Number of members with each name; blanks around a name are ignored."""
        return Counter(map(str.strip, self.names))

    def named(self, name: str) -> Member:
        """Return the member with this name. Raises DataError if several members have it."""
        if (count := self._counts[name.strip()]) > 1:
            raise DataError(
                f"'{name}' occurs {count} times in {self.kind}",
                "Give each a name of its own in the program that wrote the file.",
            )
        return self.member(name)


def array_of(
    values: Callable[[Selection], Values], shape: tuple[int, ...], noted: Noted | None = None
) -> Member:
    """Return an array as a `Member`. `values` is the function that reads a selection of it."""
    return Member(
        f"an array of {size_in_words(shape)}", values=values, shape=shape, noted=noted or Noted()
    )


def size_in_words(shape: Iterable[int]) -> str:
    """Return a size in words, for example `5 x 3`."""
    return " x ".join(map(str, shape)) or "a single value"


def table_of_fields(
    fields: Sequence[str],
    shape: tuple[int, ...],
    values: Callable[[str], Callable[[Selection], Values]],
    noted: Noted | None = None,
) -> Member:
    """Return an array of records as a `Member`. Its members are the fields, each an array of the
    same `shape`. `values` returns, for the name of a field, the function that reads it.
    """
    size = size_in_words(shape)
    return Member(
        f"a table of {size}",
        fields,
        lambda name: Member(
            f"a field of {size}", values=values(name), shape=shape, noted=noted or Noted()
        ),
    )


def group_of(kind: str, names: Sequence[str], member: Callable[[str], Member]) -> Member:
    """Return a group as a `Member`. Its members can also be addressed as numbered elements, in
    natural order: run_2 before run_10.
    """

    def natural(name: str) -> list[tuple[bool, int | str]]:
        return [
            (not part.isdigit(), int(part) if part.isdigit() else part)
            for part in re.split(r"(\d+)", name)
            if part
        ]

    in_order = sorted(names, key=natural)
    group = Member(kind, names, member, len(names), lambda number: group.named(in_order[number]))
    return group


def parse_address(text: str, position: int = 0) -> tuple[str | Selection, ...]:
    """Split an address into its steps, beginning at `position` of the text. A step is a name after
    `.` or `/`, or 0-based indices in brackets. Raises DataError for a malformed address.
    """
    steps: list[str | Selection] = []
    while position < len(text):
        step = _STEP.match(text, position)
        if step is None or (step["separator"] and step["name"] is None):
            raise DataError(
                f"'{text}' is not a valid address",
                (
                    "Write names and 0-based indices, for example `run.P`, `train[3].y[:,0]` or "
                    "`group/dataset`."
                ),
            )
        steps.append(
            step["name"].strip() if step["name"] is not None else _parse_index(step["index"], text)
        )
        position = step.end()
    return tuple(steps)


def _parse_index(inside: str, text: str) -> Selection:
    parts = [part.strip() for part in inside.split(",")]
    if not all(re.fullmatch(r":|\d+", part) for part in parts):
        raise DataError(
            f"'{text}': '[{inside}]' is not a valid index",
            ("Write 0-based numbers and `:`, for example `y[:,0]`; only `root` may end in `[*]`."),
        )
    return tuple(slice(None) if part == ":" else int(part) for part in parts)


def tables(top: Member, request: TableRequest) -> list[RawTable]:
    """Return the recordings in a file with the root `top`. If `request.root` ends with `[*]`, every
    element at this address is a recording. Otherwise, there is one recording.

    Members of a group that have none of the requested columns are left out, with a warning.

    Raises DataError if an address does not exist, or if arrays are not columns of numbers. Columns
    of different lengths are handled by the gate (`gate.py`).
    """
    # this error is raised first, because other faults may only be a consequence of the incomplete
    # file
    if top.breaks_off is not None:
        top.breaks_off.refuse(request.label, request)
    root = request.root or ""
    place = root.removesuffix(EVERY)
    label = f"{request.label}:{place}" if root else request.label
    base = _follow(top, _steps_to(place, top), root, request.label)
    if place == root:
        table = _table_of_member(base, request, label)
        return [replace(table, breaks_off=top.breaks_off or table.breaks_off)]
    if base.count is None and base.names:
        elements = [base]
    else:
        elements = [base.element(i) for i in range(base.count or 0)]
    if not elements:
        raise DataError(
            f"{request.label}: `root: {root}` asks for every element of {base.kind}",
            f"Only cell arrays, struct arrays and groups have elements; write `root: {place}`.",
        )
    kept = [
        i for i, element in enumerate(elements) if not base.names or _has_some(element, request)
    ]
    recordings = [
        _table_of_member(elements[i], request, f"{label}[{i}]", i)
        for i in kept or range(len(elements))
    ]
    recordings[-1] = replace(recordings[-1], breaks_off=top.breaks_off or recordings[-1].breaks_off)
    if 0 < len(kept) < len(elements):
        left_out = (
            f"{label}: {len(elements) - len(kept)} of {len(elements)} members have none of "
            "the columns, and are left out; check `root` and the names of the columns"
        )
        recordings[0] = replace(recordings[0], doubts=(left_out,))
    return recordings


def _steps_to(column: SourceColumn, base: Member) -> tuple[str | Selection, ...]:
    """Return the steps of an address that lead from `base` to a column. A name of a member is one
    step, even if it contains characters such as `.` or `/` that otherwise separate steps.
    """
    if isinstance(column, int):
        return ((slice(None), column),)
    steps, end = list[str](), 0
    while begun := [name for name in base.names if _begins_with(column[end:], name)]:
        steps.append(max(begun, key=len))
        base = base.named(steps[-1])
        end = column.index(steps[-1], end) + len(steps[-1])
    return (*steps, *parse_address(column, end))


def _begins_with(address: str, name: str) -> bool:
    """Return True if an address begins with the name of a member, possibly after a separator."""
    begins = (0, 1) if address[:1] in ("/", ".") else (0,)
    return any(
        address.startswith(name, at) and address[at + len(name) :][:1] in ("", ".", "/", "[")
        for at in begins
    )


def _has_some(element: Member, request: TableRequest) -> bool:
    """Return True if an element may contain at least one of the requested columns. Only the first
    step of each address is examined.
    """
    for column in request.columns:
        step = next(iter(_steps_to(column, element)), None)
        if not isinstance(step, str) or step in element.names:
            return True
    return False


def _table_of_member(
    base: Member, request: TableRequest, label: str, element: int | None = None
) -> RawTable:
    """Return the requested columns below a member as a table. If their lengths differ, all are cut
    to the length of the shortest, and the table records this in `breaks_off`; `gate.py` then raises
    an error or a warning.
    """
    noted: dict[SourceColumn, Noted] = {}
    columns: dict[SourceColumn, Array] = {}
    for column in request.columns:
        values, noted[column] = _column(base, column, label, request.cells(column))
        # columns are read one by one, so that only one long column is in memory at a time
        columns[column] = by_blocks(np.asarray, values)
    refuse_other_clocks(noted, label)
    lengths = {column: len(values) for column, values in columns.items()}
    shortest, longest = min(lengths, key=lengths.__getitem__), max(lengths, key=lengths.__getitem__)
    n = lengths[shortest]
    if n == 0:
        raise DataError(f"{label}: '{shortest}' is empty", "Name an array that holds samples.")
    cut = Cut(
        f"columns of different length: '{shortest}' has {n} samples, '{longest}' has "
        f"{lengths[longest]}",
        (
            "They do not belong to one log; combine them with `join`. `missing: drop` shortens "
            "all to the length of the shortest."
        ),
        "all are shortened to the length of the shortest",
    )
    columns = {column: values[:n] for column, values in columns.items()}
    breaks_off = cut if lengths[longest] > n else _never_written(noted)
    return RawTable(columns, range(n), label, "index", element, noted=noted, breaks_off=breaks_off)


def _never_written(noted: Mapping[SourceColumn, Noted]) -> Cut | None:
    """Return evidence that the file is incomplete, if a column has values that were never written;
    otherwise None.
    """
    counts = {
        column: metadata.never_written
        for column, metadata in noted.items()
        if metadata.never_written
    }
    if not counts:
        return None
    column, count = max(counts.items(), key=lambda item: item[1])
    return Cut(
        f"{count} values of '{column}' were never written: the file has only room for them, and "
        "zeros or other fill values would be read",
        "Get the whole file again: the program that wrote it stopped early. `missing: drop` leaves "
        "these samples out.",
        "they are missing values",
    )


def refuse_other_clocks(noted: Mapping[SourceColumn, Noted], label: str) -> None:
    """Raise DataError if columns of a recording have different time steps or start times according
    to the file. Such columns were not sampled together.
    """
    timed = [(column, told) for column, told in noted.items() if told.step]
    for column, told in timed[1:]:
        name, first = timed[0]
        # rounded to 1e-6 s, the precision of a double that counts seconds since 1970
        later = round(told.start - first.start, 6)
        if not math.isclose(first.step, told.step, rel_tol=1e-6):
            what = (
                f"'{name}' was sampled every {first.step:.6g} s, '{column}' every {told.step:.6g} s"
            )
        elif abs(later / told.step) > 0.01:
            what = f"'{column}' begins {later:.6g} s after '{name}'"
        else:
            continue
        raise DataError(
            f"{label}: {what}",
            f"read '{column}' of the same file by `join`, with `sample_time: {told.step:.9g} s` "
            f"and `shift: {later:.9g} s`; or with `on: row`, if the rows of both belong together",
        )


def _column(
    base: Member, column: SourceColumn, label: str, read: CellReader
) -> tuple[Array, Noted]:
    """Return a column as numbers, (n,), and the information in the file about it. `column` is the
    address of the column below `base`, or its 0-based index. Raises DataError if there is no such
    column.
    """
    address = f"[:,{column}]" if isinstance(column, int) else column
    steps = _steps_to(column, base)
    if not steps:
        raise DataError(
            f"{label}: a column has an empty address", "Name an array, for example `run.P`."
        )
    *way, last = steps
    member = _follow(base, way, address, label)
    selection: Selection = ()
    if isinstance(last, tuple) and member.is_array:
        selection = last
    else:
        member = _step_into(member, last, address, label)
    if not member.is_array:
        raise DataError(
            f"{label}: '{address}' is {member.kind}, not an array of numbers", _further(member)
        )
    try:
        values = np.asarray(member.values(selection))
    except IndexError:
        raise DataError(
            f"{label}: '{address}' reaches beyond {member.kind}", "Indices count from 0."
        ) from None
    if sum(length > 1 for length in values.shape) > 1:
        name = address[: address.rindex("[")] if selection else address
        raise DataError(
            f"{label}: '{address}' is not one column, but an array of "
            f"{size_in_words(values.shape)}",
            f"Name the column, for example `{name}[:,0]`.",
        )
    return as_numbers(values.reshape(-1), f"{label}: '{address}'", read), member.noted


def as_numbers(values: object, what: str, read: CellReader) -> Array:
    """Convert an array to numbers in an array of the same shape. `read` is the reader for cells of
    this column; `what` is the name of the array in messages.

    Texts are read cell by cell. If the column may hold times (`read.clock`), time stamps become
    seconds since 1970, and durations become seconds, both in the unit of the column. Raises
    DataError for values that cannot be converted.
    """
    array = np.asarray(values)
    kind = array.dtype.kind
    if kind in "USO":
        numbers = np.empty(array.size)
        # each different text is read only once, because a small file may contain the same text
        # millions of times
        known = dict[Any, float]()
        for index, cell in enumerate(array.flat):
            if cell not in known:
                try:
                    known[cell] = read(cell)
                except NotANumber as odd:
                    where = f"{what} holds text, not real numbers: index {index}"
                    raise odd.at(where) from None
            numbers[index] = known[cell]
        if read.thousands is None and may_be_grouped(numbers):
            refuse_grouped(enumerate(array.flat), read.decimal, f"{what}, index {{row}}")
        return numbers.reshape(array.shape)
    if kind in "Mm" and not read.clock:
        stands = "date" if kind == "M" else "duration"
        raise DataError(f"{what}: a {stands}, not a number", DATES)
    if kind in "Mm":
        durations = array - np.datetime64(0, "s") if kind == "M" else array
        seconds = durations / np.timedelta64(1, "s") * read.second
        return np.asarray(seconds, dtype=np.float64)
    if kind not in "iuf" or (read.clock and read.format):
        words = {"c": "complex numbers", "b": "TRUE and FALSE", "V": "references or lists"}.get(
            kind, f"values of type {array.dtype}"
        )
        raise DataError(
            f"{what} holds {words}, not real numbers",
            "convert them to numbers; `format` is for text only",
        )
    return np.asarray(array, dtype=np.float64)


def _follow(top: Member, steps: Sequence[str | Selection], address: str, label: str) -> Member:
    for step in steps:
        top = _step_into(top, step, address, label)
    return top


def _step_into(here: Member, step: str | Selection, address: str, label: str) -> Member:
    if isinstance(step, str):
        if step in here.names:
            return here.named(step)
        way = "" if step == address else f" on the way to '{address}'"
        raise DataError(f"{label}: there is no '{step}'{way}", _further(here, step))
    index = step[0]
    if here.count is None or len(step) != 1 or not isinstance(index, int):
        raise DataError(
            f"{label}: the address '{address}' must choose an element of {here.kind}",
            _further(here),
        )
    if index >= here.count:
        raise DataError(
            f"{label}: there is no element {index} on the way to '{address}'",
            f"Elements are numbered from 0 to {here.count - 1}.",
        )
    return here.element(index)


def _further(here: Member, wanted: str = "") -> str:
    """Return a text for an error message that says how an address can continue after it has led to
    the member `here`.
    """
    if here.names:
        return known_names(wanted, here.names, f"{here.kind.capitalize()} has")
    if here.count is not None:
        return (
            f"It is {here.kind}: name the element, for example `[0]`, or end `root` in `[*]` "
            "to read each element as a recording."
        )
    return f"It is {here.kind}, which has no members."
