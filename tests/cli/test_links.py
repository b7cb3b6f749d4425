"""No command writes through a link: what each one writes is found by running it once, and then
every file and folder of it is a link in its turn.
"""

import os
import shutil
from pathlib import Path

import pytest
from cli_samples import write_study

CAMPAIGN = """
campaign: sweep
runs:
  - {base: bench.yaml, set: {fit.max_terms: 1}, name: one}
"""
MODEL = "runs/bench/model.h5"
COMMANDS = {
    **{stage: (stage, "bench.yaml", "--force") for stage in ("ingest", "segment", "fit", "fuse")},
    "validate": ("validate", "bench.yaml", "--force"),
    "report": ("report", "bench.yaml", "--force"),
    "run": ("run", "bench.yaml", "--force", "--junit", "ci.xml", "--summary", "ci.md"),
    "batch": ("batch", "sweep.yaml", "--jobs", "1"),
    "export": ("export", MODEL, "--to", "c", "-o", "out", "--no-verify"),
    "figure": ("figure", "bench", "fit", "-o", "fit.svg", "--curve", "100", "--data", "fit.csv"),
    "predict": ("predict", MODEL, "--grid", "pressure=100:200:50,strain=0:0.1:0.05", "-o", "t.csv"),
    "invert": ("invert", MODEL, "wanted.csv", "--for", "pressure", "-o", "t.csv.gz"),
    "tune": ("tune", "bench.yaml", "--over", "fit.max_terms=1,2", "-o", "t.tex", "-o", "t.svg"),
    "freeze": ("freeze", "bench", "--tag", "now"),
    "compare": ("compare", MODEL, MODEL, "--figure", "drift.svg"),
    "example": ("example", "new"),
    "init": ("init", "recorded", "-o", "draft.yaml", "--yes"),
    "clean": ("clean", "other.yaml", "--yes"),
}
SOME = {"report": 3, "run": 3, "batch": 2}
"""How many outputs of these are tried in `make test`; `make test-all` tries them all."""

LONG = {
    "ingest",
    "segment",
    "fit",
    "fuse",
    "validate",
    "tune",
    "example",
    "figure",
    "compare",
    "init",
}
"""Commands that `make test-all` alone tries: they take long, and write by the same functions."""

NAMED = {"out", "new", "runs", "archive", ".lock"}
"""Folders that the user names may be links; and the lock, which has a test of its own."""


@pytest.fixture(scope="module")
def start(tmp_path_factory, finished):
    folder = tmp_path_factory.mktemp("links") / "start"
    spec, _ = finished
    shutil.copytree(spec.parent, folder)
    write_study(folder, "other")
    (folder / "sweep.yaml").write_text(CAMPAIGN)
    (folder / "recorded").mkdir()
    for path in folder.glob("bench_*.csv"):
        shutil.copy(path, folder / "recorded")
    (folder / "wanted.csv").write_text("force,strain\n200,0.01\n")
    return folder


def state(folder):
    """What tells whether anything was written: of every file and folder, by its path."""
    found = {}
    for parent, folders, names in os.walk(folder):
        for name in (*folders, *names):
            place = Path(parent) / name
            now = place.lstat()
            mark = () if name in folders else (now.st_ino, now.st_mtime_ns)
            found[place.relative_to(folder).as_posix()] = mark
    return found


def outputs(name, start, folder, mapmore, monkeypatch):
    """What a command writes, by path in the folder where it is called."""
    shutil.copytree(start, folder)
    monkeypatch.chdir(folder)
    before = state(folder)
    mapmore(*COMMANDS[name], code=0)
    return [
        path
        for path, mark in state(folder).items()
        if before.get(path) != mark and Path(path).name not in NAMED and ".trash/" not in path
    ]


def refused(name, path, start, folder, mapmore, monkeypatch):
    """A command meets a link in place of one of its outputs."""
    monkeypatch.chdir(folder.parent)
    shutil.rmtree(folder)
    shutil.copytree(start, folder)
    victim = folder.parent / "victim"
    shutil.rmtree(victim, ignore_errors=True)
    victim.mkdir()
    (victim / "precious").write_text("precious")
    place = folder / path
    place.parent.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(place) if place.is_dir() else place.unlink(missing_ok=True)
    is_folder = not Path(path).suffix or path.endswith("@now")
    place.symlink_to(victim if is_folder else victim / "precious")
    monkeypatch.chdir(folder)
    # a schema that is there stays as it is
    mapmore(*COMMANDS[name], code=0 if (name, path) == ("init", "mapmore.schema.json") else 7)
    assert [(one.name, one.read_text()) for one in victim.iterdir()] == [("precious", "precious")]
    assert place.is_symlink()


def walk(name, start, folder, mapmore, monkeypatch, most=None):
    paths = outputs(name, start, folder, mapmore, monkeypatch)
    assert paths
    for path in sorted(paths, key=lambda path: (path.count("/") != 2, path))[:most]:
        refused(name, path, start, folder, mapmore, monkeypatch)


@pytest.mark.usefixtures("batch_here")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.long] * (name in LONG)) for name in COMMANDS],
)
def test_no_command_writes_through_a_link(name, start, tmp_path, mapmore, monkeypatch):
    walk(name, start, tmp_path / "here", mapmore, monkeypatch, SOME.get(name))


@pytest.mark.long
@pytest.mark.usefixtures("batch_here")
@pytest.mark.parametrize("name", SOME)
def test_no_output_at_all_is_written_through_a_link(name, start, tmp_path, mapmore, monkeypatch):
    walk(name, start, tmp_path / "here", mapmore, monkeypatch)


PIPES = {
    "run.json": "run",
    "check.json": "run",
    "experiment.yaml": "run",
    ".seal": "run",
    "model.h5": "run",
    "../index.html": "run",
    "../../out/bench.tex": "export",
}


@pytest.mark.timeout(60)  # reading or writing a pipe without another end never returns
def test_no_command_waits_for_the_other_end_of_a_pipe(copied, mapmore, monkeypatch):
    """A pipe in place of a file that a command reads or writes, under a name of its own choice."""
    spec, runs = copied
    monkeypatch.chdir(spec.parent)
    shutil.copytree(runs, "kept")
    lines = {
        "run": ("run", spec, "--runs", runs),
        "export": ("export", "kept/bench/model.h5", "--to", "tex", "-o", "out", "--no-verify"),
    }
    Path("out").mkdir()
    for path, line in PIPES.items():
        shutil.rmtree(runs)
        shutil.copytree("kept", runs)
        place = runs / "bench" / path
        place.unlink(missing_ok=True)
        os.mkfifo(place)
        assert mapmore(*lines[line]).exit_code in (0, 7)
        assert place.is_fifo()
