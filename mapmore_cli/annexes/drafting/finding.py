"""Find the column that a person means."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from mapmore_cli.annexes.drafting.columns import Table, TitledColumn
from mapmore_cli.annexes.drafting.draft import Column
from mapmore_cli.annexes.drafting.spelling import words
from mapmore_cli.domain.errors import UsageError


def find(table: Table, wanted: Column, option: str, texts: bool = False) -> TitledColumn:
    """Return the column that a person means by a number, a title, or a word that occurs in only one
    title. With `texts`, it may also be a column of texts.

    Raises UsageError with a list of the columns if there is none, or if there are several.
    """
    rules: list[Callable[[TitledColumn], bool]] = [
        lambda column: column.column == wanted,
        lambda column: column.place == wanted,
    ]
    if isinstance(wanted, str):
        parts = words(wanted)
        rules += [
            lambda column: words(column.title) == parts,
            lambda column: bool(parts) and {*parts} <= {*words(column.title)},
            lambda column: column.name == wanted,
        ]
    usable = [column for column in table.values() if column.values or (texts and column.texts)]
    near = next(filter(None, ([*filter(rule, usable)] for rule in rules)), [])
    empty = next((column for column in table.values() if any(rule(column) for rule in rules)), None)
    if texts and not near and empty is not None:
        raise UsageError(
            f"{option}: {empty.called} has no numbers, and no text of it stands in several rows",
            "fill the empty cells: write each text into every row that it describes (`init` does "
            "so itself only if the first row of the table has a text)",
        )
    if len(near) != 1:
        kind = "" if texts else " of numbers"
        problem = "several columns are" if near else f"no column{kind} is"
        several = ", ".join(column.called for column in near or usable)
        raise UsageError(
            f"{option}: {problem} called {wanted}",
            f"give the title or the number of one of these: {several}",
        )
    return near[0]


def listed(table: Table, but: Iterable[Column] = ()) -> dict[int, TitledColumn]:
    """Return the columns whose values change. Their keys are the numbers that `init` prints."""
    return {
        column.place: column
        for column in table.values()
        if column.moves and column.column not in {*but}
    }
