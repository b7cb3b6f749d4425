"""A published table beside ours: the rows, the verdicts, and sentences as inequalities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.modelling.expressions import ExpressionError, evaluate, parse
from mapmore_cli.pipeline.report import published_table
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.campaign import Comparison, Number, Ours, Sentence, Side
from mapmore_cli.study.paper.ours import Row, Runs
from mapmore_cli.study.paper.verdicts import ORDER, SENTENCE, Compared, judged, order

WORD = {True: "agrees", False: "differs"}


def beside(one: Comparison, tables: Path, runs: Runs) -> tuple[list[Table], list[Compared]]:
    """Return the tables and the verdicts of a comparison.

    Raises
    ------
    SpecError
        A published table, a column or a row that is not there.
    """
    printed = _printed(tables / one.published, one.where)
    pairs = []
    for number in one.numbers:
        ours = _paired(one.ours.model_copy(update={"rows": {**one.ours.rows, **number.rows}}), printed, runs)
        pairs.append((number, [(value(number.printed, p), value(number.ours, o)) for p, o in zip(printed, ours, strict=True)]))
    shown: list[list[Cell]] = [[row[label] for label in one.labels] for row in printed]
    columns = [Column(label) for label in one.labels]
    found: list[Compared] = []
    orders: list[Table] = []
    for number, cells in pairs:
        columns += [Column(f"{number.name}, printed", number.unit), Column("ours", number.unit)]
        for row, (theirs, mine) in zip(shown, cells, strict=True):
            row += [theirs, mine]
        if number.verdict is None:
            continue
        if number.verdict.order is not None:
            table, verdicts = _ordered(number, number.verdict.order, one.labels, printed, cells)
            orders.append(table)
            found += verdicts
            continue
        columns.append(Column(_heading(number)))
        for row, (theirs, mine) in zip(shown, cells, strict=True):
            verdict = judged(number.verdict, number.name, theirs, mine)
            found.append(verdict)
            row.append(WORD[verdict.holds])
    table = Table(Path(one.published).stem, one.title, tuple(columns), tuple(map(tuple, shown)), tuple(one.notes))
    return [table, *orders], found


def _heading(number: Number) -> str:
    rule = number.verdict
    assert rule is not None
    if rule.within is not None:
        return f"within {rule.within:g}"
    if rule.factor is not None:
        return f"within a factor of {rule.factor:g}"
    return "the same" if rule.same else f"{(rule.bound or '').replace('_', ' ')} the printed"


def _printed(path: Path, where: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Return the rows of a published table that are asked for, all texts."""
    table = published_table(path)
    names = [column.name for column in table.columns]
    if unknown := sorted(set(where) - set(names)):
        raise SpecError(f"{path.name}: has no column {unknown[0]!r}", f"there are {', '.join(names)}")
    rows = [dict(zip(names, map(str, row), strict=True)) for row in table.rows]
    kept = [row for row in rows if all(row[name] in texts for name, texts in where.items())]
    if not kept:
        raise SpecError(f"{path.name}: no row is left", "mend `where`")
    return kept


def _paired(ours: Ours, printed: Sequence[Mapping[str, str]], runs: Runs) -> list[Row]:
    """Return a row of ours for each printed one: the total of those it asks for, or the next that no printed row has taken."""
    taken: dict[str, int] = {}
    found: list[Row] = []
    for row in printed:
        rows = runs.rows(ours, row)
        key = repr(rows)
        turn = 0 if ours.total else taken.get(key, 0)
        taken[key] = turn + 1
        if turn >= len(rows):
            raise SpecError(f"table {ours.table!r}: {len(rows)} rows of ours for the printed row {', '.join(row.values())}", "mend `rows`")
        found.append(_total(rows) if ours.total else rows[turn])
    return found


def _total(rows: Sequence[Row]) -> Row:
    numbers = [name for name, cell in rows[0].items() if isinstance(cell, int | float)]
    return {name: sum(_float(row[name]) for row in rows) for name in numbers}


def value(text: str, row: Mapping[str, Cell] | Mapping[str, str]) -> Cell:
    """Return a column of a row, a number where it is one, or the value of an expression of its columns.

    Raises
    ------
    SpecError
        Where the text is neither.
    """
    if text in row:
        cell = row[text]
        return _number(cell) if isinstance(cell, str) else cell
    numbers = {name: np.array([float(cell)]) for name, cell in ((n, _number(c)) for n, c in row.items()) if isinstance(cell, int | float)}
    try:
        return float(evaluate(parse(text), numbers, 1)[0])
    except (ExpressionError, KeyError, DataError, ValueError) as fault:
        raise SpecError(f"{text!r}: {fault}", f"there are {', '.join(row)}") from fault


def _number(cell: Cell) -> Cell:
    if not isinstance(cell, str):
        return cell
    try:
        return float(cell) if cell else None
    except ValueError:
        return cell


def _ordered(
    number: Number, groups: Sequence[str], labels: Sequence[str], printed: Sequence[Mapping[str, str]], cells: Sequence[tuple[Cell, Cell]]
) -> tuple[Table, list[Compared]]:
    """Return the orders within each group, least first."""
    members: dict[tuple[str, ...], list[int]] = {}
    for k, row in enumerate(printed):
        members.setdefault(tuple(row[name] for name in groups), []).append(k)
    rest = [label for label in labels if label not in groups]
    rows, found = list[tuple[Cell, ...]](), list[Compared]()
    for group, places in members.items():
        pairs = np.array([[_float(cells[k][side]) for k in places] for side in (0, 1)])
        names = [" ".join(printed[k][label] for label in rest) for k in places]
        verdict = order(number.name, pairs[0], pairs[1])
        found.append(verdict)
        texts = [" < ".join(names[k] for k in np.argsort(side, kind="stable")) for side in pairs]
        rows.append((", ".join(group), *texts, verdict.closeness, WORD[verdict.holds]))
    heads = (Column(", ".join(groups)), Column("printed"), Column("ours"), Column("Kendall's tau", "", ".2f"), Column(ORDER))
    return Table("order", f"Order by {number.name}, least first", heads, tuple(rows)), found


def _float(cell: Cell) -> float:
    return float(cell) if isinstance(cell, int | float) else math.nan


def sentences(said: Sequence[Sentence], runs: Runs) -> tuple[Table, list[Compared]]:
    """Return sentences of the paper beside the numbers that speak to them."""
    rows, found = list[tuple[Cell, ...]](), list[Compared]()
    for one in said:
        left = _side(one.left, runs)
        right = _side(one.right, runs) if isinstance(one.right, Side) else one.right
        holds = left < right if one.relation == "<" else left > right
        found.append(Compared(SENTENCE, "sentences", holds))
        rows.append((one.says, f"{left:.4g} {one.relation} {right:.4g}", WORD[holds]))
    heads = (Column("in the paper"), Column("here it would be"), Column("verdict"))
    return Table("sentences", "What the text says", heads, tuple(rows)), found


def _side(side: Side, runs: Runs) -> float:
    rows = runs.rows(side.ours, {})
    if len(rows) != 1:
        raise SpecError(f"{side.value!r}: {len(rows)} rows of ours", "mend `ours.rows`")
    return _float(value(side.value, rows[0]))
