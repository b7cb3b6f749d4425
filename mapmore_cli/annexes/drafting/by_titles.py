"""Find names and purposes of columns from their titles and units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np

from mapmore_cli.annexes.drafting.clocks import clock_in_parts
from mapmore_cli.annexes.drafting.columns import KINDS, Table, TitledColumn, unit_of_clock
from mapmore_cli.annexes.drafting.draft import Column, Named, NamedColumn
from mapmore_cli.annexes.drafting.name_numbers import is_repeat
from mapmore_cli.annexes.drafting.spelling import words
from mapmore_cli.checking.evidence import same_signals
from mapmore_cli.checking.names import POSITIONS, read_label

_LETTER = re.compile(r"(?<![^\W_])[A-Za-z](?![^\W_])")
_NUMBERED_PRESSURE = re.compile(r"p(?:ressure)?_?[A-Za-z0-9]", re.IGNORECASE)
_NO_MEASUREMENT = {
    *("simulated", "simulation", "sim", "model", "modelled", "predicted", "prediction", "fitted"),
    *("estimated", "estimate", "theoretical", "calculated", "residual"),
}
"""Words in the titles of columns that were computed instead of measured."""

Known = tuple[Named, dict[Column, str]]
"""The known columns by their names, the clock first, and the reasons why other columns are left
out.
"""


def known_by_titles(table: Table) -> Known:
    """Return the time and the other columns whose values change, by name. The name of a column is
    the quantity that its title identifies, otherwise a name made from the title. Also return the
    reason for each column that is left out.

    If several titles identify the same quantity, only the column with the plainest title gets the
    name of the quantity; the names of the others are made from their titles. A linear function of
    another column, a column that was computed as its title says, and a column that increases like a
    clock but is not the time are left out.
    """
    columns: Named = {}
    clocks = (
        column for column in table.values() if column.is_time and column.rises and not column.turn
    )
    if parts := clock_in_parts(table):
        why = "titles: a clock in parts, which are added"
        columns["time"] = NamedColumn(next(iter(parts)), why=why, parts=parts)
    elif (clock := next(clocks, None)) is not None:
        columns["time"] = clock.as_quantity("time")
    used = columns["time"].places if columns else set()
    rest = [column for column in table.values() if column.column not in used]
    left_out = {column.column: why for column in rest if (why := _why_unused(column, bool(used)))}
    left_out |= _copies([column for column in rest if column.column not in left_out])
    kept = [column for column in rest if column.column not in left_out]
    quantities = _plain_names(kept)
    for column in kept:
        name = quantities.get(column.column, column.name)
        name = f"column_{column.place}" if name in {*columns, "time"} else name
        columns[name] = column.as_quantity(name)
    return columns, left_out


def _why_unused(column: TitledColumn, has_clock: bool) -> str:
    """Return the reason why a column is no quantity of the study; empty if it may be a quantity."""
    if not column.values:
        return column.unread or "holds no numbers"
    if not column.moves:
        return "never changes"
    if column.is_time and (turn := column.turn) and not has_clock:
        return (
            f"restarts from zero at {turn:g}; if it is the clock, write `unwrap: {turn:g}` at "
            "`time`"
        )
    if column.quantity == "time" or (column.is_time and has_clock):
        if has_clock:
            return "is a second clock"
        repeats = any(2 * np.count_nonzero(np.diff(x)) < len(x) - 1 for x in column.values)
        back = "runs backwards" if column.falls else "its clock is set back"
        return "repeats most of its values, unlike a clock" if repeats else back
    if column.may_be_clock:
        unit = unit_of_clock(column.values)
        return f"always increases; if it is the clock, name it as `time={column.place}:{unit}`"
    if _NO_MEASUREMENT & {*words(column.title)}:
        return "was computed, as its title says"
    if column.blocks and any(map(is_repeat, words(column.title))):
        return "numbers recordings or specimens; name it with --inputs to use it"
    return "counts its rows" if not column.quantity and column.counts else ""


def _copies(columns: Sequence[TitledColumn]) -> dict[Column, str]:
    """Return the columns that are copies of another column, with the reason. A copy is a linear
    function of the other column, so that it may have another unit. Among such columns, the column
    whose title and unit give the most information is no copy, and neither is a column whose title
    names another kind of quantity.
    """
    copies: dict[Column, str] = {}
    for family in same_signals([np.concatenate(column.values) for column in columns]):
        members = [columns[place] for place in family]
        best = min(members, key=_silence)
        for member in members:
            if member is not best and member.kind in ("", best.kind):
                copies[member.column] = f"is a linear function of {best.called}"
    return copies


def _silence(column: TitledColumn) -> tuple[bool, bool, bool, int]:
    """Return a sort key for columns: the key is smaller for a title that gives more information.
    Among positions, strain comes first.
    """
    rank = POSITIONS.index(column.quantity) if column.quantity in POSITIONS else 0
    return not column.quantity, not column.unit, not column.plain, rank


def _plain_names(columns: Sequence[TitledColumn]) -> dict[Column, str]:
    """Return the quantity of each column whose title identifies it. If several titles identify the
    same quantity equally plainly, none of these columns is returned.
    """
    names: dict[Column, str] = {}
    for quantity in KINDS:
        ranks = {
            column.column: _plainness(column) for column in columns if column.quantity == quantity
        }
        best = [column for column, rank in ranks.items() if rank == max(ranks.values()) > 0]
        if len(best) == 1:
            names[best[0]] = quantity
    if "force" not in names.values():  # people who test materials call the force a load
        names = {column: "force" if name == "load" else name for column, name in names.items()}
    return names


def _plainness(column: TitledColumn) -> int:
    """Return how plainly a title names its quantity, as a number. The number is 2 if the title
    contains only the quantity, and 1 if the title contains other words and a suitable unit.
    Otherwise, the number is 0, for example for a single letter among other words, or for an `x`
    without a unit.
    """
    if column.plain:
        return 0 if not column.unit and column.quantity in ("displacement", "length") else 2
    bare = read_label(_LETTER.sub("", column.title))
    return int(bool(column.unit) and bare is not None and bare.quantity == column.quantity)


def target_of(kinds: Mapping[str, str], is_driven: bool) -> str | None:
    """Return the quantity to predict, or None if several are possible.

    - If there is a force, it must be the only force, and an input or a position must be known.
    - If there is no force, the quantity is the only position, if an input is known.
    - If there is neither, it is the only column of unknown kind, if all other columns are inputs,
      and if there is at least one such column.

    None is returned if a title is ambiguous, or if a column of unknown kind stands beside a force
    or a position. `kinds` holds the results of `kind_to_predict`, by name; `is_driven` is True if
    an input is known from names of files or from the answers of a person.
    """
    of: dict[str, list[str]] = {}
    for name, kind in kinds.items():
        of.setdefault(kind, []).append(name)
    forces, positions, others = (of.get(kind, []) for kind in ("force", "position", ""))
    is_driven = is_driven or "drive" in of
    if "unclear" in of or len(others) > 1 or (others and (forces or positions)):
        return None
    if others:
        return others[0] if "drive" in of else None
    if forces:
        return forces[0] if len(forces) == 1 and (is_driven or positions) else None
    return positions[0] if len(positions) == 1 and is_driven else None


def kind_to_predict(name: str, titled: TitledColumn | None) -> str:
    """Return `force`, `position` or `drive` for a column whose title plainly says so; an empty text
    if the title says nothing, and `unclear` if the title is ambiguous.

    A column with only two values was set by a switch, so it is a `drive`. If `titled`
    is None, the name of the quantity is read instead of a title, because a person gave this name.
    """
    if titled is None:
        label = read_label(name)
        quantity, is_plain = ("", True) if label is None else (label.quantity, True)
    else:
        quantity, is_plain = titled.quantity, titled.plain or titled.quantity in ("", "input")
        is_plain |= quantity == "pressure" and _NUMBERED_PRESSURE.fullmatch(name) is not None
    if not quantity and titled is not None and len(titled.kinds) == 2:
        return "drive"
    if not is_plain:
        return "unclear"
    return "drive" if quantity in ("pressure", "input") else KINDS.get(quantity, quantity)
