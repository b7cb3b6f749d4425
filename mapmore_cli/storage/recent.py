"""Results that this process has read or written lately: at hand, as long as their files are the same.

Another file of a name is another one, and a second name of a file is the same. So a result that another process wrote anew is read.
"""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

T = TypeVar("T")

MOST = 6
"""Results that are kept, the latest ones."""

READ_BYTES = 30_000_000
"""Larger files are read each time that they are needed."""

WRITTEN_BYTES = 1_000_000
"""Larger files are read when they are needed: a copy of what was written would lie beside it in memory."""

_kept: OrderedDict[tuple[Any, ...], Any] = OrderedDict()


class Unkept(Exception):
    """A result that is to be read from its file."""


def recent(read: Callable[[Path], T], path: Path) -> T:
    """What `read` makes of a file, done again only where it is another one or large. Arrays in it are read-only."""
    try:
        now = path.stat()
    except OSError:
        return read(path)  # which says what is wrong with it
    if now.st_size > READ_BYTES:
        return read(path)
    key = _key(read, now)
    if key not in _kept:
        return _remembered(key, read(path))
    found: T = _kept[key]
    _kept.move_to_end(key)
    return found


def keep(read: Callable[[Path], T], written: os.stat_result, as_read: Callable[[], T]) -> None:
    """Have what was just written at hand; `as_read` makes what `read` would give, or raises Unkept."""
    if written.st_size <= WRITTEN_BYTES:
        with suppress(Unkept):
            _remembered(_key(read, written), as_read())


def _key(read: Callable[[Path], Any], file: os.stat_result) -> tuple[Any, ...]:
    return (read, file.st_dev, file.st_ino, file.st_mtime_ns, file.st_size)


def _remembered(key: tuple[Any, ...], found: T) -> T:
    _freeze(found)
    _kept[key] = found
    while len(_kept) > MOST:
        _kept.popitem(last=False)
    return found


def _freeze(value: Any) -> None:
    """Make the arrays in a record read-only: others will be given the same."""
    if hasattr(value, "setflags"):  # an array, without importing NumPy for commands that need none
        value.setflags(write=False)
    elif isinstance(value, Mapping):
        for part in value.values():
            _freeze(part)
    elif isinstance(value, tuple | list):
        for part in value:
            _freeze(part)
    elif is_dataclass(value):
        for part in fields(value):
            _freeze(getattr(value, part.name))
