"""The core holds without any annex: a study runs, and a part that is missing is named."""

import ast
import shutil
from collections import defaultdict
from functools import partial
from pathlib import Path

import pytest
import yaml
from common import mapmore

import mapmore_cli as mm
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.pipeline.example import write_example

PROJECT = Path(__file__).resolve().parents[1]
COMMANDS = {
    "drafting": ["init", "."],
    "planning": ["tune", "study.yaml"],
    "campaigns": ["batch", "study.yaml"],
    "exporting": ["export", "model.h5", "--to", "c"],
}
KEYS = {
    "motion": ({"type": "state_space"}, "state_space"),
    "sums": ({"type": "sum", "sum": [{"formula": "sarosi"}, {"formula": "none"}]}, "sum"),
    "search": ({"type": "auto"}, "search"),
}


ANNEXES = [*COMMANDS, *KEYS]


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    folder = tmp_path_factory.mktemp("example") / "example"
    write_example(folder)
    first, _, _ = (folder / "study.yaml").read_text().partition("\n")
    assert first == "# yaml-language-server: $schema=mapmore.schema.json"
    assert (folder / "mapmore.schema.json").is_file()
    return folder


def test_recordings_in_memory_are_those_of_the_files(example):
    for columns, path in zip(mm.example(), sorted(example.glob("*.csv")), strict=True):
        _, *rows = path.read_text().splitlines()
        assert [*columns] == ["time", "pressure", "strain", "force"]
        last = [float(cell) for cell in rows[-1].split(",")]
        assert [values[-1] for values in columns.values()] == last
        assert {len(values) for values in columns.values()} == {len(rows)}


@pytest.mark.parametrize(
    ("folder", "name"), [("a b", "a-b"), ("x" * 90, "x" * 80), ("._", "example")]
)
def test_the_runs_of_an_example_have_the_name_of_its_folder(folder, name, tmp_path):
    study, *_ = write_example(tmp_path / folder)
    assert yaml.safe_load(study.read_text())["name"] == name


def test_an_example_may_fill_an_empty_folder_but_no_other(tmp_path):
    assert write_example(tmp_path)[0] == tmp_path / "study.yaml"
    with pytest.raises(WriteError, match="is not an empty folder"):
        write_example(tmp_path)


def test_the_core_runs_without_annexes_and_names_each_that_is_missing(example, tmp_path):
    folder, copy = tmp_path / "study", tmp_path / "lacking" / "mapmore_cli"
    shutil.copytree(example, folder)
    shutil.copytree(PROJECT / "mapmore_cli", copy)  # with what Python has compiled
    for annex in ANNEXES:
        shutil.rmtree(copy / "annexes" / annex)
    run = partial(mapmore, cwd=folder, env={"PYTHONPATH": str(copy.parent)}, timeout=120)
    finished = run("run", "study.yaml", "-q")
    assert finished.returncode == 0, finished.stderr
    assert (folder / "runs" / "example" / "scores.json").is_file()
    assert (folder / "runs" / "example" / "report" / "index.html").is_file()
    offered = run("--help").stdout
    for command, *arguments in COMMANDS.values():
        missing = run(command, *arguments)
        assert missing.returncode == 2
        assert f"`{command}` is not installed" in missing.stderr
        assert command in offered
    spec = yaml.safe_load((folder / "study.yaml").read_text())
    del spec["segment"], spec["dictionary"]
    for model, name in KEYS.values():
        (folder / "other.yaml").write_text(
            yaml.safe_dump({**spec, "name": "other", "model": model})
        )
        missing = run("run", "other.yaml", "-q")
        assert missing.returncode in (2, 3)
        assert f"`{name}`" in missing.stderr
        assert "install the package that" in missing.stderr


def imported_by(path):
    """The names `module` and `module.name` that a file of the package imports."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            yield from (node.module, *(f"{node.module}.{one.name}" for one in node.names))
        elif isinstance(node, ast.Import):
            yield from (one.name for one in node.names)


def test_no_module_of_the_core_serves_one_annex_alone():
    users = defaultdict(set)
    package = PROJECT / "mapmore_cli"
    for path in package.rglob("*.py"):
        place = path.relative_to(package).parts
        for name in imported_by(path):
            users[name].add(place[1] if place[0] == "annexes" else "core")
    core = [path.relative_to(PROJECT) for path in package.rglob("*.py")]
    # operators are found in their folder, by whoever parses a term
    found = {"annexes", "operators"}
    names = [".".join(path.with_suffix("").parts) for path in core if found.isdisjoint(path.parts)]
    assert {name: users[name] for name in names if users[name] in [{one} for one in ANNEXES]} == {}
