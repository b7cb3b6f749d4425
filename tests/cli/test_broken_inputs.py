"""Broken inputs: one clear message with the place and the remedy, the right exit code, and earlier results as they were."""

from __future__ import annotations

import gzip
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli_samples import write_study

SPEC_WRONG, DATA_WRONG, CANNOT_WRITE = 3, 4, 7


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def misspelt_key(folder: Path) -> None:
    edit(folder / "bench.yaml", "method: even", "metod: even")


def missing_column(folder: Path) -> None:
    edit(folder / "bench.yaml", "column: eps", "column: epsilon")


def text_in_a_number_column(folder: Path) -> None:
    lines = (folder / "bench_200.csv").read_text().splitlines()
    lines[7] = "200,abc,12.5"
    (folder / "bench_200.csv").write_text("\n".join(lines))


def one_sample_per_segment(folder: Path) -> None:
    lines = (folder / "bench_100.csv").read_text().splitlines()
    (folder / "bench_100.csv").write_text("\n".join([lines[0], lines[1], lines[-1]]))


def duplicate_level(folder: Path) -> None:
    edit(folder / "bench.yaml", "at: [100, 200, 300]", "at: [100, 200, 200, 300]")


def truncated_gz(folder: Path) -> None:
    path = folder / "bench_300.csv"
    packed = gzip.compress(path.read_bytes())
    path.unlink()
    (folder / "bench_300.csv.gz").write_bytes(packed[: len(packed) // 2])
    edit(folder / "bench.yaml", "bench_*.csv", "bench_*.csv*")


CASES = [
    (misspelt_key, SPEC_WRONG, ["bench.yaml:9:20", "metod", "method"]),
    (missing_column, DATA_WRONG, ["bench_100.csv", "epsilon", "eps"]),
    (text_in_a_number_column, DATA_WRONG, ["bench_200.csv", "row 8", "eps", "abc"]),
    (one_sample_per_segment, DATA_WRONG, ["pressure=100/strain:1", "1 training sample", "fewer segments"]),
    (duplicate_level, SPEC_WRONG, ["bench.yaml:6:", "200"]),
    (truncated_gz, DATA_WRONG, ["bench_300.csv.gz", "damaged"]),
]


def results(folder: Path) -> dict[str, str]:
    """Content of every result; stages before the one that fails may have committed theirs, and the record says so."""
    redone = (".lock", "run.json", "ingest.h5", "segment.h5")
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in redone
    }


@pytest.mark.parametrize(("spoil", "code", "words"), CASES, ids=[case[0].__name__ for case in CASES])
def test_a_broken_input_is_named_and_harms_nothing(
    spoil: Callable[[Path], None], code: int, words: list[str], copied: tuple[Path, Path], mapmore: Callable[..., Any]
) -> None:
    spec, runs = copied
    before = results(runs)
    assert before
    spoil(spec.parent)
    result = mapmore("run", spec, "--runs", runs)
    assert result.exit_code == code, result.stderr
    assert result.stdout == ""
    errors = result.stderr[result.stderr.index("error: ") :]
    assert errors.count("error: ") == 1
    assert "Traceback" not in errors
    for word in words:
        assert word in errors
    assert results(runs) == before


def test_a_run_path_that_is_a_file(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    spec = write_study(tmp_path)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "bench").write_text("precious")
    result = mapmore("run", spec, "--runs", tmp_path / "runs")
    assert result.exit_code == CANNOT_WRITE
    assert "bench" in result.stderr
    assert (tmp_path / "runs" / "bench").read_text() == "precious"
    result = mapmore("run", spec, "--runs", tmp_path / "runs" / "bench")
    assert result.exit_code == CANNOT_WRITE


def test_all_mistakes_of_a_spec_are_told_at_once(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    spec = write_study(tmp_path)
    misspelt_key(tmp_path)
    edit(spec, "unit: kPa", "unit: kPaa")
    edit(spec, "order: 3", "order: 300")
    result = mapmore("run", spec, "--runs", tmp_path / "runs")
    assert result.exit_code == SPEC_WRONG
    assert [word in result.stderr for word in ("metod", "kPaa", "order")] == [True] * 3
    assert not (tmp_path / "runs").exists()
