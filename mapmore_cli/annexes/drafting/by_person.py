"""Apply the answers of a person about the columns: their names, units and purposes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from mapmore_cli.annexes.drafting.columns import Table, TitledColumn, unit_of_clock
from mapmore_cli.annexes.drafting.draft import Named, range_of
from mapmore_cli.annexes.drafting.finding import find, listed
from mapmore_cli.annexes.drafting.spelling import words
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.study.units import CANONICAL


def named_by_person(named: Named, table: Table, option: str, known: Named) -> Named:
    """Return the columns that a person names, by quantity. The name of the quantity is a known one,
    one that the person gives, or one that is made from the title.

    The unit is the one that the person gives, otherwise the unit in the title, otherwise the unit
    that the model uses for the quantity.
    """
    columns: Named = {}
    names = {column.column: name for name, column in known.items()}
    for name, entry in _each(named, table, option).items():
        is_named = option == "--columns" or not entry.refers_to(name)
        wanted = known[name].column if name in known and not is_named else entry.column
        titled = find(table, wanted, option)
        if not is_named:
            is_title = name in CANONICAL and name not in known and words(titled.title)[:1] == [name]
            name = name if is_title else names.get(titled.column, titled.name)
        usual = titled.as_quantity(name) if is_named else known.get(name, titled.as_quantity(name))
        chosen = entry if is_named or entry.unit else usual
        unit = chosen.unit or usual.unit
        sure = usual.sure or bool(entry.unit) or option == "--columns"
        values = [chosen.scale * x + chosen.offset for x in titled.values]
        why = f"you; {range_of(values, unit)}" if sure else usual.why
        columns[name] = replace(chosen, column=titled.column, unit=unit, sure=sure, why=why)
    return columns


def _each(named: Named, table: Table, option: str) -> Named:
    """Return the columns named by a person. A pattern of titles such as `s*`, and a range of
    numbers in the list such as `7..70`, are replaced by all columns that they match and whose
    values change. The time is never among these columns.

    Raises UsageError if a pattern or a range matches no such column, or if it matches several
    columns and the person gives them one common name.
    """
    each: Named = {}
    titles = {column.column for column in table.values()} | {
        column.title for column in table.values()
    }
    for name, entry in named.items():
        wanted, members = entry.column, list[TitledColumn]()
        numbers = re.fullmatch(r"(\d+)\.\.(\d+)", str(wanted))
        if numbers is not None:
            low, high = sorted(map(int, numbers.groups()))
            members = [x for x in table.values() if x.moves and low <= x.place <= high]
        elif isinstance(wanted, str) and wanted not in titles and {*"*?"} & {*wanted}:
            likeness = re.compile(re.escape(wanted).replace(r"\*", ".*").replace(r"\?", "."), re.I)
            members = [x for x in table.values() if x.moves and likeness.fullmatch(x.called)]
        else:
            each[name] = entry
            continue
        members = [x for x in members if not x.is_time]
        if not members or (entry.is_called and len(members) > 1):
            several = (
                f"{len(members)} columns whose values change are"
                if members
                else "no column whose values change is"
            )
            remedy = ", ".join(x.called for x in members or table.values() if x.values)
            raise UsageError(f"{option}: {several} called {wanted}", f"name one of these: {remedy}")
        for x in members:
            key = name if entry.is_called else str(x.column)
            each[key] = replace(entry, column=x.column)
    return each


def refuse_choice(table: Table, where: str, path: str, is_map: bool) -> UsageError:
    """Return the error for a study without a known quantity to predict. Its message lists the
    columns.
    """
    if is_map:
        return _refuse_map(table, where, path)
    columns = listed(table)
    clock, question, time, more = _clock_among(columns, table)
    remarks = {clock: question}
    *drive, follow = [place for place in columns if place != clock] or [0]
    apart = next((column for column in table.values() if column.blocks), None)
    if apart is not None:
        more += f" --recordings {apart.asked_for}"
        remarks[apart.place] = "constant in blocks of rows: is each block a recording?"
        columns = {
            column.place: column
            for column in table.values()
            if column is apart or column.place in columns
        }
    how = (
        f"mapmore init {path} --target ... --inputs ...{more}  (titles, or numbers of the list)"
        if any(column.title for column in table.values())
        else f"mapmore init {path} --target force={follow}:N --inputs "
        f"pressure={drive[-1] if drive else follow}:bar{time}{more}  (numbers of the list)"
    )
    rows = [
        f"  {place}  {column.described}" + (f"  {remarks[place]}" if place in remarks else "")
        for place, column in columns.items()
    ]
    heading = (
        f"{where}: the titles do not say which column is to be predicted. Columns that change:"
    )
    return UsageError("\n".join([heading, *rows]), f"complete this: {how}")


def _clock_among(
    columns: Mapping[int, TitledColumn], table: Table
) -> tuple[int | None, str, str, str]:
    """Return the number of the column that may be a clock or counts the rows (None if there is no
    such column), a question about it, and two texts to append to the example command.

    For a clock, the first text is a further input, such as `,time=3:s`. For a column that counts
    the rows, the second text is ` --sample-time 10ms`. A text that does not apply is empty.
    """
    has_clock = any(column.is_time for column in table.values())
    # if there are only two columns, these are the input and the target, so none is a clock
    for place, column in columns.items() if len(columns) > 2 else ():
        if column.counts and not (column.unit or has_clock):
            how_long = "counts the rows: how long is the time between them?"
            return place, how_long, "", " --sample-time 10ms"
        if column.may_be_clock:
            time = f",time={place}:{unit_of_clock(column.values)}"
            return place, "always increases: is it a clock?", time, ""
    return None, "", "", ""


def _refuse_map(table: Table, where: str, path: str) -> UsageError:
    """Return the error for a map, that is, a table of values over two quantities. A map
    contains no names of quantities.
    """
    row, column, cell = (range_of(titled.values) for titled in table.values())
    return UsageError(
        f"{where}: is a map of values over two quantities, but nothing in it says what was "
        f"measured. The first column (`row`) has {row}, the first line (`column`) has {column}, "
        f"and the cells (`cell`) have {cell}",
        f"complete this with your quantities and units: mapmore init {path} "
        "--target force=cell:N --inputs pressure=row:kPa,strain=column:%",
    )
