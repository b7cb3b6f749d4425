"""How commands tell machines what came of them: errors and missed limits as JSON, JUnit and Markdown files, warnings once."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from cli_samples import write_study

Call = Callable[..., Any]


def test_a_missed_limit_stands_in_the_document_of_a_run(tmp_path: Path, mapmore: Call) -> None:
    spec = write_study(tmp_path)
    arguments = ("run", spec, "--runs", tmp_path / "runs", "-q", "--json", "--set", "validate.require={nrmse: 1e-9, r2: 0.5}")
    result = mapmore(*arguments, "--junit", tmp_path / "junit.xml", "--summary", tmp_path / "summary.md")
    assert result.exit_code == 6
    document = json.loads(result.stdout)  # one document, also where the limit is missed
    assert [sentence.split()[0] for sentence in document["missed"]] == ["nrmse"]
    cases = {case.get("name"): case for case in ET.parse(tmp_path / "junit.xml").iter("testcase")}
    assert set(cases) == {"run", "require nrmse", "require r2"}
    assert cases["require nrmse"].find("failure") is not None
    assert cases["require r2"].find("failure") is None
    summary = (tmp_path / "summary.md").read_text()
    assert summary.startswith("## mapmore: 0 of 1 runs in order")
    assert "| mapmore | validate |" in summary


def test_errors_are_json_too(tmp_path: Path, mapmore: Call) -> None:
    spec = write_study(tmp_path)
    settings = ("--set", "data.files=[none_*.csv]", "--junit", tmp_path / "j.xml")
    result = mapmore("run", spec, "--runs", tmp_path / "runs", "--json", "-q", *settings)
    assert result.exit_code == 4
    error = json.loads(result.stdout)["error"]
    assert error["exit_code"] == 4
    assert "none_*.csv" in error["message"]
    assert error["remedy"]
    assert "error: " in result.stderr
    case = next(ET.parse(tmp_path / "j.xml").iter("testcase"))
    assert case.find("error") is not None
    assert mapmore("show", tmp_path / "nothing.h5").stdout == ""
    assert json.loads(mapmore("show", tmp_path / "nothing.h5", "--json").stdout)["error"]["exit_code"] == 4


def test_a_warning_of_many_runs_is_told_once(tmp_path: Path, mapmore: Call) -> None:
    spec = write_study(tmp_path)
    others = ", ".join(f"{{set: {{segment.strain.min_samples: {least}}}, as: {name}}}" for least, name in ((30, "one"), (31, "two")))
    cuts = "segment.strain={method: even, count: 4, min_samples: 29}"
    result = mapmore("run", spec, "--runs", tmp_path / "runs", "--set", cuts, "--set", f"validate.against=[{others}]")
    assert result.exit_code == 0, result.stderr
    warnings = [line for line in result.stderr.splitlines() if "curve pressure=300: 1 segment(s) along strain instead of 4" in line]
    assert len(warnings) == 1
    assert "(the same in 3 runs: bench.one, bench.two)" in warnings[0]


def test_what_was_read_for_all_variations_is_told_once(tmp_path: Path, mapmore: Call) -> None:
    spec = write_study(tmp_path)
    (tmp_path / "bench_300.csv").write_text("\n".join((tmp_path / "bench_300.csv").read_text().splitlines()[:10]) + "\n")
    result = mapmore("run", spec, "--runs", tmp_path / "runs", "--set", "validate.against=[{set: {fit.max_terms: 1}, as: one}]")
    assert result.exit_code == 0, result.stderr
    assert result.stderr.count("holds only 9 samples") == 1


@pytest.mark.usefixtures("batch_here")
def test_a_batch_names_its_failed_runs(tmp_path: Path, mapmore: Call) -> None:
    first, second = write_study(tmp_path, "first"), write_study(tmp_path, "second")
    second.write_text(second.read_text().replace("second_*.csv", "none_*.csv"))
    result = mapmore("batch", first, second, "--runs", tmp_path / "runs", "-q", "--jobs", 1, "--summary", tmp_path / "s.md")
    assert result.exit_code == 4
    assert any(line.split()[:2] == ["second", "–"] and "failed" in line for line in result.stdout.splitlines())
    assert "second: error:" in result.stderr
    assert "1 of 2 runs in order" in (tmp_path / "s.md").read_text()


def test_a_level_that_was_measured_at_one_place_is_cut_into_one_segment(tmp_path: Path, mapmore: Call) -> None:
    spec = write_study(tmp_path)
    rows = [f"300,0.1,{380 + repeat}" for repeat in (-1, 0, 1)]
    (tmp_path / "bench_300.csv").write_text("\n".join(["P,eps,F", *rows]) + "\n")
    result = mapmore("run", spec, "--runs", tmp_path / "runs", "--set", "segment.strain={method: even, count: 2}")
    assert result.exit_code == 0, result.stderr
    table = mapmore("predict", tmp_path / "runs/bench/model.h5", "--grid", "pressure=300:300:1,strain=0.1:0.1:1", "-o", "-").stdout
    assert float(table.splitlines()[1].split(",")[2]) == pytest.approx(380)
