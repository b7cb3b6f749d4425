"""docs/figures-for-papers.md: its spec is a spec, and its commands are commands."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from cli_samples import write_study
from page_tables import DOCS

PAGE = (DOCS / "figures-for-papers.md").read_text(encoding="utf-8")


def test_what_the_page_says_works(tmp_path: Path, mapmore: Callable[..., Any]) -> None:
    block = re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert block
    report = yaml.safe_load(block[1])["report"]
    spec = write_study(tmp_path)
    document = yaml.safe_load(spec.read_text())
    document["report"] = {**report, "figures": ["fit"]}
    spec.write_text(yaml.safe_dump(document))
    assert mapmore("run", spec, "--runs", tmp_path / "runs", "-q").exit_code == 0
    folder = tmp_path / "runs" / "bench" / "report"
    assert (folder / "panels" / "fit.pressure=200.pgf").is_file()
    assert (folder / "tables" / "scores.tex").is_file()
    lines = [line for line in PAGE.splitlines() if line.startswith("mapmore figure")]
    assert len(lines) == 2
    for line in lines:
        words = [word.replace("dmsp-20-88-static", "bench").replace("250", "200") for word in shlex.split(line)[1:]]
        here = [str(tmp_path / word) if word.startswith("fig3") else word for word in words]
        result = mapmore(*here, "--runs", tmp_path / "runs")
        assert result.exit_code == 0, result.stderr
        (tmp_path / "fig3.pdf").unlink()
    assert (tmp_path / "fig3.csv").is_file()
