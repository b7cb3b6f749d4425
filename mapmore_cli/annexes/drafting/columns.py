"""What a column is called and what it is for: by its title and its unit, or as a person says.

Values give facts alone: a column that never changes, a clock, a copy of another column.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mapmore_cli.annexes.drafting.draft import Column, NamedColumn, Raw, range_of
from mapmore_cli.checking.evidence import same_signals
from mapmore_cli.checking.names import POSITIONS, ColumnTitle, read_label, unit_in
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.errors import DataError, SpecError, UsageError
from mapmore_cli.ingestion.clock import MOST_GLITCHES
from mapmore_cli.spec.units import CANONICAL, check_unit, default_unit

_CALLED = ("pressure", *POSITIONS, "force", "load")
"""Quantities that columns are called by where their titles say so."""
_IN_BRACKETS = re.compile(r"[\[(]\s*([^\W\d_][^\])]*|%)\s*[\])]")


@dataclass(frozen=True)
class TitledColumns:
    """The columns of numbers of some files, the titles of those that have one, and the texts below
    these.
    """

    titles: Mapping[Column, str]
    raw: Raw
    units: Mapping[Column, str] = field(default_factory=dict)

    def label(self, column: Column) -> ColumnTitle | None:
        """Return what the title says; its unit may stand in the line below."""
        label = read_label(self.titles.get(column, ""))
        if label is None or label.unit:
            return label
        return replace(label, unit=unit_in(label.quantity, self.units.get(column, "")))


def moves(values: Sequence[Array]) -> bool:
    """Return True where not all values are one."""
    return float(np.ptp(np.concatenate(values))) > 0


def is_clock(values: Sequence[Array]) -> bool:
    """Return True for what goes on in every file, but for a few steps back."""
    return all(np.ptp(one) > 0 and np.mean(np.diff(one) < 0) <= MOST_GLITCHES for one in values)


def named_by_titles(table: TitledColumns) -> dict[str, NamedColumn]:
    """Return the columns that move, by quantity where titles name one, else by their titles.

    Where several titles name one quantity, the one with a unit has its name, then the plainer; of
    equal ones each keeps its title. A copy of another column is left out, and so is what goes on
    like a clock and is not the time.
    """
    labels = {column: table.label(column) for column in table.raw}
    clocks = [
        column
        for column, values in table.raw.items()
        if is_clock(values) and ((label := labels[column]) is None or label.quantity == "time")
    ]
    titled = [column for column in clocks if labels[column] is not None]
    kept = _without_copies(table, [column for column in table.raw if column not in clocks])
    best: dict[str, Column] = {"time": titled[0]} if titled else {}
    for quantity in _CALLED:
        alike = [one for one in kept if (label := labels[one]) and label.quantity == quantity]
        ranks = [_rank(labels[one]) for one in alike]
        if alike and ranks.count(min(ranks)) == 1:
            best[quantity] = alike[ranks.index(min(ranks))]
    if "force" not in best and "load" in best:  # testers call the force a load
        best["force"] = best.pop("load")
    quantities = {column: quantity for quantity, column in best.items()}
    names = {}
    for column in [*titled[:1], *kept]:
        name = quantities.get(column) or _identifier(table.titles.get(column, ""), column)
        names[name if name not in names else f"column_{column}"] = column
    return {
        name: _by_title(name if column in quantities else "", column, table)
        for name, column in names.items()
    }


def _rank(label: ColumnTitle | None) -> tuple[bool, bool]:
    return label is None or label.unit is None, label is None or not label.plain


def _without_copies(table: TitledColumns, columns: Sequence[Column]) -> list[Column]:
    """Return the columns that move, and of copies of one signal the best named; a title that names
    another quantity is believed.
    """
    moving = [column for column in columns if moves(table.raw[column])]
    copies: set[Column] = set()
    for family in same_signals([np.concatenate(table.raw[column]) for column in moving]):
        members = [moving[place] for place in family]
        best = min(members, key=lambda one: (*_rank(table.label(one)), _telling(table, one)))
        copies |= {
            one for one in members if one != best and _kind(table, one) in ("", _kind(table, best))
        }
    return [column for column in moving if column not in copies]


def _kind(table: TitledColumns, column: Column) -> str:
    """Return the quantity that a title names, one word for all positions; empty for none."""
    label = table.label(column)
    quantity = label.quantity if label is not None else ""
    return "position" if quantity in POSITIONS else quantity if quantity in _CALLED else ""


def _telling(table: TitledColumns, column: Column) -> int:
    label = table.label(column)
    return POSITIONS.index(label.quantity) if label and label.quantity in POSITIONS else 0


def _identifier(title: str, column: Column) -> str:
    name = re.sub(r"\W+", "_", title, flags=re.ASCII).strip("_")[:40]
    return name if name[:1].isalpha() and name not in CANONICAL else f"column_{column}"


def _by_title(quantity: str, column: Column, table: TitledColumns) -> NamedColumn:
    """Return the column in the unit that its title or the line below it says."""
    label, reach = table.label(column), table.raw[column]
    bracketed = _IN_BRACKETS.search(
        f"{table.titles.get(column, '')} [{table.units.get(column, '')}]"
    )
    unit = bracketed[1].strip() if bracketed else ""
    if label is not None and label.unit:
        why = f"by its title; {range_of(reach, label.unit)}"
        return NamedColumn(column, label.unit, why)
    if not quantity:
        unit = unit if _is_unit(unit) else "1"
        return NamedColumn(column, unit, range_of(reach, unit))
    usual = default_unit(quantity) if quantity != "time" else _unit_of_clock(reach)
    doubt = f"says no unit: is it {usual}?"
    if bracketed:
        doubt = f"says {unit}: give the calibration of its sensor, as {quantity}:{usual}*2.5-1.25"
    return NamedColumn(column, usual, f"its title {doubt} {range_of(reach)}", sure=False)


def _unit_of_clock(values: Sequence[Array]) -> str:
    """Return ms for whole numbers that go on by 1 to 100 a step, else s: a suggestion."""
    step = float(np.median(np.diff(values[0])))
    is_whole = all((one == np.round(one)).all() for one in values)
    return "ms" if is_whole and 1 <= step <= 100 else "s"


def _is_unit(text: str) -> bool:
    try:
        check_unit(text)
    except SpecError:
        return False
    return bool(text)


def named_by_person(
    told: Mapping[str, NamedColumn], table: TitledColumns
) -> dict[str, NamedColumn]:
    """Return the columns that a person has named; DataError for one that holds no numbers.

    A unit that was not said is that of the title, else the model's.
    """
    columns = {}
    for name, one in told.items():
        if one.column not in table.raw:
            raise DataError(
                f"column {one.column} holds no numbers", f"name another column for {name}"
            )
        label = table.label(one.column)
        titled = label.unit if label is not None and label.quantity == name else None
        unit = one.unit or titled or default_unit(name)
        why = f"{one.why}; {range_of(table.raw[one.column], unit)}"
        columns[name] = replace(one, unit=unit, why=why)
    return columns


def target_of(names: Sequence[str], is_driven: bool) -> str | None:
    """Return what is to be predicted where the names of columns leave no choice; None where they
    do.

    It is the one force, else the one position where something drives, else the one column that is
    no pressure and was not commanded. `is_driven` says that names of files tell a pressure.
    """
    labels = {name: read_label(name) for name in names if name != "time"}
    kinds = {name: "" if label is None else label.quantity for name, label in labels.items()}
    drives = [name for name, kind in kinds.items() if kind in ("pressure", "input", "time")]
    positions = [name for name, kind in kinds.items() if kind in POSITIONS]
    candidates = (
        [name for name, kind in kinds.items() if kind in ("force", "load")],
        positions if drives or is_driven else [],
        [name for name in kinds if name not in drives and name not in positions],
    )
    if len(kinds) + is_driven < 2:
        return None
    for some in candidates:
        if some:
            called = [name for name in some if name in _CALLED]
            return some[0] if len(some) == 1 else called[0] if len(called) == 1 else None
    return None


def refuse_choice(table: TitledColumns, where: str) -> UsageError:
    """Return the error for columns of which nobody says what is to be predicted: it lists them."""
    lines = [
        f"  {column}  {table.titles.get(column, '') if isinstance(column, int) else ''} "
        f"{range_of(values)}"
        for column, values in table.raw.items()
        if moves(values)
    ]
    return UsageError(
        "\n".join(
            [f"{where}: titles do not say what is to be predicted. Columns that move:", *lines]
        ),
        'name the columns and the target, as: mapmore init PATH --columns "time=...:s,'
        'pressure=...:bar,angle=...:deg" --target angle',
    )
