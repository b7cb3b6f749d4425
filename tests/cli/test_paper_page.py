"""docs/figures-for-papers.md: its spec is a spec, and its commands are commands."""

from __future__ import annotations

import shlex

import yaml
from cli_samples import write_study
from page_tables import DOCS, block_of

PAGE = DOCS / "figures-for-papers.md"


def test_what_the_page_says_works(tmp_path, mapmore):
    report = yaml.safe_load(block_of(PAGE))["report"]
    spec = write_study(tmp_path)
    document = yaml.safe_load(spec.read_text())
    document["report"] = {**report, "figures": ["fit"]}
    spec.write_text(yaml.safe_dump(document))
    mapmore("run", spec, "--runs", tmp_path / "runs", "-q", code=0)
    folder = tmp_path / "runs" / "bench" / "report"
    assert (folder / "panels" / "fit.pressure=200.pgf").is_file()
    assert (folder / "tables" / "scores.tex").is_file()
    lines = [
        line
        for line in PAGE.read_text(encoding="utf-8").splitlines()
        if line.startswith("mapmore figure")
    ]
    assert len(lines) == 2
    for line in lines:
        words = [
            word.replace("dmsp-20-88-static", "bench").replace("250", "200")
            for word in shlex.split(line)[1:]
        ]
        here = [str(tmp_path / word) if word.startswith("fig3") else word for word in words]
        mapmore(*here, "--runs", tmp_path / "runs", code=0)
        (tmp_path / "fig3.pdf").unlink()
    assert (tmp_path / "fig3.csv").is_file()
