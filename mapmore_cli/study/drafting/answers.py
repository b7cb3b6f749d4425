"""What a person says of a folder: on the line (`--columns ...`), or when asked."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.spec.units import CANONICAL, check_unit, convert

FORM = 'write `--columns "time:ms,_,pressure:bar,force:N"` by place, or `name=title:unit`; `_` leaves a column out'
_QUANTITY = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_NUMBER = r"[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?"
_UNIT = re.compile(rf"(?P<unit>.*?)(?:\*(?P<scale>{_NUMBER}))?(?P<offset>[+-]\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)?", re.DOTALL)


@dataclass(frozen=True)
class ToldColumn:
    """One column as a person says it: the quantity is `value * scale + offset` in `unit`; the unit is None where nothing is said."""

    column: str | int
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Answers:
    """What is known before anything is guessed; None and empty where nothing is said.

    Attributes
    ----------
    columns
        All columns that are used, by quantity. Where some are named, no other is guessed.
    target, hold
        The quantity to predict, and the one that was held; `none` says that nothing was.
    group
        What the words of names tell apart, which else are studies of their own: files are one study, and the quantity of that name
        numbers its groups; `none` pools them.
    length
        Of the muscle, m.
    confirmed
        Places of the draft whose guesses were accepted.
    """

    columns: Mapping[str, ToldColumn] = field(default_factory=dict)
    target: str | None = None
    hold: str | None = None
    group: str | None = None
    length: float | None = None
    confirmed: frozenset[tuple[str | int, ...]] = frozenset()

    def for_columns(self, columns: Sequence[str | int], width: int) -> Answers | None:
        """Return the answers about a table with these columns; None where it has none of them."""
        places = {name: told for name, told in self.columns.items() if isinstance(told.column, int)}
        titles = {name: told for name, told in self.columns.items() if told.column in columns and name not in places}
        if any(int(told.column) >= width for told in places.values()):
            places = {}
        found = {
            name: replace(told, column=columns[told.column]) if isinstance(told.column, int) else told
            for name, told in (places | titles).items()
        }
        return replace(self, columns={name: found[name] for name in self.columns if name in found}) if found or not self.columns else None


def read_columns(text: str) -> dict[str, ToldColumn]:
    """Read `time:ms,_,force:N` by place, or `force=Load:N` by title or place; UsageError for what is neither."""
    found: dict[str, ToldColumn] = {}
    for place, entry in enumerate(one.strip() for one in text.split(",")):
        if entry in ("", "_", "-"):
            continue
        name, equals, rest = entry.partition("=")
        where, _, unit = rest.rpartition(":") if equals and ":" in rest else (rest, "", "")
        if not equals:
            name, _, unit = entry.partition(":")
        name = name.strip()
        if not _QUANTITY.fullmatch(name):
            raise UsageError(f"--columns: {name[:40]!r} is no name of a quantity", FORM)
        if name in found:
            raise UsageError(f"--columns: {name} is said twice", "give each column a name of its own, as `p1` and `p2`")
        column: str | int = (int(where) if where.strip().isdigit() else where.strip()) if equals else place
        found[name] = told_column(name, column, unit.strip())
    if len([name for name in found if name != "time"]) < 2:
        raise UsageError("--columns: two columns are needed, one that drives and one that follows", FORM)
    return found


def told_column(name: str, column: str | int, unit: str) -> ToldColumn:
    """Return the column in a unit such as `bar`, `N*1.744-18.6` (scale and offset) or ``; UsageError for a unit that cannot be."""
    match = _UNIT.fullmatch(unit)
    assert match is not None  # everything matches
    try:
        if match["unit"]:
            check_unit(match["unit"])
            convert(1.0, match["unit"], CANONICAL.get(name, match["unit"]))
    except SpecError as fault:
        raise UsageError(f"--columns: {name}: {fault.message}", fault.remedy or FORM) from fault
    return ToldColumn(column, match["unit"] or None, float(match["scale"] or 1), float(match["offset"] or 0))


NOTHING_SAID = Answers()
