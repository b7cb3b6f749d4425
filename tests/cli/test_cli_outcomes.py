"""How commands tell machines and people what came of them: errors, missed limits, warnings that
must be loud.
"""

import json
import xml.etree.ElementTree as ET

import pytest
from cli_samples import options, write_recording


def test_a_missed_limit_stands_in_the_document_of_a_run(study, tmp_path, mapmore):
    arguments = ("run", study, "-q", "--json", "--set", "validate.require={nrmse: 1e-9, r2: 0.5}")
    result = mapmore(
        *arguments, "--junit", tmp_path / "junit.xml", "--summary", tmp_path / "summary.md", code=6
    )
    document = json.loads(result.stdout)  # one document, also where the limit is missed
    assert [sentence.split()[0] for sentence in document["missed"]] == ["nrmse"]
    cases = {case.get("name"): case for case in ET.parse(tmp_path / "junit.xml").iter("testcase")}
    assert set(cases) == {"run", "require nrmse", "require r2"}
    assert cases["require nrmse"].find("failure") is not None
    assert cases["require r2"].find("failure") is None
    summary = (tmp_path / "summary.md").read_text()
    assert summary.startswith("## mapmore: 0 of 1 runs in order")
    assert "| mapmore | validate |" in summary


def test_errors_are_json_too(study, tmp_path, mapmore):
    settings = ("--set", "data.files=[none_*.csv]", "--junit", tmp_path / "j.xml")
    result = mapmore("run", study, "--json", "-q", *settings, code=4)
    error = json.loads(result.stdout)["error"]
    assert error["exit_code"] == 4
    assert "none_*.csv" in error["message"]
    assert error["remedy"]
    assert "error: " in result.stderr
    case = next(ET.parse(tmp_path / "j.xml").iter("testcase"))
    assert case.find("error") is not None
    assert mapmore("show", tmp_path / "nothing.h5").stdout == ""
    told = mapmore("show", tmp_path / "nothing.h5", "--json", code=4)
    assert json.loads(told.stdout)["error"]["exit_code"] == 4


def test_a_warning_of_many_runs_is_told_once(study, mapmore):
    others = ", ".join(
        f"{{set: {{segment.strain.min_samples: {least}}}, as: {name}}}"
        for least, name in ((30, "one"), (31, "two"))
    )
    cuts = "segment.strain={method: even, count: 4, min_samples: 29}"
    result = mapmore("run", study, *options(cuts, f"validate.against=[{others}]"), code=0)
    told = "curve pressure=300: 1 segment(s) along strain instead of 4"
    (warning,) = (line for line in result.stderr.splitlines() if told in line)
    assert "(the same in 3 runs: bench.one, bench.two)" in warning


def test_a_level_that_was_measured_at_one_place_is_cut_into_one_segment(study, tmp_path, mapmore):
    write_recording(tmp_path, "bench", 300, [0.1] * 3, [379, 380, 381])
    mapmore("fuse", study, code=0)
    grid = mapmore("predict", "runs/bench/model.h5", "--grid", "pressure=300,strain=0.1", code=0)
    assert float(grid.stdout.splitlines()[1].split(",")[2]) == pytest.approx(380)
