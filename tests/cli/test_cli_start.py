"""The command starts quickly, and says what it can do."""

import os
from importlib.metadata import version

import pytest
from common import mapmore, python

import mapmore_cli
from mapmore_cli.cli.app import ORDER, Commands

HEAVY = (
    "numpy",
    "scipy",
    "h5py",
    "pydantic",
    "matplotlib",
    "yaml",
    "pint",
    "jinja2",
    "multiprocessing",
)


def modules_loaded_by(option):
    code = f"""
import sys
sys.argv = ["mapmore", {option!r}]
from mapmore_cli.cli.app import main
try:
    main()
except SystemExit as end:
    assert end.code in (0, None), end.code
print(*{{name.split(".")[0] for name in sys.modules}}, file=sys.stderr)
"""
    done = python(code, check=True)
    return set(done.stderr.split())


@pytest.mark.parametrize(
    ("option", "heavy"), [("--version", {*HEAVY, "rich"}), ("--help", {*HEAVY})]
)
def test_what_is_asked_first_loads_nothing_heavy(option, heavy):
    assert modules_loaded_by(option).isdisjoint(heavy)


def test_version_is_that_of_the_project(shell):
    assert shell("--version").stdout == f"mapmore {version('mapmore')}\n"
    assert mapmore_cli.__version__ == version("mapmore")


def test_help_lists_the_commands_in_the_order_of_the_work(mapmore):
    listed = mapmore("--help").stdout.split("Commands:")[1]
    assert [line.split()[0] for line in listed.strip().splitlines()] == [*ORDER]
    assert "..." not in listed  # every summary is short enough to be shown whole
    assert "Commands:" in mapmore().output


def test_commands_of_plugins_come_last_in_the_order_of_the_alphabet(monkeypatch):
    added = dict.fromkeys(("d", "b", "batch", "e", "a", "c"))
    monkeypatch.setattr("mapmore_cli.domain.plugins.entry_points", lambda _group: added)
    names = Commands(name="mapmore").list_commands(None)
    assert names[-5:] == ["a", "b", "c", "d", "e"]
    assert names[names.index("run") + 1] == "batch"


def test_variables_are_allowed_anywhere_on_the_line(mapmore, monkeypatch):
    monkeypatch.setenv("MAPMORE_ENV", "RIG")
    shown = mapmore("schema", "--env", "LAB", "keys", "--env", "ROOM", code=0)
    assert shown.stdout.startswith("### Top level")
    assert os.environ["MAPMORE_ENV"] == "LAB,ROOM,RIG"


@pytest.mark.parametrize("command", ORDER)
def test_every_command_has_help(command, mapmore):
    result = mapmore(command, "--help", code=0)
    assert result.stdout.startswith(f"Usage: mapmore {command}")
    assert "--install-completion" not in result.stdout, "an option of `mapmore` alone"


def test_shell_completion_knows_the_commands():
    environment = {
        "_MAPMORE_COMPLETE": "complete_bash",
        "COMP_WORDS": "mapmore se",
        "COMP_CWORD": "1",
    }
    done = mapmore(env=environment)
    assert done.stdout.split() == ["segment"]
