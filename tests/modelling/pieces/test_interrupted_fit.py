"""Ctrl-C while a record is fitted as it is read from its file."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from mapmore_cli.modelling.expressions import dictionary_blocks, dictionary_matrix, monomials
from mapmore_cli.modelling.frols import frols, frols_streamed

TERMS = monomials(["a", "b"], 3)
ROWS, CHUNK = 20_000, 1_000


@pytest.fixture
def record(tmp_path):
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-1, 1, (2, ROWS))
    columns = {"a": a, "b": b, "y": a * b - b**3 + 0.1 * rng.normal(size=ROWS)}
    with h5py.File(tmp_path / "record.h5", "w") as file:
        for name, x in columns.items():
            file.create_dataset(name, data=x, chunks=(CHUNK,))
    return tmp_path / "record.h5", columns


def blocks_of(path, told=lambda _row: None):
    def blocks():
        with h5py.File(path) as file:
            for start in range(0, ROWS, CHUNK):
                told(start)
                part = {name: file[name][start : start + CHUNK] for name in "aby"}
                for rows, P in dictionary_blocks(TERMS, part, CHUNK):
                    yield P, part["y"][rows]

    return blocks


@pytest.mark.parametrize("after", [0, 7, 19, 25], ids=["at once", "midway", "in the last block", "in the second pass"])
def test_the_file_is_let_go_and_the_fit_can_begin_again(record, after):
    path, columns = record
    calls = []

    def told(row):
        calls.append(row)
        if len(calls) > after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        frols_streamed(blocks_of(path, told), 4, stop="press")
    with h5py.File(path, "r+") as file:  # HDF5 would refuse to write to a file that is open for reading
        assert file["y"].shape == (ROWS,)
    again, whole = (
        frols_streamed(blocks_of(path), 4, stop="press"),
        frols(dictionary_matrix(TERMS, columns, ROWS), columns["y"], 4, stop="press"),
    )
    assert again.chosen.tolist() == whole.chosen.tolist()
    np.testing.assert_allclose(again.theta, whole.theta, rtol=1e-9)
