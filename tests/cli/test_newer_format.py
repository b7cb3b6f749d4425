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

COMMANDS = (
    *("predict MODEL TABLE -o out", "invert MODEL TABLE --for pressure -o out", "show MODEL", "compare MODEL MODEL --figure out.svg"),
    *(f"export MODEL --to {to} -o out" for to in ("c", "py", "fmu")),
    "validate SPEC --runs runs",
)


@pytest.fixture
def newer(finished: tuple[Path, Path], tmp_path: Path) -> Path:
    """A copy of a study that has run, whose model says that it is of format 3.0."""
    shutil.copytree(finished[0].parent, tmp_path / "study")
    model = tmp_path / "study" / "runs" / "bench" / "model.h5"
    with h5py.File(model, "a") as file:
        file.attrs["format_version"] = "3.0"
    return model


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_refuses_it(command: str, newer: Path, tmp_path: Path, mapmore: Callable[..., Any], monkeypatch: Any) -> None:
    monkeypatch.chdir(tmp_path)
    spec = newer.parents[2] / "bench.yaml"
    (tmp_path / "table.csv").write_text("pressure,strain,force\n150,0.02,100\n")
    if "SPEC" in command:
        model = f"{{model: {newer.relative_to(spec.parent)}, as: other}}"
        spec.write_text(spec.read_text().replace("against: [polynomial_2]", f"against: [{model}]"))
    places = {"MODEL": newer, "TABLE": "table.csv", "SPEC": spec}
    mapmore(*[places.get(word, word) for word in command.split()], code=4, says=["3.0", "newer", "update mapmore"])
    assert not list(tmp_path.glob("out*"))


def test_a_notebook_refuses_it(newer: Path) -> None:
    with pytest.raises(DataError, match=r"format 3\.0"):
        mapmore_cli.load_model(newer)
