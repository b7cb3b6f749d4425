"""Messages become annotations of the lines that they concern if GitHub Actions runs the command."""

import json

import pytest


@pytest.fixture(autouse=True)
def actions(monkeypatch):
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.delenv("GITHUB_WORKSPACE", raising=False)


def annotations(result):
    return [line for line in result.stderr.splitlines() if line.startswith("::")]


def test_every_mistake_of_a_spec_is_annotated_at_its_line(study, mapmore):
    rows = study.read_text().splitlines()
    study.write_text("\n".join([*rows, "fit: {max_term: 1}", "valid: 1,2%", ""]))
    lines = annotations(mapmore("run", study, code=3))
    at = len(rows) + 1
    assert len(lines) == 2
    assert lines[0].startswith(f"::error file=bench.yaml,line={at},col=7::{study}:{at}:7: ")
    assert lines[1].startswith(f"::error file=bench.yaml,line={at + 1},col=1::")
    assert "valid: 1,2%25%0A" in lines[1]


def test_paths_start_at_the_root_of_the_checkout(study, mapmore, monkeypatch, tmp_path):
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path.parent))
    study.write_text("name: [\n")
    (line,) = annotations(mapmore("run", study.name, code=3))
    assert line.startswith(f"::error file={tmp_path.name}/bench.yaml,line=")
    (line,) = annotations(mapmore("run", "none.yaml", code=3))  # has no place
    assert line.startswith("::error::none.yaml: ")


def test_issues_of_check_have_the_level_of_their_severity(study, mapmore):
    study.write_text(study.read_text() + "fit: {shape: {strain: increasing}}\n")
    result = mapmore("check", study, "--json")
    levels = {"error": "::error", "warning": "::warning", "hint": "::notice"}
    issues = json.loads(result.stdout)["issues"]
    lines = annotations(result)
    assert [levels[issue["severity"]] for issue in issues] == [one.split(" ")[0] for one in lines]
    assert f"::error file={study.name},line=" in lines[0]


def test_elsewhere_nothing_is_annotated(mapmore, monkeypatch):
    monkeypatch.setenv("GITHUB_ACTIONS", "false")
    assert annotations(mapmore("run", "none.yaml", code=3)) == []
