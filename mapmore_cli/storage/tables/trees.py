"""The arrays of a file that holds trees of them, as `init` sees them: which belong to one log, and what its clock is."""

from __future__ import annotations

import re
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.tables.members import EVERY, Member, as_numbers
from mapmore_cli.storage.tables.table import Top

MOST_MEMBERS = 500  # of a file that are looked at
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
    """Return the first rows of the log in a tree of arrays: of the group with the longest columns, of at least two.

    Groups of the same members, and elements of an array, are recordings (`root` ends in `[*]`) of which the first one is shown; members
    with other names may lie beside them. Logs of Simulink (`X.time` beside `X.signals.values`) are one. A number named `fs` or `dt` is the
    log's `sample_time`.
    """
    found = list(_signals(top, separator, most))
    shown = ((root, list(_columns(base, separator, most))) for root, base in (*_roots(top, separator), (None, top)))
    root, columns = (None, found) if _log(found) else next((one for one in shown if len(_log(one[1])) > 1), (None, []))
    log = _log(columns)
    for name in () if log else top.names:
        top.member(name)  # tells of an object that only its own program can read
    step = _sample_time(column for column in columns if column.length == 1)
    settings = {key: value for key, value in (("root", root), ("sample_time", step)) if value is not None}
    titles = [column.title for column in log]
    rows = [*([] if None in titles else [titles]), *zip(*(column.values.tolist() for column in log), strict=True)]
    return Top(rows, _is_number, settings, tuple(column.address for column in log))


def _signals(top: Member, separator: str, most: int) -> Iterator[Found]:
    """Yield the columns of Simulink's structs with time, titled by their labels, else by the block or the variable that they lie in."""
    places = list(_walk(top, separator))
    for one in (place for place in places if place.name == "signals"):
        of = next(place for place in places if place.address == one.group) if one.group else None
        elements = [(one.address, one.member)]
        if one.member.count is not None:
            elements = [(f"{one.address}[{number}]", one.member.element(number)) for number in range(min(one.member.count, MOST_MEMBERS))]
        for address, signal in elements:
            values = _member(signal, "values") if "values" in signal.names else None
            title = _text(signal, "label") or _text(signal, "blockName").rpartition("/")[2] or ("" if of is None else of.name)
            if values is not None and values.is_array:
                yield from (replace(column, title=title, group="") for column in _of_array(values, title, f"{address}.values", "", most))
        clock = None if of is None else _member(of.member, "time")
        if clock is not None and clock.is_array:
            yield from _of_array(clock, "time", f"{one.group}{separator}time", "", most)


def _text(member: Member, name: str) -> str:
    """Return the text of a member, of characters or of their codes; empty where there is none."""
    text = _member(member, name) if name in member.names else None
    values = np.asarray(text.values(())).reshape(-1) if text is not None and text.is_array else np.zeros(0)
    return str(values[0]) if values.dtype.kind == "U" and values.size else "".join(map(chr, values)) if values.dtype.kind == "u" else ""


def _log(columns: Sequence[Found]) -> list[Found]:
    """Return the columns of one length that lie together, the longest of these; where none lie together, those of one length anywhere."""
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


def _roots(top: Member, separator: str) -> Iterator[tuple[str, Member]]:
    """Yield the places whose elements may be recordings, with the first one of each."""
    for address, here in (("", top), *((one.address, one.member) for one in _walk(top, separator))):
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


@dataclass(frozen=True)
class _Place:
    """A member below the top, by its address, its name and the address of the group that it lies in."""

    address: str
    name: str
    group: str
    member: Member


def _walk(top: Member, separator: str) -> Iterator[_Place]:
    """Yield the members below the top, level by level; so many of them, as links may lead in circles."""

    def below() -> Iterator[_Place]:
        waiting = deque([("", top)])
        while waiting:
            group, here = waiting.popleft()
            for name in here.names:
                member = _member(here, name)
                if member is not None:
                    address = f"{group}{separator}{name}" if group else name
                    yield _Place(address, name, group, member)
                    waiting.append((address, member))

    return islice(below(), MOST_MEMBERS)


def _member(here: Member, name: str) -> Member | None:
    """Return a member; None where it is nothing that can be read, or that an address leads to."""
    if re.search(r"[./\[\]]", name) or name != name.strip():
        return None
    try:
        return here.member(name)
    except DataError:
        return None


def _columns(top: Member, separator: str, most: int) -> Iterator[Found]:
    """Every column of numbers in a tree; collections other than groups are left out."""
    if top.is_array:
        yield from _of_array(top, "", "", "", most)
    for one in _walk(top, separator):
        if one.member.is_array:
            yield from _of_array(one.member, one.name, one.address, one.group, most)


def _of_array(member: Member, name: str, address: str, group: str, most: int) -> Iterator[Found]:
    """Yield the columns of an array: itself, or those of a matrix."""
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
