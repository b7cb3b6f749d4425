"""A model of a newer format is refused by every command that reads one, with what to do, and nothing is written."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest

import mapmore_cli
from mapmore_cli.domain.errors import DataError

COMMANDS = {
    "predict": ("predict", "MODEL", "TABLE", "-o", "OUT"),
    "invert": ("invert", "MODEL", "TABLE", "--for", "pressure", "-o", "OUT"),
    "show": ("show", "MODEL"),
    "export c": ("export", "MODEL", "--to", "c", "-o", "OUT"),
    "export py": ("export", "MODEL", "--to", "py", "-o", "OUT"),
    "export fmu": ("export", "MODEL", "--to", "fmu", "-o", "OUT"),
    "compare": ("compare", "MODEL", "MODEL", "--figure", "FIGURE"),
    "run against it": ("validate", "SPEC", "--runs", "RUNS"),
}


@pytest.fixture
def newer(finished: tuple[Path, Path], tmp_path: Path) -> Path:
    """A copy of a study that has run, whose model says that it is of format 3.0."""
    spec, runs = finished
    shutil.copytree(spec.parent, tmp_path / "study")
    model = tmp_path / "study" / "runs" / "bench" / "model.h5"
    with h5py.File(model, "a") as file:
        file.attrs["format_version"] = "3.0"
    del runs
    return model


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_it(command: str, newer: Path, tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    study = newer.parents[2]
    table, out, spec = tmp_path / "table.csv", tmp_path / "out", study / "bench.yaml"
    table.write_text("pressure,strain,force\n150,0.02,100\n")
    if command == "run against it":
        spec.write_text(spec.read_text().replace("against: [polynomial_2]", f"against: [{{model: {newer.relative_to(study)}, as: other}}]"))
    places = {
        "MODEL": newer,
        "TABLE": table,
        "OUT": out,
        "FIGURE": tmp_path / "drift.svg",
        "RUN": newer.parent,
        "RUNS": tmp_path / "runs",
        "SPEC": spec,
    }
    result = mapmore(*[places.get(word, word) for word in COMMANDS[command]])
    assert result.exit_code == 4, (result.stdout, result.stderr)
    assert "3.0" in result.stderr
    assert "newer" in result.stderr
    assert "update mapmore" in result.stderr
    assert not out.exists()
    assert not (tmp_path / "drift.svg").exists()


def test_a_notebook_refuses_it(newer: Path) -> None:
    with pytest.raises(DataError, match=r"format 3\.0"):
        mapmore_cli.load_model(newer)
