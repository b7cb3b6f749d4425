"""Broken inputs: one clear message with the place and the remedy, the right exit code, and earlier
results as they were.
"""

import gzip
import hashlib

import pytest
from cli_samples import edit

SPEC_WRONG, DATA_WRONG, CANNOT_WRITE = 3, 4, 7


def packed_and_cut(path):
    packed = gzip.compress(path.read_bytes())
    path.unlink()
    path.with_name(f"{path.name}.gz").write_bytes(packed[: len(packed) // 2])


def with_lines(path, keep):
    path.write_text("\n".join(keep(path.read_text().splitlines())))


CASES = {
    "misspelt key": (
        "method: even",
        "metod: even",
        SPEC_WRONG,
        ["bench.yaml:9:20", "metod", "method"],
    ),
    "text in a number column": ("", "", DATA_WRONG, ["bench_200.csv", "row 8", "eps", "abc"]),
    "one sample per segment": (
        "",
        "",
        DATA_WRONG,
        ["pressure=100/strain:1", "1 training sample", "fewer segments"],
    ),
    "truncated gz": ("bench_*.csv", "bench_*.csv*", DATA_WRONG, ["bench_300.csv.gz", "damaged"]),
}


def spoil(folder, name):
    edit(folder / "bench.yaml", *CASES[name][:2])
    if name == "text in a number column":
        with_lines(folder / "bench_200.csv", lambda lines: [*lines[:7], "200,abc,12.5", *lines[8:]])
    elif name == "one sample per segment":
        with_lines(folder / "bench_100.csv", lambda lines: [*lines[:2], lines[-1]])
    elif name == "truncated gz":
        packed_and_cut(folder / "bench_300.csv")


def results(folder):
    """Content of every result; stages before the one that fails may have committed theirs, and the
    record says so.
    """
    redone = (".lock", "run.json", "ingest.h5", "segment.h5")
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in redone
    }


@pytest.mark.parametrize("name", CASES)
def test_a_broken_input_is_named_and_harms_nothing(name, copied, mapmore):
    spec, runs = copied
    _, _, code, words = CASES[name]
    before = results(runs)
    assert before
    spoil(spec.parent, name)
    result = mapmore("run", spec, code=code, says=words)
    assert result.stdout == ""
    errors = result.stderr[result.stderr.index("error: ") :]
    assert errors.count("error: ") == 1
    assert "Traceback" not in errors
    assert results(runs) == before


def test_a_run_path_that_is_a_file(study, tmp_path, mapmore):
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "bench").write_text("precious")
    mapmore("run", study, code=CANNOT_WRITE, says="bench")
    assert (tmp_path / "runs" / "bench").read_text() == "precious"
    mapmore("run", study, "--runs", tmp_path / "runs" / "bench", code=CANNOT_WRITE)
