"""Lookup tables: regular grids over the inputs; files for other programs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.study.prediction.records import grid_lines

INPUTS = ("pressure", "strain")


def points(text: str, inputs: tuple[str, ...] = INPUTS) -> list[tuple[float, ...]]:
    return [tuple(map(float, line.split(","))) for line in list(grid_lines(text, inputs))[1:]]


@settings(deadline=None)
@given(st.integers(-1000, 1000), st.integers(0, 60), st.sampled_from([1e-3, 0.01, 0.05, 0.1, 0.3, 1.0, 2.5, 25.0, -0.01, -25.0]))
def test_points_are_evenly_spaced_from_end_to_end(start: int, steps: int, step: float) -> None:
    first, last = start / 10, start / 10 + steps * step
    axis = [x for (x,) in points(f"x={first!r}:{last!r}:{step!r}", ("x",))]
    assert len(axis) == steps + 1
    assert axis == pytest.approx([first + i * step for i in range(steps + 1)], abs=1e-9)
    assert (axis[0], axis[-1]) == pytest.approx((first, last), rel=1e-11, abs=1e-11)


def test_the_last_one_named_varies_fastest() -> None:
    assert points("strain=0:0.1:0.1,pressure=10:20:5") == [(0, 10), (0, 15), (0, 20), (0.1, 10), (0.1, 15), (0.1, 20)]


def test_numbers_are_printed_as_a_person_would() -> None:
    assert [line.strip() for line in grid_lines("x=0:0.3:0.1", ("x",))] == ["x", "0", "0.1", "0.2", "0.3"]


def test_one_value_holds_an_input() -> None:
    assert points("pressure=150,strain=0:0.2:0.1") == [(150, 0), (150, 0.1), (150, 0.2)]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "has no '='"),
        ("pressure", "has no '='"),
        ("pressure=0:1", "cannot read 'pressure=0:1'"),
        ("pressure=a:b:c", "cannot read"),
        ("pressure=0:inf:1", "cannot read"),
        ("pressure=nan", "cannot read"),
        ("pressure=0:1:0", "does not lead from 0 to 1"),
        ("pressure=1:0:0.1", "does not lead from 1 to 0"),
        ("pressure=0:1:1e-9", "at most 10000000 steps"),
        ("pressure=0:1:1e-4,strain=0:1:1e-4", "asks for 100020001 points, more than 10000000"),
        ("pressure=0:1:0.3,strain=0", "not a whole number of steps"),
        ("pressure=0,pressure=1,strain=0", "'pressure' is given twice"),
        ("pressure=0:1:1", "no values for strain"),
        ("pressure=0,strian=0", "did you mean 'strain'?"),
        ("pressure=0,strain=0,", "has no '='"),
    ],
)
def test_what_is_refused_before_anything_is_computed(text: str, what: str) -> None:
    with pytest.raises(UsageError) as caught:
        grid_lines(text, INPUTS)
    assert what in str(caught.value)


def test_c_files_are_named_after_the_model(mapmore: Callable[..., Any], model_file: Path, tmp_path: Path) -> None:
    result = mapmore("export", model_file, "--to", "c", "-o", tmp_path / "out", code=0)
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert len(written) == 5
    assert {name.rsplit(".", 1)[1] for name in written} == {"c", "h"}
    assert all(name in result.stdout for name in written)


@pytest.mark.parametrize("to", ["py", "tex"])
def test_one_file(mapmore: Callable[..., Any], model_file: Path, tmp_path: Path, to: str) -> None:
    assert mapmore("export", model_file, "--to", to, "-o", tmp_path).exit_code == 0
    assert [path.suffix for path in tmp_path.iterdir()] == [f".{to}"]


def test_a_unit_without_a_compiler_is_told_on_stderr(
    mapmore: Callable[..., Any], model_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    result = mapmore("export", model_file, "--to", "fmu", "-o", tmp_path, code=0)
    (file,) = tmp_path.iterdir()
    assert file.suffix == ".fmu"
    assert result.stdout == f"{file}\n"
    assert "no C compiler here (no-such-compiler)" in result.stderr
    assert mapmore("export", model_file, "--to", "fmu", "-o", tmp_path, "-q").stderr == ""


@pytest.mark.parametrize("to", ["c", "fmu", "py"])
def test_a_folder_that_cannot_be_made(
    mapmore: Callable[..., Any], model_file: Path, tmp_path: Path, to: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    (tmp_path / "file").write_text("in the way")
    mapmore("export", model_file, "--to", to, "-o", tmp_path / "file" / "out", code=7, says=["cannot be written", "-o"])
    assert (tmp_path / "file").read_text() == "in the way"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--to", "py", "--float"], "--float is for C alone"),
        (["--to", "fmu", "--float"], "--float is for C alone"),
        (["--to", "csv"], "--grid goes with --to csv"),
        (["--to", "csv", "--grid", "pressure=0:90000:100,strain=0.1"], "outside of the training range"),
        (["--to", "java"], "java"),
    ],
)
def test_what_is_refused_writes_nothing(
    mapmore: Callable[..., Any], model_file: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    mapmore("export", model_file, *arguments, "-o", tmp_path / "out", code=2, says=said)
    assert not (tmp_path / "out").exists()


def test_invert_finds_what_predict_gave(mapmore: Callable[..., Any], model_file: Path, tmp_path: Path) -> None:
    (tmp_path / "at.csv").write_text("pressure,strain\n120,0.05\n180,0.1\n")
    predicted = mapmore("predict", model_file, tmp_path / "at.csv", "--derivatives", code=0)
    header, *rows = [line.split(",") for line in predicted.stdout.splitlines()]
    assert header == ["pressure", "strain", "force_predicted", "outside_range", "force_by_pressure", "force_by_strain"]
    wanted = "force,strain\n" + "".join(f"{row[2]},{row[1]}\n" for row in rows) + "1e12,0.1\n,0.1\n"
    (tmp_path / "wanted.csv").write_text(wanted)
    found = mapmore("invert", model_file, tmp_path / "wanted.csv", "--for", "pressure", code=0)
    header, *answers = [line.split(",") for line in found.stdout.splitlines()]
    assert header == ["force", "strain", "pressure_found", "pressure_solutions", "pressure_status"]
    for row, answer in zip(rows, answers, strict=False):
        assert any(abs(float(one) - float(row[0])) < 1e-5 for one in answer[3].split())
    assert answers[2][2:] == ["", "", "none"]
    assert answers[3][2:] == ["", "", ""]


def test_invert_for_an_input_that_the_model_has_not(mapmore: Callable[..., Any], model_file: Path, tmp_path: Path) -> None:
    (tmp_path / "wanted.csv").write_text("force,pressure,strain\n100,150,0.1\n")
    mapmore("invert", model_file, tmp_path / "wanted.csv", "--for", "volume", code=2, says="no input 'volume'")
