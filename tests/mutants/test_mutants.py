"""The list of small faults fits the package: each has its line, and is code that can run."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

sys.path.insert(0, str(Path(__file__).parent))
import mutants
from mutants import COUNT, LIST, PACKAGE, Mutant

LISTED = [Mutant(**one) for one in yaml.safe_load(LIST.read_text(encoding="utf-8"))]


def test_a_hundred_faults_each_with_its_line_and_its_tests():
    assert len(set(LISTED)) == COUNT
    table = mutants.rooms()
    for one in LISTED:
        text = (PACKAGE / one.file).read_text(encoding="utf-8")
        faulty = one.applied(text)
        assert ast.dump(ast.parse(faulty)) != ast.dump(ast.parse(text)), one
        tests = mutants.tests_of(PACKAGE / one.file, table)
        assert tests
        assert all((mutants.PROJECT / test).exists() for test in tests), tests


@pytest.mark.parametrize(
    ("code", "faults"),
    [
        ("a = b + 1", {"a = b - 1", "a = b + 2"}),
        ("a = b * 0.5 if c else d", {"a = b / 0.5 if c else d", "a = b * 5.0 if c else d"}
         | {"a = d if c else b * 0.5"}),
        ("a = min(b, -c)", {"a = max(b, -c)", "a = min(b, +c)"}),
        ("a = not b or c.copy()", {"a = not b and c.copy()", "a = not b or c"}
         | {"a = True and b or c.copy()"}),
        ("a: Annotated[int, 3] = 1", {"a: Annotated[int, 3] = 2"}),
        ('raise ValueError("1" + 2)', set()),
    ],
)  # fmt: skip
def test_what_can_be_wrong_with_a_line(code, faults, tmp_path, monkeypatch):
    monkeypatch.setattr(mutants, "PACKAGE", tmp_path)
    (tmp_path / "a.py").write_text(code + "\n")
    assert {one.becomes for one in mutants.mutants_of(tmp_path / "a.py")} == faults


def test_tests_that_do_not_finish_have_noticed_nothing(tmp_path, monkeypatch):
    def never_ends(*_line, **_options):
        raise subprocess.TimeoutExpired("pytest", mutants.SECONDS)

    (tmp_path / "mapmore_cli").mkdir()
    (tmp_path / "mapmore_cli" / "__init__.py").write_text("")
    monkeypatch.setattr(subprocess, "run", never_ends)
    assert mutants.outcome_of(None, tmp_path, []) == mutants.UNFINISHED
