"""What `init` sees of a file that holds a tree of arrays: which of them belong to one log, and the
reader that every format of trees has.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import Noted, RawTable, Reader, TableRequest, Top
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.storage.tables.members import EVERY, Member, as_numbers, tables

MOST_MEMBERS = 500  # of a file that are looked at
WIDEST = 64  # columns of a matrix that is a table
RATES = ("fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "framerate")
STEPS = ("dt", "ts", "h", "sampletime", "samplingtime", "timestep")

Opened = Callable[[Path, str, TableRequest | None], AbstractContextManager[Member]]
"""Opens the top of a file that messages call so; without a request, all of it is looked at."""


def tree_reader(
    name: str,
    opened: Opened,
    suffixes: tuple[str, ...],
    column: str,
    separator: str = "/",
    by_index: bool = True,
) -> Reader:
    """Return the reader of a format of trees, whose addresses have the `separator`."""

    def read(path: Path, request: TableRequest) -> list[RawTable]:
        with opened(path, request.label, request) as top:
            return tables(top, request)

    def peek(path: Path, most: int) -> Iterable[Top]:
        with opened(path, path.name, None) as top:
            return [first_rows(top, most, separator)]

    return Reader(name, read, suffixes, ("root",), column, by_index, peek)


class Place(NamedTuple):
    """A member of a tree: its address, its name, the address of its group, and itself."""

    address: str
    name: str
    group: str
    member: Member


@dataclass(frozen=True)
class Column:
    """A column of numbers.

    - `address`, `title`: how a spec names it, and its name; None for a column of a matrix.
    - `group`: the address of what it lies in.
    - `length`, `values`: its length, and its first values.
    - `noted`: what the file says of it.
    """

    address: str
    title: str | None
    group: str
    length: int
    values: Array
    noted: Noted = field(default_factory=Noted)


def first_rows(top: Member, most: int, separator: str = "/") -> Top:
    """Return the first rows of the log in a tree of arrays: of the group with the longest columns,
    of at least two.

    Groups of the same members, and elements of an array, are recordings (`root` ends in `[*]`) of
    which the first one is shown; members with other names may lie beside them. Logs of Simulink
    (`X.time` beside `X.signals.values`) are one. A number named `fs` or `dt` is the log's
    `sample_time`, where the file notes none.
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
        top.member(name)  # tells of an object that only its own program can read
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


def _places(top: Member, separator: str) -> list[Place]:
    """Return a tree's members level by level; so many of them, as links may lead in circles."""
    places = [Place("", "", "", top)]
    for group in places:  # which grows meanwhile
        for name in group.member.names:
            if len(places) > MOST_MEMBERS:
                return places
            if (member := _readable(group.member, name)) is not None:
                address = f"{group.address}{separator}{name}" if group.address else name
                places.append(Place(address, name, group.address, member))
    return places


def _readable(here: Member, name: str) -> Member | None:
    """Return a member; None where there is none, or nothing that can be read."""
    if name not in here.names:
        return None
    try:
        return here.member(name)
    except DataError:
        return None


def _ways_to_read(
    places: Sequence[Place], separator: str, most: int
) -> Iterator[tuple[str | None, list[Column]]]:
    """Yield `root` and the columns below it: of Simulink's logs, of recordings, and of the file."""
    yield None, list(_simulink_columns(places, separator, most))
    for place in places:
        with suppress(DataError):
            if (first := _first_recording(place.member)) is not None:
                yield f"{place.address}{EVERY}", _columns(_places(first, separator), most)
    yield None, _columns(places, most)


def _first_recording(here: Member) -> Member | None:
    """Return the first element of an array, or the first of two groups or more of the same names.

    Beside these may be single values, and groups that have none of these names.
    """
    if not here.count or not here.names:
        return here.element(0) if here.count else None
    elements = [here.element(number) for number in range(min(here.count, MOST_MEMBERS))]
    if any(max(element.shape, default=1) > 1 for element in elements):
        return None
    names = [frozenset(element.names) for element in elements]
    ((shared, count),) = Counter(filter(None, names)).most_common(1) or [(frozenset(), 0)]
    if count < 2 or any(shared & own for own in names if own != shared):
        return None
    return elements[names.index(shared)]


def _simulink_columns(places: Sequence[Place], separator: str, most: int) -> Iterator[Column]:
    """Yield the columns of structs with time, titled by their labels, else by the block or the
    variable that they lie in.
    """
    groups = {place.address: place for place in places}
    for address, name, group, signals in places:
        if name != "signals" or not group:
            continue
        count = min(signals.count or 0, MOST_MEMBERS)
        elements = {f"{address}[{i}]": signals.element(i) for i in range(count)}
        for place, signal in (elements or {address: signals}).items():
            block = _text(signal, "blockName").rpartition("/")[2]
            title = _text(signal, "label") or block or groups[group].name
            values = _readable(signal, "values")
            if values is not None and values.is_array:
                columns = _columns_of(Place(f"{place}.values", title, "", values), most)
                yield from (replace(column, title=title, group="") for column in columns)
        clock = _readable(groups[group].member, "time")
        if clock is not None and clock.is_array:
            yield from _columns_of(Place(f"{group}{separator}time", "time", "", clock), most)


def _text(here: Member, name: str) -> str:
    """Return the text of a member, of characters or of their codes; empty where there is none."""
    member = _readable(here, name)
    if member is None or not member.is_array:
        return ""
    letters = np.asarray(member.values(())).reshape(-1)
    if letters.dtype.kind == "u":
        return "".join(map(chr, letters))
    return str(letters[0]) if letters.dtype.kind == "U" and letters.size else ""


def _log(columns: Sequence[Column]) -> list[Column]:
    """Return the columns of one length that lie together, the longest of these; where none lie
    together, those of one length anywhere.
    """
    for together in (True, False):
        logs = defaultdict[tuple[int, str], list[Column]](list)
        for column in columns:
            if column.length > 1:
                logs[column.length, column.group if together else ""].append(column)
        if several := [log for log in logs.values() if len(log) > 1]:
            return max(several, key=lambda log: (log[0].length, len(log)))
    return []


def _columns(places: Sequence[Place], most: int) -> list[Column]:
    """Return every column of numbers; collections other than groups are left out."""
    return [
        column for place in places if place.member.is_array for column in _columns_of(place, most)
    ]


def _columns_of(place: Place, most: int) -> Iterator[Column]:
    """Yield the columns of an array: itself, or those of a matrix."""
    address, title, group, member = place
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
        yield Column(address, title, group, length, values.reshape(-1), member.noted)
        return
    for number, column in enumerate(values if along else values.T):
        index = f"[{number},:]" if along else f"[:,{number}]"
        yield Column(f"{address}{index}", None, group, length, column, member.noted)


def _sample_time(columns: Iterable[Column]) -> float | None:
    """Return seconds between samples, from a number whose name says so; None without one."""
    for column in columns:
        if column.length != 1:
            continue
        name, value = re.sub(r"[^a-z]", "", (column.title or "").casefold()), column.values[0]
        if 0 < value < np.inf and name in (*RATES, *STEPS):
            return float(f"{1 / value if name in RATES else value:.12g}")
    return None
