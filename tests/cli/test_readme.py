"""What README shows is what happens."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from test_shipped_studies import NRMSE

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def spec_of_readme() -> str:
    (block,) = re.findall(r"```yaml\n(.*?)```", README, re.DOTALL)
    return block


def write_recordings(folder: Path) -> None:
    """Three slow load cycles, the upper branch on the way back."""
    for pressure in (100, 200, 300):
        strain = np.concatenate([np.linspace(0, 0.05 + 0.0004 * pressure, 300), np.linspace(0.05 + 0.0004 * pressure, 0, 300)])
        force = 2 * pressure * (1 - 3 * strain) ** 2 - 40 + 4 * np.repeat([-1, 1], 300)
        rows = [f"{pressure},{e:.5f},{f:.2f}" for e, f in zip(strain, force, strict=True)]
        (folder / f"muscle_{pressure}.csv").write_text("\n".join(["P_kPa,strain,force_N", *rows]))


def test_the_spec_for_your_own_recordings_runs(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    write_recordings(tmp_path)
    spec = tmp_path / "muscle.yaml"
    spec.write_text(spec_of_readme())
    assert mapmore("check", spec).exit_code == 0
    result = mapmore("run", spec, "--runs", tmp_path / "runs")
    assert result.exit_code == 0, result.stderr
    assert "polynomial_2" in result.stdout
    assert (tmp_path / "runs" / "my-muscle" / "report" / "index.html").is_file()


def test_the_table_of_the_demo_has_every_model() -> None:
    """The scores themselves, of training as well, are held by test_shipped_studies."""
    shown = re.findall(r"^(\S+-static) +(\S+) +(train|validate) +[0-9.]+", README, re.MULTILINE)
    wanted = {(study, model) for study in ("dmsp-20-88-static", "peano-static") for model in NRMSE[study]}
    for split in ("train", "validate"):
        assert {(study, model) for study, model, side in shown if side == split} == wanted


def test_files_that_readme_names_exist() -> None:
    root = Path(__file__).parents[2]
    for target in re.findall(r"\]\(([^)#:]+)\)", README):
        assert (root / target).is_file(), target
