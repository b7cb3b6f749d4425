"""Read the options with which a person describes a folder on the command line: `--columns`,
`--target`, `--inputs`, `--hold` ...
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

from mapmore_cli.annexes.drafting.draft import Named, NamedColumn, address
from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.study.units import CANONICAL, check_unit, convert, parse_quantity

FORM = (
    'write `--columns "time:ms,_,pressure:bar,force:N"` in the order of the columns, with `_` for '
    "a column to leave out; or write `name=title:unit`"
)
# a comma inside the brackets of an array's address, as in `tip[:,0]:mm`, separates no entries
_COMMA = re.compile(r",(?![^\[(]*[\])])")
# a title in quotes may contain separators: `"Kraft, z=1":N`
_QUOTED = re.compile(r"""(?<![^,=\s])(["'])(.+?)\1(?=\s*(?:[,:=]|$))""")
_HIDDEN = 0xF0000  # private Unicode characters, which stand for separators inside quotes
_ENTRY = re.compile(r"(.*?):([^:\]]*)", re.DOTALL)
_QUANTITY = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NUMBER = r"\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_UNIT = re.compile(
    rf"(?P<unit>.*?)(?:\*(?P<scale>[+-]?{_NUMBER}))?(?P<offset>[+-]{_NUMBER})?", re.DOTALL
)


class Hold(NamedTuple):
    """Answer to the option `--hold`: the quantity that was held constant, the word beside its
    numbers in the names of files, and the unit of these numbers. The quantity `none` means that
    nothing was held constant.
    """

    name: str
    word: str = ""
    unit: str = ""


@dataclass(frozen=True)
class Answers:
    """Answers of a person; a field without an answer is None or empty.

    Attributes
    ----------
    columns
        All columns to use, by quantity. If any are named, no others are used.
    target
        Columns to predict. In an answer `name=column`, the key is the new name of the column.
        Otherwise it is the name of the column, its title, or a word of its title.
    inputs
        Inputs, in the same form; None for all columns that move.
    hold
        The quantity that was held constant.
    validate
        Held-out data: an input, `recordings`, or `last` for the last samples of each recording.
    recordings
        The columns whose values distinguish the recordings of one file.
    sample_time
        Time between samples, s, if no column is the clock.
    no_clock
        True if no column is the clock.
    group
        The column that distinguishes groups; or a word, for example `specimen`, if names of files
        distinguish them.
    length
        Length of the muscle, m.
    like
        The paper whose settings are used.
    """

    columns: Named = field(default_factory=dict)
    target: Named = field(default_factory=dict)
    inputs: Named | None = None
    hold: Hold | None = None
    validate: str | None = None
    recordings: tuple[str, ...] = ()
    sample_time: float | None = None
    no_clock: bool = False
    group: str | None = None
    length: float | None = None
    like: str | None = None

    @property
    def has_places(self) -> bool:
        """Return True if a person named at least one column by its number. The numbers are those in
        the list of columns that `init` prints for one layout.
        """
        named = [*self.columns.values(), *self.target.values(), *(self.inputs or {}).values()]
        texts = [str(column.column) for column in named] + [*self.recordings, self.group or ""]
        return any(re.fullmatch(r"\d+(\.\.\d+)?", text) for text in texts)


def answers_of(**options: str | bool | None) -> Answers:
    """Return the answers that a person gave with options of the command. Raises UsageError for an
    invalid answer.
    """
    readers: dict[str, Callable[[Any], Any]] = {
        **{name: partial(read_names, f"--{name}") for name in ("columns", "target", "inputs")},
        "hold": read_hold,
        "validate": str.strip,
        "group": read_group,
        "recordings": lambda text: tuple(part.strip() for part in _COMMA.split(text)),
        "sample_time": partial(read_positive, "--sample-time", "s", "10ms"),
        "no_clock": bool,
        "length": partial(read_positive, "--length", "m", "88mm"),
        "like": str,
    }
    values = {name: readers[name](text) for name, text in options.items() if text is not None}
    return Answers(**values)


def read_group(text: str) -> str | None:
    """Read the option `--group`, and return its text: a word such as `specimen`, or the number of a
    column. Return None for `none`. Raises UsageError if the text is neither a number nor a valid
    name.
    """
    if not text.isdecimal() and not _QUANTITY.fullmatch(text):
        raise UsageError(
            f"--group: {text!r} is not a valid name of a quantity",
            (
                "use a word of letters, digits and `_` that stands in the names of the files, for "
                "example `specimen`; or give the number of a column"
            ),
        )
    return None if text == "none" else text


def read_positive(option: str, unit: str, example: str, text: str) -> float:
    """Read a quantity from a text such as `10ms`, and return its value in `unit`. Raises UsageError
    if the text is no quantity, or if the value is infinite or not larger than zero.
    """
    remedy = f"write it as {example}"
    try:
        value = parse_quantity(text, unit)
    except SpecError as fault:
        raise UsageError(f"{option}: {fault.message}", fault.remedy or remedy) from fault
    if not 0 < value < math.inf:
        raise UsageError(f"{option}: {text} is not larger than zero", remedy)
    return value


def read_names(option: str, text: str) -> Named:
    """Read columns that are given by names, titles or numbers: `tip`, `Tip z:mm`, `7` or `tip=Tip
    z:mm`.

    In `--columns`, for example `time:ms,_,force:N`, a name without a column belongs to the column
    with the same position in the file. A text in quotes is one title, whatever it contains. Raises
    UsageError for any other form.
    """
    columns: Named = {}
    titles: list[str] = []

    def hide(quoted: re.Match[str]) -> str:
        titles.append(quoted[2])
        return chr(_HIDDEN + len(titles) - 1)

    def shown(part: str) -> str:
        return titles[ord(part) - _HIDDEN] if part and ord(part[0]) >= _HIDDEN else part

    for place, entry in enumerate(
        entry_text.strip() for entry_text in _COMMA.split(_QUOTED.sub(hide, text))
    ):
        if entry in ("", "_", "-"):
            continue
        name, column = _read_entry(option, entry)
        name = shown(name)
        if isinstance(column.column, str):
            column = replace(column, column=shown(column.column))
        if name in columns:
            raise UsageError(
                f"{option}: {name} is given twice",
                "give each column a name of its own, for example `p1` and `p2`",
            )
        if column.column == "":
            column = replace(column, column=place if option == "--columns" else address(name))
        columns[name] = column
    if not columns:
        raise UsageError(f"{option}: no column is named", f"name one, for example `{option} force`")
    return columns


def read_hold(text: str) -> Hold:
    """Read the option `--hold`, which has the form `strain`, `strain:%`, `strain=kinked:%` or
    `none`. Raises UsageError for anything else.
    """
    name, held = _read_entry("--hold", text)
    return Hold(name, str(held.column), held.unit)


def _read_entry(option: str, entry: str) -> tuple[str, NamedColumn]:
    """Read an entry `name=column:unit`, and return its name and its column. If the entry gives no
    column, the address of the column is an empty text.

    Raises UsageError for a unit that is unknown or does not suit the quantity. Also raises
    UsageError if the name must be that of a quantity, and is not valid as such.
    """
    parts = _ENTRY.fullmatch(entry)
    written, unit = (entry, "") if parts is None else parts.groups()
    name, equals, where = (part.strip() for part in written.partition("="))
    match = _UNIT.fullmatch(unit.strip())
    assert match is not None  # everything matches
    try:
        if match["unit"]:
            check_unit(match["unit"])
            convert(1.0, match["unit"], CANONICAL.get(name, match["unit"]))
    except SpecError as fault:
        raise UsageError(f"{option}: {name}: {fault.message}", fault.remedy or FORM) from fault
    is_quantity = equals or option in ("--columns", "--hold")
    if is_quantity and not _QUANTITY.fullmatch(name):
        raise UsageError(f"{option}: {name[:40]!r} is not a valid name of a quantity", FORM)
    return name, NamedColumn(
        address(where),
        match["unit"],
        scale=float(match["scale"] or 1),
        offset=float(match["offset"] or 0),
        is_called=bool(equals),
    )
