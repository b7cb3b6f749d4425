"""Columns in blocks, in memory or in files, have the numbers of whole arrays."""

import numpy as np
import pytest

from mapmore_cli.domain import arrays
from mapmore_cli.domain.arrays import (
    by_blocks,
    column_in,
    columns_at,
    extremes,
    in_blocks,
    joined,
    picked,
    root_mean_square,
    row_blocks,
    row_by_row,
    row_count,
    row_numbers,
    rows_where,
    stacked,
)
from mapmore_cli.domain.declared import is_label
from mapmore_cli.domain.errors import DataError


@pytest.fixture(params=[10**9, 64], ids=["in memory", "in files"])
def column(request, monkeypatch):
    """A column of 50 numbers whose blocks are of seven, and of two for work with a high cost."""
    monkeypatch.setattr(arrays, "LONG", request.param)
    monkeypatch.setattr(arrays, "WIDE", 7)
    parts = np.random.default_rng(1).normal(size=(5, 10))
    (made,) = stacked([part] for part in parts)
    assert (arrays._map_of(made) is None) == (request.param > 64)
    assert made.tolist() == parts.ravel().tolist()
    return made


@pytest.mark.parametrize(("size", "rows", "ends"), [(0, 3, [0]), (6, 3, [3, 6]), (7, 3, [3, 6, 7])])
def test_blocks_follow_each_other(size, rows, ends):
    blocks = list(row_blocks(size, rows))
    assert [part.stop for part in blocks] == ends
    assert [part.start for part in blocks] == [0, *ends[:-1]]


def test_blocks_may_begin_with_the_last_rows_of_the_one_before(column):
    second = np.arange(50)
    blocks = list(in_blocks(column, second, overlap=4, rows=20))
    assert [rows.tolist() for _, rows in blocks] == [
        [*range(20)], [*range(16, 40)], [*range(36, 50)]
    ]  # fmt: skip
    assert all((x == column[rows]).all() for x, rows in blocks)


@pytest.mark.parametrize("rows", [3, 49, 50])
def test_what_is_computed_in_blocks_is_what_the_whole_gives(column, rows):
    lengths = []

    def doubled(x, y):
        lengths.append(len(x))
        return 2 * x + y

    found = by_blocks(doubled, column, column[::-1], rows=rows)
    assert found.tolist() == (2 * column + column[::-1]).tolist()
    assert max(lengths) <= rows
    assert sum(lengths) == 50
    both = row_by_row(lambda each: each["a"] - each["b"], {"a": column, "b": 0 * column + 1})
    assert both.tolist() == (column - 1).tolist()
    assert joined([column, column[:3]]).tolist() == [*column, *column[:3]]
    assert joined([column]) is column


def test_rows_are_picked_by_number_and_by_mask(column):
    rng = np.random.default_rng(2)
    for rows in (rng.integers(0, 50, 90), np.array([3]), np.empty(0, dtype=np.int64)):
        assert picked(column, rows).tolist() == column[rows].tolist()
    mask = rng.random(50) < 0.4
    assert picked(column, mask).tolist() == column[mask].tolist()
    assert picked(range(5, 55), mask).tolist() == (5 + np.flatnonzero(mask)).tolist()
    assert picked(column, range(4, 9)).tolist() == column[4:9].tolist()
    assert rows_where(mask).tolist() == np.flatnonzero(mask).tolist()
    assert rows_where((np.arange(50) > 3) & (np.arange(50) < 9)) == range(4, 9)
    assert rows_where(np.zeros(4, dtype=bool)) == range(0)
    assert row_numbers(range(3, 9, 2)).tolist() == [3, 5, 7]
    for where in (mask, None):
        values = column if where is None else column[mask]
        assert extremes(column, where) == (values.min(), values.max())
        assert extremes(column, where) == (values.min(), values.max())  # as remembered
    assert np.isnan(extremes(np.append(column, np.nan))).all()


@pytest.mark.parametrize(
    ("longest", "most", "in_file"), [(159, 2, True), (160, 2, False), (159, 1, False)]
)
def test_columns_are_written_to_files_if_the_longest_is_long_and_files_are_few(
    monkeypatch, longest, most, in_file
):
    """Of a column of 20 numbers and another of 20 truth values, in two blocks."""
    monkeypatch.setattr(arrays, "_mapped", {})
    monkeypatch.setattr(arrays, "LONG", longest)
    monkeypatch.setattr(arrays, "MOST", most)
    columns = stacked([np.ones(10), np.ones(10, dtype=bool)] for _ in range(2))
    assert [arrays._map_of(column) is not None for column in columns] == [in_file] * 2


def test_names_of_curves_have_at_most_a_thousand_characters():
    assert is_label(1000 * "x")
    for label in (1001 * "x", "a`b", "a\nb"):
        assert not is_label(label)


def test_tables_of_columns():
    table = {"a": np.arange(4.0), "b": np.ones(4)}
    assert (row_count(table), row_count({})) == (4, 0)
    assert columns_at(table, slice(1, 3))["a"].tolist() == [1, 2]
    with pytest.raises(DataError, match="there is no column `c`") as error:
        column_in(table, "c")
    assert error.value.remedy == "the columns are: a, b"
    assert root_mean_square(np.array([3.0, -4.0])) == pytest.approx(np.sqrt(12.5))
