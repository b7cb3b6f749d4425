"""How the command line is called in tests."""

import json
import shutil
from functools import cache

import common
import pytest
import typer.testing
from cli_samples import BEGINS, hand_model, write_study
from typer.main import get_command
from typer.testing import CliRunner
from workers_here import in_turn

from mapmore_cli.cli.app import app


@pytest.fixture(scope="session", autouse=True)
def one_command():
    """The command is put together once, not for every call: the options of all subcommands take a
    while.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(typer.testing, "_get_command", cache(get_command))
        yield


@pytest.fixture(scope="session")
def mapmore():
    """Calls the command in this process; it has to end with the `code` and to tell on stderr what
    it `says`, where these are given.
    """

    def call(
        *args,
        stdin=None,
        code=None,
        says=(),
    ):
        result = CliRunner().invoke(
            app, [str(arg) for arg in args], input=stdin, prog_name="mapmore"
        )
        assert code in (None, result.exit_code), result.stderr
        for words in [says] if isinstance(says, str) else says:
            assert words in result.stderr
        return result

    return call


@pytest.fixture(scope="session")
def document(mapmore):
    """Calls the command with `--json` where stderr has to stay empty, and reads the one document
    that it prints.
    """

    def call(*args):
        result = mapmore(*args, "--json")
        assert (result.exit_code, result.stderr) == (0, "")
        return json.loads(result.stdout)

    return call


@pytest.fixture(scope="session")
def shell():
    """Calls the command in a process of its own."""

    return common.mapmore


@pytest.fixture(autouse=True)
def folder_of_its_own(request, tmp_path, monkeypatch):
    """A test that calls the command does it in its folder, where the runs are without `--runs`."""
    if {"mapmore", "document"} & {*request.fixturenames}:
        monkeypatch.chdir(tmp_path)


@pytest.fixture
def batch_here(monkeypatch):
    """Let `batch` do its runs in this process: to start another takes longer than such a run."""
    monkeypatch.setattr("mapmore_cli.annexes.campaigns.workers.in_processes", in_turn)


@pytest.fixture
def study(tmp_path):
    """A study that has not run yet."""
    return write_study(tmp_path)


@pytest.fixture(scope="session")
def finished(tmp_path_factory, mapmore):
    """A study that has run: its spec and its folder of runs; not to be changed."""
    folder = tmp_path_factory.mktemp("finished")
    spec = write_study(folder)
    mapmore("run", spec, "--runs", folder / "runs", "-q", code=0)
    return spec, folder / "runs"


@pytest.fixture
def copied(finished, tmp_path):
    """A copy of `finished`, which a test may change: its spec and its folder of runs."""
    spec, runs = finished
    shutil.copytree(spec.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / spec.name, tmp_path / runs.name


@pytest.fixture(scope="session")
def begun(tmp_path_factory, mapmore):
    """The folder in which the example study has run, and what the two commands printed."""
    folder = tmp_path_factory.mktemp("begun")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return folder, [
            mapmore(*words, *["--set", "report.figures=[fit]"] * number, code=0)
            for number, words in enumerate(BEGINS)
        ]


@pytest.fixture(scope="session")
def model_file(tmp_path_factory):
    """`hand_model` as a file."""
    from mapmore_cli.storage.artefacts import write_model

    path = tmp_path_factory.mktemp("model") / "model.h5"
    write_model(path, hand_model())
    return path
