"""Examine the first lines of a file to find out which reader reads it, which lines are alike, and
whether comments or labels stand among its numbers.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mapmore_cli.annexes.drafting.layout import FileLayout
from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.readers import reader_of, suffix_of
from mapmore_cli.storage.tables import Top
from mapmore_cli.storage.tables.cells import stamp_of

# a cell with a name and a number, as microcontrollers print it: `t:12`
_LABELLED = re.compile(r"\s*[A-Za-z_]\w*\s*[:=]\s*[-+]?[.\d]\S*")

LINES = 200  # largest number of lines of a table that `init` reads
HEAD = 1 << 16  # number of bytes at the beginning of a text that are examined

_NUMBERS = re.compile(rb"[\s\"']*[-+.\d]")
_DIGITS = re.compile(rb"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
COMMENT = re.compile(rb"[ \t]*(#|%|//)")
"""Beginning of a line that is a comment, with its mark."""

UNREAD = {
    "zip 7z rar tar tgz zst": "unpack it",
    "mf4 mdf": "export it as CSV, for example with `asammdf.MDF(path).export('csv')`",
    "json ndjson jsonl": (
        "save a table, for example with `pandas.json_normalize(records).to_csv(...)`"
    ),
    "npy": "save each array with a name, for example with `numpy.savez('log.npz', force=force)`",
    "pkl pickle joblib": (
        "it is never opened, because it could run code; save its arrays as CSV or .npz"
    ),
    "bag db3 mcap": "export its topics as CSV with the tools of ROS",
    "feather arrow orc": (
        "save it as Parquet, for example with `pandas.read_feather(path).to_parquet(...)`"
    ),
    "db sqlite mdb accdb numbers wav c3d bin raw": "export its table as CSV",
}
"""Suffixes of files that may contain data but that no reader can read, and the remedy for each."""


def unread(path: Path) -> str | None:
    """Return the reason why a file that may hold data is not read, with the remedy. Return None for
    a file that a reader can read, and for a file that holds no data.
    """
    suffix = suffix_of(path)
    remedy = next((how for which, how in UNREAD.items() if suffix[1:] in which.split()), None)
    if remedy is None or reader_of(path) is not None:
        return None
    return f"{path.name}: no reader takes {suffix}; {remedy}"


def kinds_of_lines(path: Path) -> tuple[bytes, ...]:
    """Return the distinct lines at the beginning of a text, with 0 in place of each number in lines
    of numbers. Texts with equal results have the same layout, so only one of them is examined. The
    result is empty for a file that is no text.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    if b"\0" in head or not head:
        return ()
    lines = head.splitlines()[: LINES + 1]
    lines = lines if len(head) < HEAD else lines[:-1]
    kinds = (_DIGITS.sub(b"0", line) if _NUMBERS.match(line) else line for line in lines)
    return tuple(dict.fromkeys(kinds))


def comment_among(path: Path, layout: FileLayout) -> str | None:
    """Return the characters with which comment lines between the rows of a text begin; None if
    there are no such lines. If the line of titles begins with these characters, too, return None as
    well, because the titles would be skipped as a comment.
    """
    titled = layout.settings.get("skip_rows", 0)
    with path.open("rb") as lines:
        for number, line in enumerate(lines):
            if number >= titled and (comment := COMMENT.match(line)):
                return comment[1].decode() if number > titled else None
    return None


def refuse_serial(path: Path, tops: Sequence[Top]) -> None:
    """Raise DataError for a text that was copied from a serial monitor, if its cells have the form
    `name:number`, or if an arrow stands between the time and the values. The message contains a
    `sed` command that makes a table of the text: it writes the names into the first line only, or
    replaces the arrow by a separator.
    """
    for top in (top for top in tops if top.rows and len(top.rows[len(top.rows) // 2]) > 1):
        cells = [*map(str, top.rows[len(top.rows) // 2])]
        mark = top.settings.get("delimiter", ",")
        begin = " ".join(cells[:3]) if mark == "whitespace" else cells[0]
        time, _, value = begin.partition(" -> ")
        if _NUMBERS.match(value.encode()) and stamp_of(time) is not None:
            between = {"tab": r"\t", "whitespace": " "}.get(mark, mark)
            how = rf"sed -n 's/ -> \([-+.0-9]\)/{between}\1/p'"
            problem = (
                "an arrow stands between the time and the values; write their separator instead"
            )
        elif all(map(_LABELLED.fullmatch, cells)):
            titles = "1{h;s/ *[:=] *[^,;[:space:]]*//g;p;g;}"
            how = f"sed -E '{titles};s/[A-Za-z_][A-Za-z_0-9]* *[:=] *//g'"
            problem = (
                "its cells have the form `name:number`; write the names into the first line only"
            )
        else:
            continue
        line = f"{how} '{path.name}' > '{path.stem}_table.csv'"
        raise DataError(f"{path.name}: {problem}, for example with: {line}")
