"""The program as somebody gets it who has no checkout: a wheel, built and tried."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", folder, PROJECT]
    subprocess.run(command, check=True, env={**os.environ, "PIP_DISABLE_PIP_VERSION_CHECK": "1"}, cwd=folder)
    (found,) = folder.glob("*.whl")
    return found


def test_the_wheel_holds_every_module_and_file(wheel: Path) -> None:
    ours = {path.relative_to(PROJECT).as_posix() for path in (PROJECT / "mapmore_cli").rglob("*") if path.is_file()}
    ours = {name for name in ours if "__pycache__" not in name}
    assert ours <= set(zipfile.ZipFile(wheel).namelist())


def test_an_installed_program_makes_its_example(wheel: Path, tmp_path: Path) -> None:
    """From the wheel alone, far from the checkout."""
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    env = {**os.environ, "PYTHONPATH": str(tmp_path / "site")}

    def mapmore(*arguments: str) -> str:
        call = [sys.executable, "-m", "mapmore_cli", *arguments]
        return subprocess.run(call, check=True, env=env, cwd=tmp_path, capture_output=True, text=True).stdout

    mapmore("example", "muscle", "-q")
    document = json.loads(mapmore("run", "muscle/study.yaml", "--json", "-q"))
    assert document["stages"]["report"] == "done"
    assert (tmp_path / "runs" / "example" / "report" / "index.html").is_file()
