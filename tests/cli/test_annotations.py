"""Messages become annotations of the lines that they concern if GitHub Actions runs the command."""

import json

import pytest

from mapmore_cli.cli.annotations import workflow_commands


@pytest.fixture(autouse=True)
def actions(monkeypatch):
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.delenv("GITHUB_WORKSPACE", raising=False)


def annotations(result):
    return [line for line in result.stderr.splitlines() if line.startswith("::")]


def test_every_mistake_is_a_command_with_its_place(tmp_path, monkeypatch):
    """Indented lines belong to the mistake above them; a place is that of a file that exists."""
    monkeypatch.chdir(tmp_path)
    for name in ("a.yaml", "b,1.csv"):
        (tmp_path / name).touch()
    text = "a.yaml:3:7: 5 % off\n  mend it\n\nb,1.csv:row 4: odd\nnone.yaml:1:1: gone\nall\n"
    assert [*workflow_commands("error", text)] == [
        "::error file=a.yaml,line=3,col=7::a.yaml:3:7: 5 %25 off%0A  mend it",
        "::error file=b%2C1.csv,line=4::b,1.csv:row 4: odd",
        "::error::none.yaml:1:1: gone",
        "::error::all",
    ]
    monkeypatch.setenv("GITHUB_WORKSPACE", str(tmp_path.parent))
    (line,) = workflow_commands("notice", "a.yaml:3: short")
    assert line == f"::notice file={tmp_path.name}/a.yaml,line=3::a.yaml:3: short"


def test_issues_of_check_have_the_level_of_their_severity(study, mapmore):
    study.write_text(study.read_text() + "fit: {shape: {strain: increasing}}\n")
    result = mapmore("check", study, "--json")
    levels = {"error": "::error", "warning": "::warning", "hint": "::notice"}
    issues = json.loads(result.stdout)["issues"]
    lines = annotations(result)
    assert [levels[issue["severity"]] for issue in issues] == [one.split(" ")[0] for one in lines]
    assert f"::error file={study.name},line=" in lines[0]


def test_elsewhere_nothing_is_annotated(mapmore, monkeypatch):
    assert len(annotations(mapmore("run", "none.yaml", code=3))) == 1
    monkeypatch.setenv("GITHUB_ACTIONS", "false")
    assert annotations(mapmore("run", "none.yaml", code=3)) == []
