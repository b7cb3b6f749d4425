"""Files that hold trees of arrays: how an address is followed, how its arrays become a table, and
what `init` sees in them.

A format gives its top as a `Member`; the rest is the same for all.
"""

from __future__ import annotations

import math
import re
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import (
    Noted,
    RawTable,
    Reader,
    SourceColumn,
    TableRequest,
    Top,
    known_names,
)
from mapmore_cli.storage.tables.cells import DATES, CellReader, NotANumber

Selection = tuple[int | slice, ...]
"""An index in brackets, `:` being a whole axis."""

SAME_TIME = 0.01
"""Of a step between samples: by so much may columns begin apart that belong together row by row."""

EVERY = "[*]"
_STEP = re.compile(r"(?P<separator>[./]?)(?:(?P<name>[^./\[\]]+)|\[(?P<index>[^\[\]]*)\])")


def _impossible(_: Any) -> Any:
    raise TypeError("the member is of another kind")


@dataclass(frozen=True)
class Member:
    """A struct or group, a collection, or an array inside a file, as its format reads it.

    - `kind`: what it is, in words: `a struct array of 5`.
    - `names`, `member`: the names of its members, empty where it has none, and how to get one.
    - `count`, `element`: the number of its elements, None where it is no collection, and how to get
      one, from 0.
    - `values`, `shape`: for an array: reads a selection of it, `()` being all; raises IndexError.
      And its size along each axis.
    - `noted`: what the file says of an array.
    """

    kind: str
    names: Sequence[str] = ()
    member: Callable[[str], Member] = _impossible
    count: int | None = None
    element: Callable[[int], Member] = _impossible
    values: Callable[[Selection], Any] = _impossible
    shape: tuple[int, ...] = ()
    noted: Noted = field(default_factory=Noted)

    @property
    def is_array(self) -> bool:
        """True for what holds values rather than members."""
        return not self.names and self.count is None


def array_of(
    values: Callable[[Selection], Any], shape: tuple[int, ...], noted: Noted | None = None
) -> Member:
    """Return an array of that size."""
    return Member(
        f"an array of {size_in_words(shape)}", values=values, shape=shape, noted=noted or Noted()
    )


def size_in_words(shape: Iterable[int]) -> str:
    """Return a size in words, as `5 x 3`."""
    return " x ".join(map(str, shape)) or "a single value"


def group_of(kind: str, names: Sequence[str], member: Callable[[str], Member]) -> Member:
    """Return a group whose members are its elements as well, in natural order: run_2 before
    run_10.
    """

    def natural(name: str) -> list[tuple[bool, int | str]]:
        return [
            (not part.isdigit(), int(part) if part.isdigit() else part)
            for part in re.split(r"(\d+)", name)
            if part
        ]

    in_order = sorted(names, key=natural)
    return Member(kind, names, member, len(names), lambda number: member(in_order[number]))


Opened = Callable[[Path, str, TableRequest | None], AbstractContextManager[Member]]
"""Opens the top of a file that messages call so; with a request, what that does not name may be
missing.
"""


def tree_reader(
    name: str, opened: Opened, suffixes: tuple[str, ...], column: str, separator: str = "/"
) -> Reader:
    """Return the reader of a format of trees, whose addresses have the `separator`."""

    def read(path: Path, request: TableRequest) -> list[RawTable]:
        with opened(path, request.label, request) as top:
            return tables(top, request)

    def peek(path: Path, most: int) -> Iterable[Top]:
        with opened(path, path.name, None) as top:
            return [top_of(top, most, separator)]

    return Reader(name, read, suffixes, ("root",), column, peek=peek)


def parse_address(text: str) -> tuple[str | Selection, ...]:
    """Return the steps of an address: names after `.` or `/`, and 0-based indices in brackets.
    Raises DataError.
    """
    steps: list[str | Selection] = []
    position = 0
    while position < len(text):
        step = _STEP.match(text, position)
        if step is None or (step["separator"] and step["name"] is None):
            raise DataError(
                f"'{text}' is no address",
                "Write names and 0-based indices, as `run.P`, `train[3].y[:,0]` or "
                "`group/dataset`.",
            )
        steps.append(
            step["name"].strip() if step["name"] is not None else _selection(step["index"], text)
        )
        position = step.end()
    return tuple(steps)


def _selection(inside: str, text: str) -> Selection:
    parts = [part.strip() for part in inside.split(",")]
    if not all(re.fullmatch(r":|\d+", part) for part in parts):
        raise DataError(
            f"'{text}': '[{inside}]' is no index",
            "Write 0-based numbers and `:`, as `y[:,0]`; only `root` may end in `[*]`.",
        )
    return tuple(slice(None) if part == ":" else int(part) for part in parts)


def tables(top: Member, request: TableRequest) -> list[RawTable]:
    """Return the recordings below `request.root`: one, or one for every element where it ends in
    `[*]`.

    Members of a group that have none of the columns are left out, and told.

    Raises DataError for an address that leads nowhere, arrays that are not columns of numbers, and
    columns of different length.
    """
    root = request.root or ""
    base = _follow(top, parse_address(root.removesuffix(EVERY)), root, request.label)
    if not root.endswith(EVERY):
        return [_table(base, request, f"{request.label}:{root}" if root else request.label)]
    place = root.removesuffix(EVERY)
    elements = (
        [base]
        if base.count is None and base.names
        else [base.element(i) for i in range(base.count or 0)]
    )
    if not elements:
        raise DataError(
            f"{request.label}: `root: {root}` asks for every element of {base.kind}",
            f"Only cell arrays, struct arrays and groups have elements; say `root: {place}`.",
        )
    label = f"{request.label}:{place}"
    kept = [
        (i, element)
        for i, element in enumerate(elements)
        if not base.names or _has_some(element, request)
    ]
    found = [
        _table(element, request, f"{label}[{i}]", i) for i, element in (kept or enumerate(elements))
    ]
    if 0 < len(kept) < len(elements):
        told = (
            f"{label}: {len(elements) - len(kept)} of {len(elements)} members have none of "
            "the columns, and are left out"
        )
        found[0] = replace(found[0], doubts=(*found[0].doubts, told))
    return found


def _has_some(element: Member, request: TableRequest) -> bool:
    """Return True for an element in which a wanted column may be."""
    firsts = [
        parse_address(column)[:1] if isinstance(column, str) else () for column in request.columns
    ]
    return any(not first or first[0] in element.names for first in firsts)


def _table(base: Member, request: TableRequest, label: str, element: int | None = None) -> RawTable:
    noted: dict[SourceColumn, Noted] = {}
    columns = {}
    for column in request.columns:
        address = f"[:,{column}]" if isinstance(column, int) else column
        columns[column], noted[column] = _column(base, address, label, request.cells(column))
    return table_of(columns, request, label, element, noted)


def table_of(
    columns: Mapping[SourceColumn, Array],
    request: TableRequest,
    label: str,
    element: int | None,
    noted: Mapping[SourceColumn, Noted],
) -> RawTable:
    """Return the columns as a table; where records may be incomplete the shortest column ends it.
    Raises DataError.
    """
    _refuse_other_clocks(noted, label)
    lengths = {column: len(values) for column, values in columns.items()}
    shortest, longest = min(lengths, key=lengths.__getitem__), max(lengths, key=lengths.__getitem__)
    n = lengths[shortest]
    if n == 0:
        raise DataError(f"{label}: '{shortest}' is empty")
    if lengths[longest] > n and not request.incomplete:
        raise DataError(
            f"{label}: columns of different length: '{shortest}' has {n} samples, '{longest}' "
            f"has {lengths[longest]}",
            "They do not belong to one log; bring them together with `join`. `missing: drop` "
            "ends all with the shortest.",
        )
    cut = {column: values[:n] for column, values in columns.items()}
    return RawTable(cut, np.arange(n, dtype=np.int64), label, "index", element, noted=noted)


def _refuse_other_clocks(noted: Mapping[SourceColumn, Noted], label: str) -> None:
    """Raise DataError for columns that were not sampled together, as the file itself says."""
    timed = [(column, one) for column, one in noted.items() if one.step]
    for (first, one), (second, other) in zip(timed[:1] * len(timed), timed, strict=True):
        later = round(other.start - one.start, 6)  # as exact as seconds since 1970 are
        if not math.isclose(one.step, other.step, rel_tol=1e-6):
            what = (
                f"'{first}' was sampled every {one.step:.6g} s, '{second}' every {other.step:.6g} s"
            )
        elif abs(later) > SAME_TIME * abs(one.step):
            what = f"'{second}' begins {later:.6g} s after '{first}'"
        else:
            continue
        join = f"`sample_time: {other.step:.9g} s` and `shift: {later:.9g} s`"
        raise DataError(
            f"{label}: {what}",
            f"read '{second}' of the same file by `join`, with {join}; with `on: row` where "
            "row belongs to row",
        )


def _column(base: Member, address: str, label: str, read: CellReader) -> tuple[Array, Noted]:
    """Return the `(n,)` array at an address, and what the file says of it."""
    steps = parse_address(address)
    if not steps:
        raise DataError(f"{label}: a column has an empty address", "Name an array, as `run.P`.")
    selection = steps[-1] if isinstance(steps[-1], tuple) else ()
    member = _follow(base, steps[:-1] if selection else steps, address, label)
    if selection and not member.is_array:
        member, selection = _step(member, selection, address, label), ()
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
            f"{label}: '{address}' is an array of {size_in_words(values.shape)}",
            f"Say which column, as `{name}[:,0]`.",
        )
    return as_numbers(values.reshape(-1), f"{label}: '{address}'", read), member.noted


def as_numbers(values: Any, what: str, read: CellReader | None = None) -> Array:
    """Return an array as numbers of the same shape; `read` is what reads the cells of its column.

    Text is read cell by cell. Time stamps are seconds since 1970, where the column may have them.
    Raises DataError, which begins with `what`, for anything else.
    """
    read = CellReader() if read is None else read
    array = np.asarray(values)
    kind = array.dtype.kind
    if kind in "USO":
        found = np.empty(array.shape)
        for place, cell in np.ndenumerate(array):
            try:
                found[place] = read(cell)
            except NotANumber as odd:
                raise odd.at(
                    f"{what} holds text, not real numbers: index {place[0] if place else 0}"
                ) from None
        return found
    if kind == "M" and read.clock:
        return np.asarray(
            (array - np.datetime64(0, "s")) / np.timedelta64(1, "s") * read.second, dtype=np.float64
        )
    if kind == "M":
        raise DataError(f"{what}: a date stands here, not a number", DATES)
    if kind not in "iuf" or (read.clock and read.format):
        words = {"c": "complex numbers", "b": "TRUE and FALSE", "V": "references or lists"}.get(
            kind, f"values of type {array.dtype}"
        )
        raise DataError(
            f"{what} holds {words}, not real numbers", "make numbers of them; `format` is for text"
        )
    return np.asarray(array, dtype=np.float64)


def _follow(top: Member, steps: Sequence[str | Selection], address: str, label: str) -> Member:
    for step in steps:
        top = _step(top, step, address, label)
    return top


def _step(here: Member, step: str | Selection, address: str, label: str) -> Member:
    if isinstance(step, str):
        if step in here.names:
            return here.member(step)
        raise DataError(
            f"{label}: there is no '{step}' on the way to '{address}'", _further(here, step)
        )
    index = step[0]
    if here.count is None or len(step) != 1 or not isinstance(index, int):
        raise DataError(f"{label}: '{address}' wants an element of {here.kind}", _further(here))
    if index >= here.count:
        raise DataError(
            f"{label}: there is no element {index} on the way to '{address}'",
            f"Elements count from 0 to {here.count - 1}.",
        )
    return here.element(index)


def _further(here: Member, wanted: str = "") -> str:
    """Return what an address can go on with."""
    if here.names:
        return known_names(wanted, here.names, f"{here.kind.capitalize()} has")
    if here.count is not None:
        return (
            f"It is {here.kind}: say which element, as `[0]`, or end `root` in `[*]` to read "
            "every one as a recording."
        )
    return f"It is {here.kind}, which has no members."


# What `init` sees: which arrays belong to one log, and what its clock is
# ----------------------------------------------------------------

MOST_MEMBERS = 500  # of a file that are looked at
WIDEST = 64  # columns of a matrix that is a table
RATES = {"fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "framerate"}
STEPS = {"dt", "ts", "h", "sampletime", "samplingtime", "timestep"}


@dataclass(frozen=True)
class Found:
    """A column: its `address`, its `title` (None for one of a matrix), the `group` it lies in, its
    length, and its first values.
    """

    address: str
    title: str | None
    group: str
    length: int
    values: Array


def top_of(top: Member, most: int, separator: str = "/") -> Top:
    """Return the first rows of the log in a tree of arrays: of the group with the longest columns,
    of at least two.

    Groups of the same members, and elements of an array, are recordings (`root` ends in `[*]`) of
    which the first one is shown; members with other names may lie beside them. Logs of Simulink
    (`X.time` beside `X.signals.values`) are one. A number named `fs` or `dt` is the log's
    `sample_time`.
    """
    found = list(_signals(top, separator, most))
    shown = (
        (root, list(_columns(base, separator, most)))
        for root, base in (*_roots(top, separator), (None, top))
    )
    root, columns = (
        (None, found)
        if _log(found)
        else next((one for one in shown if len(_log(one[1])) > 1), (None, []))
    )
    log = _log(columns)
    for name in () if log else top.names:
        top.member(name)  # tells of an object that only its own program can read
    step = _sample_time(column for column in columns if column.length == 1)
    settings = {
        key: value for key, value in (("root", root), ("sample_time", step)) if value is not None
    }
    titles = [column.title for column in log]
    rows = [
        *([] if None in titles else [titles]),
        *zip(*(column.values.tolist() for column in log), strict=True),
    ]
    return Top(
        rows,
        lambda cell: isinstance(cell, float),
        settings,
        tuple(column.address for column in log),
    )


def _signals(top: Member, separator: str, most: int) -> Iterator[Found]:
    """Yield the columns of Simulink's structs with time, titled by their labels, else by the block
    or the variable that they lie in.
    """
    places = {
        address: (name, group, member) for address, name, group, member in _walk(top, separator)
    }
    for address, (name, group, member) in places.items():
        if name != "signals":
            continue
        variable, _, holder = places.get(group, ("", "", None))
        elements = {address: member}
        if member.count is not None:
            elements = {
                f"{address}[{number}]": member.element(number)
                for number in range(min(member.count, MOST_MEMBERS))
            }
        for place, signal in elements.items():
            values = _member(signal, "values")
            title = (
                _text(signal, "label") or _text(signal, "blockName").rpartition("/")[2] or variable
            )
            if values is not None and values.is_array:
                yield from (
                    replace(column, title=title, group="")
                    for column in _of_array(values, title, f"{place}.values", "", most)
                )
        clock = None if holder is None else _member(holder, "time")
        if clock is not None and clock.is_array:
            yield from _of_array(clock, "time", f"{group}{separator}time", "", most)


def _text(member: Member, name: str) -> str:
    """Return the text of a member, of characters or of their codes; empty where there is none."""
    text = _member(member, name)
    values = (
        np.asarray(text.values(())).reshape(-1)
        if text is not None and text.is_array
        else np.zeros(0)
    )
    return (
        str(values[0])
        if values.dtype.kind == "U" and values.size
        else "".join(map(chr, values))
        if values.dtype.kind == "u"
        else ""
    )


def _log(columns: Sequence[Found]) -> list[Found]:
    """Return the columns of one length that lie together, the longest of these; where none lie
    together, those of one length anywhere.
    """
    for together in (True, False):
        logs: dict[tuple[int, str], list[Found]] = {}
        for column in columns:
            if column.length > 1:
                logs.setdefault((column.length, column.group if together else ""), []).append(
                    column
                )
        several = [log for log in logs.values() if len(log) > 1]
        if several:
            return max(several, key=lambda log: (log[0].length, len(log)))
    return []


def _roots(top: Member, separator: str) -> Iterator[tuple[str, Member]]:
    """Yield the places whose elements may be recordings, with the first one of each."""
    for address, here in (
        ("", top),
        *((address, member) for address, _, _, member in _walk(top, separator)),
    ):
        if here.count:
            with suppress(DataError):
                first = here.element(0) if not here.names else _first_alike(here)
                if first is not None:
                    yield f"{address}{EVERY}", first


def _first_alike(here: Member) -> Member | None:
    """Return the first of two members or more that are groups of the same names; None without any.

    Beside them may be single values, and groups that have none of these names.
    """
    elements = [here.element(number) for number in range(min(here.count or 0, MOST_MEMBERS))]
    if any(max(element.shape, default=1) > 1 for element in elements):
        return None
    names = [frozenset(element.names) for element in elements]
    ((shared, count),) = Counter(own for own in names if own).most_common(1) or [(frozenset(), 0)]
    if count < 2 or any(shared & own for own in names if own != shared):
        return None
    return elements[names.index(shared)]


def _walk(top: Member, separator: str) -> Iterator[tuple[str, str, str, Member]]:
    """Yield address, name, address of the group and the member itself, level by level; so many of
    them, as links may lead in circles.
    """

    def below() -> Iterator[tuple[str, str, str, Member]]:
        waiting = deque([("", top)])
        while waiting:
            group, here = waiting.popleft()
            for name in here.names:
                member = _member(here, name)
                if member is not None:
                    address = f"{group}{separator}{name}" if group else name
                    yield address, name, group, member
                    waiting.append((address, member))

    return islice(below(), MOST_MEMBERS)


def _member(here: Member, name: str) -> Member | None:
    """Return a member; None where there is none, or nothing that can be read, or that an address
    leads to.
    """
    if name not in here.names or re.search(r"[./\[\]]", name) or name != name.strip():
        return None
    try:
        return here.member(name)
    except DataError:
        return None


def _columns(top: Member, separator: str, most: int) -> Iterator[Found]:
    """Every column of numbers in a tree; collections other than groups are left out."""
    if top.is_array:
        yield from _of_array(top, "", "", "", most)
    for address, name, group, member in _walk(top, separator):
        if member.is_array:
            yield from _of_array(member, name, address, group, most)


def _of_array(member: Member, name: str, address: str, group: str, most: int) -> Iterator[Found]:
    """Yield the columns of an array: itself, or those of a matrix."""
    long = [length for length in member.shape if length != 1]
    matrix = len(member.shape) == 2 and len(long) == 2 and min(long) <= WIDEST
    if len(long) > 1 and not matrix:
        return
    across = matrix and member.shape[0] < member.shape[1]
    length, first = max(long, default=1), slice(0, most)
    axis = 1 if across else member.shape.index(length) if long and not matrix else 0
    try:
        read = CellReader(clock=True)
        values = as_numbers(
            member.values((*(slice(None),) * axis, first) if member.shape else ()), address, read
        )
    except DataError:
        return
    if not matrix:
        yield Found(address, name, group, length, values.reshape(-1))
        return
    for place, column in enumerate(values if across else values.T):
        yield Found(
            f"{address}[{place},:]" if across else f"{address}[:,{place}]",
            None,
            f"{address}[]",
            length,
            np.asarray(column),
        )


def _sample_time(numbers: Iterator[Found]) -> float | None:
    """Seconds between samples, from a number whose name says so; None where there is none."""
    for one in numbers:
        name, value = re.sub(r"[^a-z]", "", (one.title or "").casefold()), float(one.values[0])
        if value > 0 and np.isfinite(value) and name in RATES | STEPS:
            return float(f"{1 / value if name in RATES else value:.12g}")
    return None
