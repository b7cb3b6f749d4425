"""Recognise a folder in which every file holds one channel, and write the command that makes one
table of these files.
"""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from shlex import quote

from mapmore_cli.annexes.drafting.names import stem_of
from mapmore_cli.storage.readers import READERS, reader_of
from mapmore_cli.storage.tables.cells import holds_number
from mapmore_cli.storage.tables.lines import head_of

MARK = BOM_UTF8.decode("latin-1")

LARGEST = 50_000_000
"""Largest size in bytes of a file that is examined."""


@dataclass(frozen=True)
class Channel:
    """A text file with one column of numbers, with or without a column of time before it. Two
    channels are equal if their columns can be written side by side into one table.

    - `title`: title of the column; empty without titles.
    - `has_title`: True if the first line holds titles instead of numbers.
    - `delimiter`: the character between the time and the numbers; empty if there is no time.
    - `clock`: the cells in the column of time; without such a column, an empty text for each row.
    """

    path: Path = field(compare=False)
    title: str = field(compare=False)
    has_title: bool
    delimiter: str
    clock: tuple[str, ...]


def command_for_one_table(folder: Path) -> str | None:
    """Return the shell command that writes the channels of a folder side by side into one table.

    Return None if this is not possible: there are fewer than two text files, one of them is no
    channel, two of them hold the same channel, they differ in their number of rows or in their
    time, or they have a time but no titles.
    """
    if not folder.is_dir():
        return None
    channels = list[Channel]()
    for file in sorted(folder.iterdir()):
        if reader_of(file) is READERS["csv"]:
            channel = _channel_in(file)
            # stop at the first file that does not fit, because a folder may have thousands of files
            if channel is None or channel != next(iter(channels), channel):
                return None
            channels.append(channel)
    if len(channels) < 2 or (channels[0].delimiter and not channels[0].has_title):
        return None
    # files with equal titles are recordings of one channel
    if channels[0].has_title and len({channel.title for channel in channels}) < len(channels):
        return None
    return _pasted(channels, f"{folder.resolve().name}.csv")


def _channel_in(file: Path) -> Channel | None:
    """Return the channel in a text file; None if the file holds something else. A file with blank
    lines or with a byte order mark is no channel, because these would remain in the table.
    """
    if file.stat().st_size > LARGEST:
        return None
    lines = file.read_text("latin-1").splitlines()
    if not lines or not lines[0].strip() or lines[0].startswith(MARK):
        return None
    delimiter = next((mark for mark in "\t;," if mark in lines[-1]), "")
    rows = [line.split(delimiter) if delimiter else [line] for line in lines]
    title = [cell for cell in rows[0] if not holds_number(cell)]
    wide = 2 if delimiter else 1
    numbers = rows[1:] if title else rows
    if len(numbers) < 2 or any(len(row) != wide for row in rows):
        return None
    if not all(holds_number(cell) for row in numbers for cell in row):
        return None
    clock = tuple(row[0] if delimiter else "" for row in rows)
    return Channel(file, rows[0][-1] if title else "", bool(title), delimiter, clock)


def _pasted(channels: Sequence[Channel], table: str) -> str:
    """Return the command that writes the channels side by side, after the time of the first."""
    first, *others = channels
    # without `-d`, `paste` and `cut` separate columns by tabs
    mark = "" if first.delimiter in ("", "\t") else f" -d{quote(first.delimiter)}"
    names = [quote(str(channel.path)) for channel in others]
    rest = [f"<(cut{mark} -f2 {name})" for name in names] if first.delimiter else names
    pasted = " ".join([f"paste{mark}", quote(str(first.path)), *rest])
    if not first.has_title:
        titles = "\\t".join(stem_of(channel.path.name) for channel in channels)
        pasted = f"(printf '%b\\n' {quote(titles)}; {pasted})"
    if any(b"\r" in head_of(channel.path) for channel in channels):
        pasted = f"{pasted} | tr -d '\\r'"
    return f"{pasted} > {quote(table)}"
