"""Find out for `init` which arrays of a file with a tree of arrays belong to one log. Also make the
readers of formats with a tree of arrays.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import Noted, RawTable, Reader, TableRequest, Top
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.storage.tables.members import EVERY, Member, as_numbers, tables

MOST_MEMBERS = 500  # largest number of members of a file that are examined
WIDEST = 64  # largest number of columns of a matrix that is regarded as a table
RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "framerate")
STEPS = ("dt", "ts", "h", "sampletime", "samplingtime", "timestep")

Opened = Callable[[Path, str, TableRequest | None], AbstractContextManager[Member]]
"""Function that opens the root of a file, given its name in messages; without a request, the whole
file is surveyed.
"""


def tree_reader(
    name: str,
    opened: Opened,
    suffixes: tuple[str, ...],
    column: str,
    separator: str = "/",
    by_index: bool = True,
    begins: bytes = b"",
) -> Reader:
    """Return a reader for a format whose files contain a tree of arrays. In an address, the
    `separator` stands between two names.
    """

    def read(path: Path, request: TableRequest) -> list[RawTable]:
        with opened(path, request.label, request) as top:
            return tables(top, request)

    def peek(path: Path, most: int) -> Iterable[Top]:
        with opened(path, path.name, None) as top:
            return [first_rows(top, most, separator)]

    keys = ("root", "decimal", "thousands")
    return Reader(name, read, suffixes, keys, column, by_index, peek, begins)


class TreeMember(NamedTuple):
    """A member of a tree of arrays.

    - `address`, `name`: its address in the file, and its name.
    - `group`: address of the group that contains it.
    - `unit`: its unit, if the group has a text with the name `unit` or `units`; otherwise empty.
    """

    address: str
    name: str
    group: str
    member: Member
    unit: str = ""


@dataclass(frozen=True)
class NumberColumn:
    """A column of numbers in a tree of arrays.

    - `address`: its address, as used in a spec.
    - `title`: its name in the file; None for a column of a matrix without titles.
    - `group`: address of the group that contains it.
    - `length`, `values`: its length, and its first values.
    - `noted`: information in the file about it.
    """

    address: str
    title: str | None
    group: str
    length: int
    values: Array
    noted: Noted


def first_rows(top: Member, most: int, separator: str) -> Top:
    """Return the first rows of the log in a tree of arrays. The log consists of the longest columns
    of equal length in a group; there must be at least two.

    If a file contains several recordings, the first is returned. Recordings are groups with equal
    names of members, or the elements of an array; `root` then ends with `[*]`. There may be members
    with other names beside them. If the file does not state the time step, a number named, for
    example, `fs` or `dt` gives it (`sample_time`).
    """
    places = _places(top, separator)
    root, log, columns = next(
        (
            (root, log, columns)
            for root, columns in _ways_to_read(places, separator, most)
            if (log := _log(columns))
        ),
        (None, [], []),
    )
    for name in () if log else top.names:
        # if there is no log, this raises an error that names the reason, for example an object that
        # only MATLAB can read
        top.named(name)
    steps = (column.noted.step for column in log)
    step = next(filter(None, steps), None) or _sample_time(columns)
    titles = [column.title or column.address for column in log]
    is_titled = any(column.title for column in log)
    rows = zip(*(column.values.tolist() for column in log), strict=True)
    return Top(
        [*([titles] if is_titled else []), *rows],
        lambda cell: isinstance(cell, float),
        {key: value for key, value in (("root", root), ("sample_time", step)) if value is not None},
        tuple(column.address for column in log),
        units=tuple(column.noted.unit for column in log),
    )


def _places(top: Member, separator: str) -> list[TreeMember]:
    """Return the members of a tree, level by level. At most about `MOST_MEMBERS` members are
    returned, because a tree with circular links has no end.
    """
    places = [TreeMember("", "", "", top)]
    # the loop also visits the members that it adds to this list
    for address, _, _, here, _ in places:
        for name in here.names or range(here.count or 0):
            if len(places) > MOST_MEMBERS:
                return places
            if (member := _readable(here, name)) is not None:
                part = f"[{name}]" if isinstance(name, int) else f"{separator}{name}"
                title = _title_of(here, str(name), address.partition(separator)[0])
                unit = _text_beside(here, str(name), ("unit", "units"))
                inner = f"{address}{part}".removeprefix(separator)
                places.append(TreeMember(inner, title, address, member, unit))
    return places


def _title_of(here: Member, name: str, variable: str) -> str:
    """Return the name of the quantity in a member. This is usually the name of the member itself.
    There are two exceptions:

    - If a member `data` or `values` stands beside a text `name` or `label`, this text is the name.
    - For the values of a signal that Simulink logged, it is the label of the signal, or, without a
      label, the name of its block or of the variable.
    """
    if name == "values" and "dimensions" in here.names:
        block = _text(here, "blockName").rpartition("/")[2]
        return _text(here, "label") or block or variable
    return _text_beside(here, name, ("name", "label")) or name


def _text_beside(here: Member, name: str, wanted: Sequence[str]) -> str:
    """Return the text that describes the member `name` of `here`, for example its unit. Such a text
    exists only if this member is called `data` or `values`. It is the first member of `here` that
    has one of the `wanted` names and is not empty. Otherwise, return an empty text.
    """
    if name.casefold() not in ("data", "values"):
        return ""
    names = [other for other in here.names if other.casefold() in wanted]
    return next(filter(None, (_text(here, other) for other in names)), "")


def _text(here: Member, name: str) -> str:
    """Return the text of a member; empty if it has none."""
    member = _readable(here, name)
    return str(member.values(())[0]) if member is not None and member.kind == "text" else ""


def _readable(here: Member, name: str | int) -> Member | None:
    """Return the member or element of `here`; None if it does not exist or cannot be read."""
    with suppress(DataError):
        if isinstance(name, int):
            return here.element(name)
        if name in here.names:
            return here.named(name)
    return None


def _ways_to_read(
    places: Sequence[TreeMember], separator: str, most: int
) -> Iterator[tuple[str | None, list[NumberColumn]]]:
    """Yield the ways in which a file can be read. A way consists of a value of `root`, and the
    columns below it. Ways with several recordings in the file come first; the last way is to read
    the file as one recording.
    """
    for place in places:
        with suppress(DataError):
            if (first := _first_recording(place.member)) is not None:
                yield f"{place.address}{EVERY}", _columns(_places(first, separator), most)
    yield None, _columns(places, most)


def _first_recording(here: Member) -> Member | None:
    """Return the first of several recordings in a member; None if the member does not contain
    several recordings.

    Recordings are the elements of a cell or struct array, or at least two groups with the same
    names of members. Beside these groups, there may be single values, and groups that have none of
    these names. Simulink's structs with time are no recordings, because they are signals of one
    recording.
    """
    if not here.count or not here.names:
        return here.element(0) if here.count else None
    elements = [here.element(number) for number in range(min(here.count, MOST_MEMBERS))]
    if any(max(element.shape, default=1) > 1 for element in elements):
        return None
    names = [frozenset(element.names) for element in elements]
    ((shared, count),) = Counter(filter(None, names)).most_common(1) or [(frozenset(), 0)]
    if (
        count < 2
        or {"time", "signals"} <= shared
        or any(shared & other for other in names if other != shared)
    ):
        return None
    return elements[names.index(shared)]


def _log(columns: Sequence[NumberColumn]) -> list[NumberColumn]:
    """Return the columns that belong to one log. These are the longest columns of which a group has
    at least two with equal length, and also the columns of this length in the groups around this
    group. If no group has two columns of equal length, columns of equal length from all groups are
    returned.
    """
    for together in (True, False):
        logs = Counter((column.length, column.group if together else "") for column in columns)
        several = [log for log, count in logs.items() if count > 1 and log[0] > 1]
        if several:
            length, group = max(several, key=lambda log: (log[0], logs[log]))
            log = [
                column
                for column in columns
                if column.length == length and (not together or group.startswith(column.group))
            ]
            return log if together else sorted(log, key=lambda column: column.address)
    return []


def _columns(places: Sequence[TreeMember], most: int) -> list[NumberColumn]:
    """Return all columns of numbers in `places`. Each text array or list of texts in a group may
    give the titles of the columns of a matrix in the same group.
    """
    titles = [(place.group, texts) for place in places if (texts := _texts_in(place.member))]
    return [
        column
        for place in places
        if place.member.is_array
        for column in _columns_of(
            place, most, [texts for group, texts in titles if group == place.group]
        )
    ]


def _texts_in(member: Member) -> list[str]:
    """Return the texts in a member, if it may hold the titles of the columns of a matrix: an array
    or a collection of 2 to `WIDEST` texts, all different and not empty. The list is empty for any
    other member.
    """
    size = math.prod(member.shape) if member.is_array else member.count or 0
    if member.kind == "text" or not 1 < size <= WIDEST:
        return []
    cells: list[Any] = []
    if member.is_array:
        with suppress(DataError, TypeError):
            cells = np.asarray(member.values(())).ravel().tolist()
    else:
        elements = [_readable(member, number) for number in range(size)]
        cells = [
            element.values(())[0]
            for element in elements
            if element is not None and element.kind == "text"
        ]
    texts = [cell.decode(errors="replace") if isinstance(cell, bytes) else cell for cell in cells]
    names = {text.strip() for text in texts if isinstance(text, str)} - {""}
    return [text.strip() for text in texts] if len(names) == len(texts) == size else []


def _columns_of(
    place: TreeMember, most: int, titles: Sequence[Sequence[str]] = ()
) -> Iterator[NumberColumn]:
    """Yield the columns of an array. A vector is one column, and a matrix has several columns.
    `titles` holds the lists of texts in the same group; if exactly one of them has as many texts as
    the matrix has columns, these texts are the titles of the columns.
    """
    address, title, group, member, unit = place
    noted = replace(member.noted, unit=member.noted.unit or unit)
    long = [length for length in member.shape if length != 1]
    matrix = len(member.shape) == 2 and len(long) == 2 and min(long) <= WIDEST
    if len(long) > 1 and not matrix:
        return
    length = max(long, default=1)
    along = member.shape.index(length) if long else 0
    selection = (*(slice(None),) * along, slice(0, most)) if member.shape else ()
    try:
        values = as_numbers(member.values(selection), address, CellReader(clock=True))
    except DataError:
        return
    if not matrix:
        yield NumberColumn(address, title, group, length, values.reshape(-1), noted)
        return
    columns = values if along else values.T
    fitting = [texts for texts in titles if len(texts) == len(columns)]
    names = fitting[0] if len(fitting) == 1 else [None] * len(columns)
    for number, (column, name) in enumerate(zip(columns, names, strict=True)):
        index = f"[{number},:]" if along else f"[:,{number}]"
        yield NumberColumn(f"{address}{index}", name, group, length, column, noted)


def _sample_time(columns: Iterable[NumberColumn]) -> float | None:
    """Return the time step in s. It follows from a single number in `columns` whose name means a
    sampling rate or a time step, for example `fs` or `dt`. Return None if there is no such number.
    """
    for column in columns:
        if column.length != 1:
            continue
        name, value = re.sub(r"[^a-z]", "", (column.title or "").casefold()), column.values[0]
        if 0 < value < np.inf and name in (*RATES, *STEPS):
            return float(f"{1 / value if name in RATES else value:.12g}")
    return None
