"""`mapmore export` from the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


def test_c_files_are_named_after_the_model(mapmore: Callable[..., Any], model_file: Path, tmp_path: Path) -> None:
    result = mapmore("export", model_file, "--to", "c", "-o", tmp_path / "out")
    assert result.exit_code == 0
    written = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert len(written) == 3
    assert {name.rsplit(".", 1)[1] for name in written} == {"c", "h"}
    assert all(name in result.stdout for name in written)


@pytest.mark.parametrize("to", ["py", "tex"])
def test_one_file(mapmore: Callable[..., Any], model_file: Path, tmp_path: Path, to: str) -> None:
    assert mapmore("export", model_file, "--to", to, "-o", tmp_path).exit_code == 0
    assert [path.suffix for path in tmp_path.iterdir()] == [f".{to}"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--to", "py", "--float"], "--float is for C alone"),
        (["--to", "csv"], "--grid goes with --to csv"),
        (["--to", "csv", "--grid", "pressure=0:90000:100,strain=0.1"], "outside of the training range"),
        (["--to", "java"], "java"),
    ],
)
def test_what_is_refused_writes_nothing(
    mapmore: Callable[..., Any], model_file: Path, tmp_path: Path, arguments: list[str], said: str
) -> None:
    result = mapmore("export", model_file, *arguments, "-o", tmp_path / "out")
    assert result.exit_code == 2
    assert said in result.stderr
    assert not (tmp_path / "out").exists()
