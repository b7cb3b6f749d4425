"""The structures that a search tried, as a table."""

from __future__ import annotations

from mapmore_cli.domain.search import Search, Tried
from mapmore_cli.reporting.table import Cell, Column, Table


def search_table(search: Search) -> Table:
    """A row for every structure, the least error first; the best and the one that was taken are marked."""
    order = sorted(range(len(search.tried)), key=lambda number: (bool(search.tried[number].failure), search.tried[number].excess))
    rows = [_row(number, search.tried[number], search) for number in order]
    errors = [Column("left-out error", "%", ".3f"), Column("levels left out", "%", ".3f")]
    errors += [Column("above the best", "%", ".1f"), Column("standard error", "%", ".1f")]
    columns = (Column("structure"), *errors, Column("parameters"), Column("seconds", "", ".2f"), Column(""))
    parts = (f"Levels left out: the same for {search.parts}.",) if search.parts else ()
    boxes = ", ".join(f"{name} {100 * error:.3g} %" for name, error in (search.black_boxes or {}).items())
    notes = (
        f"Left out in turn: {search.left_out}. Errors: RMSE / FS, FS = range of the training samples = {search.scale:.4g}. "
        "Above the best: mean difference of the logarithms over all folds, and its standard error.",
        *parts,
        *((f"Black boxes on the same blocks: {boxes}.",) if boxes else ()),
        "Taken: the fewest parameters of those within one standard error, and 5 %, of the best. Held-out data were not used.",
        *search.notes,
    )
    return Table("search", "Structures that were tried on training data", columns, tuple(rows), notes)


def _row(number: int, one: Tried, search: Search) -> tuple[Cell, ...]:
    marks = [word for word, place in (("best", search.best), ("taken", search.chosen)) if place == number]
    told = f"failed: {one.failure}" if one.failure else ", ".join(marks)
    return (one.words, 100 * one.error, 100 * one.parts, 100 * one.excess, 100 * one.spread, one.parameters or None, one.seconds, told)
