"""Survey a file with a tree of arrays for `init`: which arrays belong to one log. Also make the
reader of such formats.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables import Noted, RawTable, Reader, TableRequest, Top
from mapmore_cli.storage.tables.cells import CellReader
from mapmore_cli.storage.tables.members import EVERY, Member, as_numbers, tables

MOST_MEMBERS = 500  # largest number of members of a file that are visited
WIDEST = 64  # largest number of columns of a matrix that counts as a table
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


class Place(NamedTuple):
    """A member of a tree with its address, its name, the address of its group, and the text that
    stands beside it as its unit.
    """

    address: str
    name: str
    group: str
    member: Member
    unit: str = ""


@dataclass(frozen=True)
class Column:
    """A column of numbers.

    - `address`, `title`: its name in a spec, and its name in the file; the title of a column of a
      matrix is None.
    - `group`: address of the group that contains it.
    - `length`, `values`: its length, and its first values.
    - `noted`: what the file says about it.
    """

    address: str
    title: str | None
    group: str
    length: int
    values: Array
    noted: Noted = field(default_factory=Noted)


def first_rows(top: Member, most: int, separator: str = "/") -> Top:
    """Return the first rows of the log in a tree of arrays. The log is the group with the longest
    columns; it must have at least two columns.

    Groups with the same members, and elements of an array, are recordings (`root` ends with `[*]`),
    and the first of them is shown; members with other names may stand beside them. A number named
    `fs` or `dt` becomes the log's `sample_time` if the file does not state one.
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
        top.named(name)  # this raises an error for an object that only its own program can read
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
    """Return the members of a tree level by level, at most `MOST_MEMBERS` of them, because links
    may form circles.
    """
    places = [Place("", "", "", top)]
    for address, _, _, here, _ in places:  # the loop itself adds members to this list
        for name in here.names or range(here.count or 0):
            if len(places) > MOST_MEMBERS:
                return places
            if (member := _readable(here, name)) is not None:
                part = f"[{name}]" if isinstance(name, int) else f"{separator}{name}"
                title = _title_of(here, str(name), address.partition(separator)[0])
                unit = _text_beside(here, str(name), ("unit", "units"))
                inner = f"{address}{part}".removeprefix(separator)
                places.append(Place(inner, title, address, member, unit))
    return places


def _title_of(here: Member, name: str, variable: str) -> str:
    """Return the name of a member. For the data of a signal, this is the text in the member `name`
    or `label` beside them, if there is one. For the values of a signal that Simulink logged, it is
    the label of the signal, or otherwise the name of its block or variable.
    """
    if name == "values" and "dimensions" in here.names:
        block = _text(here, "blockName").rpartition("/")[2]
        return _text(here, "label") or block or variable
    return _text_beside(here, name, ("name", "label")) or name


def _text_beside(here: Member, name: str, wanted: Sequence[str]) -> str:
    """Return the text beside the data of a signal, in a member with one of the wanted names; empty
    for members that are no data of a signal.
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
    places: Sequence[Place], separator: str, most: int
) -> Iterator[tuple[str | None, list[Column]]]:
    """Yield the ways to read a file, each as the value of `root` and the columns below it: first
    with several recordings in the file, then with one.
    """
    for place in places:
        with suppress(DataError):
            if (first := _first_recording(place.member)) is not None:
                yield f"{place.address}{EVERY}", _columns(_places(first, separator), most)
    yield None, _columns(places, most)


def _first_recording(here: Member) -> Member | None:
    """Return the first element of an array, or the first of at least two groups with the same
    member names.

    Beside these groups, there may be single values, and groups without any of these member names.
    Simulink's structs with time are no recordings, because they are signals of one recording.
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
        or any(shared & own for own in names if own != shared)
    ):
        return None
    return elements[names.index(shared)]


def _log(columns: Sequence[Column]) -> list[Column]:
    """Return the columns that belong to one log: the longest columns of equal length in one group,
    and columns of this length in the groups that contain it. If no group has several such columns,
    return columns of equal length from anywhere.
    """
    for together in (True, False):
        logs = Counter((one.length, one.group if together else "") for one in columns)
        several = [log for log, count in logs.items() if count > 1 and log[0] > 1]
        if several:
            length, group = max(several, key=lambda log: (log[0], logs[log]))
            log = [
                one
                for one in columns
                if one.length == length and (not together or group.startswith(one.group))
            ]
            return log if together else sorted(log, key=lambda one: one.address)
    return []


def _columns(places: Sequence[Place], most: int) -> list[Column]:
    """Return every column of numbers. Collections other than groups are left out."""
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
    """Return the texts in an array or a collection of at most `WIDEST` different texts; empty for
    anything else.
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
        cells = [one.values(())[0] for one in elements if one is not None and one.kind == "text"]
    texts = [cell.decode(errors="replace") if isinstance(cell, bytes) else cell for cell in cells]
    names = {text.strip() for text in texts if isinstance(text, str)} - {""}
    return [text.strip() for text in texts] if len(names) == len(texts) == size else []


def _columns_of(place: Place, most: int, titles: Sequence[Sequence[str]] = ()) -> Iterator[Column]:
    """Yield the columns of an array: the array itself, or the columns of a matrix. If a list of
    texts beside a matrix has as many texts as the matrix has columns, these texts are the titles of
    the columns.
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
        yield Column(address, title, group, length, values.reshape(-1), noted)
        return
    columns = values if along else values.T
    fitting = [texts for texts in titles if len(texts) == len(columns)]
    own = fitting[0] if len(fitting) == 1 else [None] * len(columns)
    for number, (column, name) in enumerate(zip(columns, own, strict=True)):
        index = f"[{number},:]" if along else f"[:,{number}]"
        yield Column(f"{address}{index}", name, group, length, column, noted)


def _sample_time(columns: Iterable[Column]) -> float | None:
    """Return the seconds between samples from a number with a name such as `fs` or `dt`; None if
    there is no such number.
    """
    for column in columns:
        if column.length != 1:
            continue
        name, value = re.sub(r"[^a-z]", "", (column.title or "").casefold()), column.values[0]
        if 0 < value < np.inf and name in (*RATES, *STEPS):
            return float(f"{1 / value if name in RATES else value:.12g}")
    return None
