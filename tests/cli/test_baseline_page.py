"""A row of docs/baselines.md that shipped data give; `docs/baseline_tables.py` makes all of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

PROJECT = Path(__file__).parents[2]


@pytest.mark.long
def test_the_page_says_what_a_gaussian_process_gets(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    pytest.importorskip("sklearn")
    lines = [
        line.strip("| ").split(" | ") for line in (PROJECT / "docs" / "baselines.md").read_text().splitlines() if line.startswith("| ")
    ]
    header, row = lines[0], next(line for line in lines if line[0] == "peano-static")
    printed = {name.removesuffix(" [%]"): float(cell) for name, cell in zip(header, row, strict=True) if name.endswith("[%]")}
    names = ("sarosi", "gaussian_process")
    against = f"validate.against=[{', '.join(names)}]"
    spec = PROJECT / "configs" / "m2" / "peano-static.yaml"
    result = mapmore("validate", spec, "--runs", tmp_path, "--json", "-q", "--set", against)
    assert result.exit_code == 0, result.stderr
    scores = {r["model"]: r["nrmse"] for r in json.loads(result.stdout)["scores"] if (r["split"], r["curve"]) == ("validate", "all")}
    for name in ("mapmore", *names):
        assert 100 * scores[name] == pytest.approx(printed[name], rel=0.02)
