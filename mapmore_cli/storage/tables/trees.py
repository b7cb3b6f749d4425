"""The arrays of a file that holds trees of them, as `init` sees them: which belong to one log, and what its clock is."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.members import EVERY, Member, as_numbers
from mapmore_cli.storage.tables.reader import Top

DEEPEST = 4  # members of members
MOST_ARRAYS = 500
WIDEST = 64  # columns of a matrix that is a table
RATES = {"fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "framerate"}
STEPS = {"dt", "ts", "h", "sampletime", "samplingtime", "timestep"}


@dataclass(frozen=True)
class Found:
    """A column: its `address`, its `title` (None for one of a matrix), the `group` it lies in, its length, and its first values."""

    address: str
    title: str | None
    group: str
    length: int
    values: Array


def top_of(top: Member, most: int, separator: str = "/") -> Top:
    """The first rows of the log in a tree of arrays: of the group with the longest columns, of at least two.

    Groups of the same members, and elements of an array, are recordings (`root` ends in `[*]`) of which the first one is shown. A
    number named `fs` or `dt` is the log's `sample_time`.
    """
    shown = ((root, list(_columns(base, "", separator, most))) for root, base in (*_roots(top, "", separator), (None, top)))
    root, columns = next((one for one in shown if len(_log(one[1])) > 1), (None, []))
    log = _log(columns)
    step = _sample_time(column for column in columns if column.length == 1)
    settings = {key: value for key, value in (("root", root), ("sample_time", step)) if value is not None}
    titles = [column.title for column in log]
    rows = [*([] if None in titles else [titles]), *zip(*(column.values.tolist() for column in log), strict=True)]
    return Top(rows, _is_number, settings, tuple(column.address for column in log))


def _log(columns: Sequence[Found]) -> list[Found]:
    """The columns of one length that lie together, the longest of these; those of one length from anywhere where none lie together."""
    long = [column for column in columns if column.length > 1]
    for key in (lambda column: (column.length, column.group), lambda column: (column.length, "")):
        logs: dict[tuple[int, str], list[Found]] = {}
        for column in long:
            logs.setdefault(key(column), []).append(column)
        together = [log for log in logs.values() if len(log) > 1]
        if together:
            return max(together, key=lambda log: (log[0].length, len(log)))
    return []


def _is_number(cell: Any) -> bool:
    return isinstance(cell, float)


def _roots(here: Member, address: str, separator: str, depth: int = 0) -> Iterator[tuple[str, Member]]:
    """The places whose elements may be recordings, with the first one of each."""
    members = {name: member for name in here.names[:MOST_ARRAYS] if (member := _member(here, name)) is not None}
    groups = bool(here.names) and here.count is not None and len(here.names) > 1 and _alike([members.get(name) for name in here.names])
    if here.count and (groups or not here.names):
        yield f"{address}{EVERY}", here.element(0)
    elif depth < DEEPEST:
        for name, member in members.items():
            yield from _roots(member, f"{address}{separator}{name}" if address else name, separator, depth + 1)


def _alike(members: Sequence[Member | None]) -> bool:
    """True for groups of the same names."""
    names = [tuple(sorted(one.names)) if one is not None else () for one in members]
    return bool(names[0]) and len(set(names)) == 1


def _member(here: Member, name: str) -> Member | None:
    """A member; None where it is nothing that can be read, or that an address leads to."""
    if re.search(r"[./\[\]]", name) or name != name.strip():
        return None
    try:
        return here.member(name)
    except DataError:
        return None


def _columns(here: Member, address: str, separator: str, most: int, depth: int = 0) -> Iterator[Found]:
    """Every column of numbers in a tree, up to a depth; collections other than groups are left out."""
    if here.is_array:
        yield from _of_array(here, "", address, "", most)
    for name in here.names[:MOST_ARRAYS]:
        member = _member(here, name)
        if member is None:
            continue
        place = f"{address}{separator}{name}" if address else name
        if member.is_array:
            yield from _of_array(member, name, place, address, most)
        elif depth < DEEPEST:
            yield from _columns(member, place, separator, most, depth + 1)


def _of_array(member: Member, name: str, address: str, group: str, most: int) -> Iterator[Found]:
    """The columns of an array: itself, or those of a matrix."""
    long = [length for length in member.shape if length != 1]
    matrix = len(member.shape) == 2 and len(long) == 2 and min(long) <= WIDEST
    if len(long) > 1 and not matrix:
        return
    across = matrix and member.shape[0] < member.shape[1]
    length = max(long, default=1)
    first = slice(0, most)
    try:
        if not matrix:
            axis = member.shape.index(length) if long else 0
            values = as_numbers(member.values((*(slice(None),) * axis, first) if member.shape else ()), address).reshape(-1)
            yield Found(address, name, group, length, values)
            return
        values = as_numbers(member.values((slice(None), first) if across else (first,)), address)
    except DataError:
        return
    for place, column in enumerate(values if across else values.T):
        yield Found(f"{address}[{place},:]" if across else f"{address}[:,{place}]", None, f"{address}[]", length, np.asarray(column))


def _sample_time(numbers: Iterator[Found]) -> float | None:
    """Seconds between samples, from a number whose name says so; None where there is none."""
    for one in numbers:
        name, value = re.sub(r"[^a-z]", "", (one.title or "").casefold()), float(one.values[0])
        if value > 0 and np.isfinite(value) and name in RATES | STEPS:
            return float(f"{1 / value if name in RATES else value:.12g}")
    return None
