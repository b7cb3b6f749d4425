"""`clean` removes what the record of a run lists, as it was written, and nothing else."""

import json
import os
import shutil
import signal
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from cli_samples import write_study

from mapmore_cli.cli.clean import _unnamed
from mapmore_cli.storage import ownership
from mapmore_cli.storage.ownership import contents_of, remove_own


@pytest.fixture
def runs(copied):
    """A folder with the finished run `bench`, and beside it the spec of another one."""
    spec, folder = copied
    write_study(spec.parent, "other")
    return folder


@pytest.fixture
def cleaned(runs, mapmore):
    def clean(*options):
        found = mapmore("clean", runs.parent / "other.yaml", "--runs", runs, "--json", *options)
        assert found.exit_code == 0, found.stderr
        return json.loads(found.stdout)

    return clean


def there(runs):
    """Names in a folder of runs, but the page of all of them and its lock."""
    return {path.name for path in runs.iterdir()} - {"index.html", ".lock"}


def everything(folder):
    """All that lies below a folder of runs but their page, links not followed."""
    found = {
        (Path(parent) / name).relative_to(folder).as_posix()
        for parent, folders, names in os.walk(folder)
        for name in (*folders, *names)
    }
    return sorted(found - {"index.html", ".lock"})


def test_files_are_listed_then_moved_to_the_trash_then_removed(runs, cleaned):
    before = everything(runs)
    listed = cleaned()
    files = {path for path in before if (runs / path).is_file()}
    assert {Path(path).relative_to(runs).as_posix() for path in listed["files"]} == files
    assert (listed["removed"], everything(runs)) == (False, before)
    shutil.copytree(runs, runs.parent / "again")
    assert cleaned("--yes")["removed"] is True
    assert there(runs) == {".trash"}
    (trash,) = (runs / ".trash").glob("*/bench")
    assert {f"bench/{one}" for one in everything(trash)} == {*before} - {"bench", "bench/.lock"}
    assert cleaned("--yes")["files"] == []  # the trash is no run
    (runs.parent / "again" / "bench").rename(runs / "bench")
    cleaned("--yes", "--now")
    assert there(runs) == {".trash"}


def precious(folder, name, text="mine"):
    place = folder / name
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text(text)
    return name


def rewritten(folder, name):
    with (folder / name).open("r+b") as file:
        file.write(b"!")
    return name


def same_size_and_time(folder, name):
    state = (folder / name).stat()
    rewritten(folder, name)
    os.utime(folder / name, ns=(state.st_atime_ns, state.st_mtime_ns))
    return name


def linked(folder, name, to):
    (folder / name).symlink_to(to)
    return name


def replaced_by_link(folder, name):
    (folder / name).rename(folder.parent / "moved")
    return linked(folder, name, folder.parent / "moved")


def forged(folder, path):
    """A record that lists a file of the user, with the stamp of another."""
    record = json.loads((folder / "run.json").read_text())
    record["stages"]["report"]["outputs"][path] = record["stages"]["fit"]["outputs"]["fit.h5"]
    (folder / "run.json").write_text(json.dumps(record))
    return precious(folder, "mine.txt")


def nested(folder):
    shutil.copytree(folder, folder.parent / "copy")
    (folder.parent / "copy").rename(folder / "report" / "inner")
    return "report/inner"


KEPT_BY = {
    "a file": lambda run: precious(run, "precious.docx"),
    "a file among figures": lambda run: precious(run, "report/notes.txt"),
    "a name in capitals": lambda run: precious(run, "Fit.h5"),
    "a folder": lambda run: precious(run, "data/a.csv").partition("/")[0],
    "a changed result": lambda run: rewritten(run, "scores.csv"),
    "a changed figure": lambda run: rewritten(run, "report/index.html"),
    "a changed spec": lambda run: rewritten(run, "experiment.yaml"),
    "a link": lambda run: linked(run, "data", run.parent.parent),
    "a result that is a link": lambda run: replaced_by_link(run, "model.h5"),
    "a report that is a link": lambda run: replaced_by_link(run, "report"),
    "a record that is a link": lambda run: replaced_by_link(run, "run.json"),
    "a run within": nested,
    "a forged record": lambda run: forged(run, "mine.txt"),
    "a record that leads out": lambda run: forged(run, "../../victim"),
    "a record that leads to the root": lambda run: forged(run, "/etc/passwd"),
    "a lock with text": lambda run: precious(run, ".lock"),
}


@pytest.mark.parametrize("make", KEPT_BY.values(), ids=KEPT_BY)
def test_what_is_not_ours_keeps_the_run_and_is_named(make, runs, cleaned):
    run = runs / "bench"
    (runs.parent / "victim").write_text("mine")
    name = make(run)
    before = everything(runs.parent)
    found = cleaned("--yes", "--now")
    assert (found["files"], found["kept"]) == ([], {str(run): [name]})
    assert everything(runs.parent) == before
    assert (runs.parent / "victim").read_text() == "mine"


def test_contents_decide_where_nothing_can_be_brought_back(runs, cleaned):
    name = same_size_and_time(runs / "bench", "report/index.html")
    assert cleaned("--yes", "--now")["kept"] == {str(runs / "bench"): [name]}


def test_runs_without_a_spec_are_listed_in_the_order_of_the_alphabet(tmp_path, monkeypatch):
    monkeypatch.setattr("mapmore_cli.storage.run_record.load_origin", lambda _folder: True)
    for name in ("d", "b", "f", "a", "e", "c"):
        (tmp_path / name).mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "a")
    assert [folder.name for folder in _unnamed(tmp_path, {"c", "none"})] == [*"abdef"]


def test_a_copy_of_a_run_is_the_users(runs, cleaned):
    for name in ("mine", "bench.2"):
        shutil.copytree(runs / "bench", runs / name)
    (runs / "link").symlink_to("mine")
    found = cleaned("--yes")
    assert found["unnamed"] == [str(runs / "bench")]
    assert set(found["kept"]) == {str(runs / "mine"), str(runs / "bench.2")}
    assert (runs / "mine" / "report" / "index.html").is_file()


def test_what_killed_processes_left_goes_with_the_run(runs, cleaned):
    run = runs / "bench"
    (run / "report").rename(run / ".old-report")
    (run / ".tmp-0123456789ab-fit").mkdir()
    (run / ".tmp-0123456789ab-fit" / "fit.h5").write_text("half")
    (run / ".tmp-0123456789ab-run.json").write_text("half")
    cleaned("--yes")
    assert there(runs) == {".trash"}


def test_a_cleaning_that_is_killed_can_be_finished(runs, cleaned, monkeypatch):
    """At every seventh of its steps; nothing is lost, and the rest goes the next time."""
    whole = {path for path in everything(runs / "bench") if (runs / "bench" / path).is_file()}
    shutil.copytree(runs / "bench", runs.parent / "kept")
    rename = Path.rename

    def dies_at(step):
        steps = iter(range(1, step))
        return lambda self, target: (
            (os.kill(os.getpid(), signal.SIGKILL) if next(steps, None) is None else None)
            or rename(self, target)
        )

    for step in range(1, len(whole), 7):
        child = os.fork()
        if child == 0:
            monkeypatch.setattr(Path, "rename", dies_at(step))
            remove_own(runs / "bench", contents_of(runs / "bench").own, now=False)
            os._exit(0)
        assert os.waitpid(child, 0)[1] == signal.SIGKILL
        cleaned("--yes")
        assert there(runs) == {".trash"}
        moved = {
            one
            for place in (runs / ".trash").glob("*/bench*")
            for one in everything(place)
            if (place / one).is_file()
        }
        assert moved == whole - {".lock"}
        shutil.rmtree(runs / ".trash")
        shutil.copytree(runs.parent / "kept", runs / "bench")


def test_a_trash_that_cannot_take_anything(runs, mapmore, monkeypatch):
    before = everything(runs / "bench")
    arguments = ("clean", runs.parent / "other.yaml", "--runs", runs, "--yes")
    (runs / ".trash").symlink_to(runs.parent)
    mapmore(*arguments, code=7, says=".trash: is a link")
    (runs / ".trash").unlink()
    (runs / ".trash").write_text("mine")
    mapmore(*arguments, code=7, says=".trash: cannot be written")
    (runs / ".trash").unlink()
    shared = Path("/dev/shm")
    if not shared.is_dir() or shared.stat().st_dev == runs.stat().st_dev:
        pytest.skip("there is no other file system at hand")
    with TemporaryDirectory(dir=shared) as elsewhere:
        monkeypatch.setattr(ownership, "TRASH", elsewhere)
        mapmore(*arguments, code=7, says="another file system")
    assert everything(runs / "bench") == before


def test_no_run_overwrites_what_changed_since(copied, mapmore):
    """It makes way into the trash, and is named; what came into the report stays there."""
    spec, runs = copied
    run = runs / "bench"
    changed = ("check.json", "experiment.yaml", "scores.csv", "model.h5", "report/index.html")
    edited = {name: f"edited {name}" for name in changed}
    for name, text in edited.items():
        precious(run, name, text)
    precious(run, "report/notes/mine.txt")
    told = mapmore("run", spec, "--runs", runs, "--force", code=0).stderr
    assert (run / "report" / "notes" / "mine.txt").read_text() == "mine"
    files = [path for path in (runs / ".trash").rglob("*") if path.is_file()]
    assert {path.read_text() for path in files} == {*edited.values()}
    for name in changed:
        assert f"{name} was changed after the run" in told
        assert (run / name).read_bytes() != edited[name].encode()
    mapmore("run", spec, "--runs", runs, "--force", code=0)
    assert len([path for path in (runs / ".trash").rglob("*") if path.is_file()]) == len(changed)


@pytest.mark.usefixtures("batch_here")
def test_no_page_of_a_campaign_is_overwritten_that_changed_since(copied, mapmore):
    spec, runs = copied
    campaign = spec.with_name("sweep.yaml")
    campaign.write_text(f"campaign: sweep\nruns:\n  - {{base: {spec.name}}}\n")
    batch = ("batch", campaign, "--runs", runs, "--jobs", "1")
    mapmore(*batch, code=0)
    assert "changed after" not in mapmore(*batch, code=0).stderr
    assert not (runs / ".trash").exists()
    precious(runs / "sweep", "index.html", "edited")
    precious(runs / "sweep", "notes.txt")
    assert "index.html: was changed after" in mapmore(*batch, code=0).stderr
    (kept,) = (runs / ".trash").glob("*/sweep/*")
    assert (kept.name, kept.read_text()) == ("index.html", "edited")
    assert (runs / "sweep" / "notes.txt").read_text() == "mine"
