"""Atomic writes, refusals of the file system, stamps, and the folder of a run."""

import errno
import json
import os
import signal
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from threading import Timer

import h5py
import numpy as np
import pytest

from mapmore_cli.domain.errors import DataError, WriteError
from mapmore_cli.domain.recording import Dataset, Quantity, Recording
from mapmore_cli.storage import artefacts, atomic, ownership, run_folder
from mapmore_cli.storage.atomic import (
    holds,
    is_special,
    refusals_told,
    replacing,
    unfinished_beside,
)
from mapmore_cli.storage.outputs import refuse_needed, write_bytes, write_text, written_as_text
from mapmore_cli.storage.run_folder import (
    RunFiles,
    is_tidy,
    open_run_folder,
    recover,
    run_lock,
    stage_folder,
    swap_in,
)
from mapmore_cli.storage.stamps import stamps_of, take_stamp


def test_write_replaces_the_whole_file(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "long old content\n")
    write_text(path, "ü\n")
    assert [holds(path, content) for content in ("ü\n".encode(), b"ue\n")] == [True, False]
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_written_into_and_what_is_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "a").symlink_to("pipe")
    special = ("/dev/stdout", "/dev/null", "/dev/fd/1", "/proc/self/fd/1", tmp_path / "pipe")
    assert [
        is_special(Path(path)) for path in (*special, tmp_path / "a", "/dev/shm/runs/demo/run.json")
    ] == [True] * 5 + [False] * 2


def full_disk(*_arguments):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def interrupt(*_arguments):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("fault", "told"), [(full_disk, WriteError), (interrupt, KeyboardInterrupt)]
)
def test_a_write_that_breaks_off_keeps_the_old_file(tmp_path, monkeypatch, fault, told):
    write_text(tmp_path / "a.txt", "old")
    monkeypatch.setattr(os, "fsync", fault)
    with pytest.raises(told) as caught:
        write_text(tmp_path / "a.txt", "new")
    assert fault is interrupt or (
        "No space left" in caught.value.message and "room" in caught.value.remedy
    )
    assert [file.read_text() for file in tmp_path.iterdir()] == ["old"]


def test_files_of_a_stage_are_flushed_once_before_they_take_their_place(tmp_path, monkeypatch):
    flushed = []
    monkeypatch.setattr(os, "fsync", lambda handle: flushed.append(os.fstat(handle).st_ino))
    with stage_folder(tmp_path, "report") as out:
        write_text(out / "scores.csv", "1\n")
        (out / "report").mkdir()
        write_text(out / "report" / "index.html", "page")
        assert not flushed
        inside = [place.stat().st_ino for place in (out, *out.rglob("*"))]
        swap_in(out, tmp_path, ["scores.csv", "report"])
    assert sorted(flushed) == sorted([*inside, tmp_path.stat().st_ino])
    assert flushed[-1] == tmp_path.stat().st_ino
    write_text(tmp_path / "run.json", "{}")  # a file alone: itself, and that it is there
    assert len(flushed) == len(inside) + 3


def test_missing_folder_passes_through(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_bytes(tmp_path / "none" / "a", b"")


def test_only_refusals_in_the_folder_are_write_errors(tmp_path):
    with pytest.raises(WriteError, match=r"fit\.h5"), refusals_told(tmp_path):
        raise PermissionError(errno.EACCES, "refused", str(tmp_path / "fit.h5"))
    with pytest.raises(PermissionError), refusals_told(tmp_path / "run"):
        raise PermissionError(errno.EACCES, "refused", str(tmp_path / "data.csv"))
    with pytest.raises(WriteError, match=f"{tmp_path}: cannot"), refusals_told(tmp_path / "run"):
        raise PermissionError(errno.EACCES, "refused", os.fsencode(tmp_path))
    with pytest.raises(OSError, match="odd"), refusals_told(tmp_path):
        raise OSError(errno.EIO, "odd", str(tmp_path))
    for fault in (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG):  # whatever the file
        with pytest.raises(WriteError, match="cannot be written") as told, refusals_told(tmp_path):
            raise OSError(fault, "", "/elsewhere")
        assert "make room" in told.value.remedy


def test_stamp_is_taken_again_when_size_or_time_changed(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("1\n")
    first = take_stamp(path)
    path.write_text("2\n")
    os.utime(path, ns=(first.mtime_ns, first.mtime_ns))  # as `cp -p` and `rsync -t` do
    second = take_stamp(path, first)
    assert (second.mtime_ns, second.size) == (first.mtime_ns, first.size)
    assert second.sha256 != first.sha256
    assert take_stamp(path, second) is second
    assert take_stamp(path, replace(second, sha256="")).sha256 == ""  # it is not read again
    assert take_stamp(path, second, rehash=True) == second
    (tmp_path / "b.csv").write_text("3\n")
    os.utime(tmp_path / "b.csv", ns=(first.mtime_ns, first.mtime_ns))
    (tmp_path / "b.csv").replace(path)
    assert take_stamp(path, second).sha256 not in (first.sha256, second.sha256)


def test_a_long_result_file_is_known_by_its_values(tmp_path, monkeypatch):
    """Its own checksum is taken from the writer, and computed by any other process."""
    monkeypatch.setattr("mapmore_cli.storage.stamps.LONG", 0)
    path, force = tmp_path / "ingest.h5", np.arange(5000.0)
    recording = Recording("r", "r.csv", {"force": force}, force.size, {})
    artefacts.write_dataset(
        path, Dataset("force", None, {"force": Quantity("force", "N")}, (recording,), ())
    )
    written = take_stamp(path)
    with h5py.File(path) as file:
        assert file.attrs["checksum"] == written.sha256
    os.utime(path, ns=(1, 1))
    assert take_stamp(path, written).sha256 == written.sha256

    with h5py.File(path, "a") as file:
        file["recordings/000/columns/force"][17] = 0.0
    assert take_stamp(path, written).sha256 != written.sha256
    os.utime(path, ns=(1, 1))  # as if nothing had happened
    assert take_stamp(path, written, rehash=True).sha256 != written.sha256


def test_stamps_of_folders_name_every_file(tmp_path):
    (tmp_path / "report" / "tables").mkdir(parents=True)
    names = ["fit.h5", "report/index.html", "report/tables/a.csv"]
    for name in names:
        (tmp_path / name).write_text(name)
    assert list(stamps_of(tmp_path, ("fit.h5", "report"))) == names


def test_places_that_cannot_be_the_folder_of_a_run(tmp_path, monkeypatch):
    (tmp_path / "runs").write_text("")
    for name, words in (
        ("runs", "runs: is a file"),
        ("runs/demo", "runs: is a file"),
        ("x" * 300, "too long"),
    ):
        with pytest.raises(WriteError, match=words):
            open_run_folder(tmp_path / name)
    # permissions do not bind the superuser
    monkeypatch.setattr(os, "access", lambda _path, _mode: False)
    with pytest.raises(WriteError, match="may not write"):
        open_run_folder(tmp_path / "my" / "demo")


def new_report(run_dir, text, known=run_folder.NOTHING):
    with stage_folder(run_dir, "report") as out:
        (out / "report").mkdir()
        (out / "report" / "index.html").write_text(text)
        made = stamps_of(out, ("report",))
        swap_in(out, run_dir, ("report",), known)
    return made


def test_folders_are_swapped_whole_and_keep_what_others_put_there(tmp_path):
    run_dir = tmp_path / "runs" / "demo"
    run_dir.mkdir(parents=True)
    known = new_report(run_dir, "old")
    report, trash = run_dir / "report", tmp_path / "runs" / ".trash"
    (report / "left-over.svg").write_text("ours")
    known |= stamps_of(run_dir, ("report/left-over.svg",))
    (report / "notes").mkdir()
    (report / "notes" / "mine.txt").write_text("mine")
    (report / "link").symlink_to(tmp_path)
    known |= new_report(run_dir, "new", known)
    names = ["report", "report/index.html", "report/link", "report/notes", "report/notes/mine.txt"]
    assert sorted(path.relative_to(run_dir).as_posix() for path in run_dir.rglob("*")) == names
    assert (report / "index.html").read_text() == "new"
    assert not trash.exists()
    (report / "index.html").write_text("edited by hand")
    new_report(run_dir, "newer", known)
    assert (report / "index.html").read_text() == "newer"
    (kept,) = trash.glob("*/demo/report/index.html")
    assert kept.read_text() == "edited by hand"


def test_an_output_that_is_a_link_is_refused(tmp_path):
    (tmp_path / "victim").mkdir()
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "report").symlink_to(tmp_path / "victim")
    with pytest.raises(WriteError, match="report: is a link"):
        new_report(tmp_path / "run", "new")
    assert list((tmp_path / "victim").iterdir()) == []
    (tmp_path / "link").symlink_to(tmp_path / "victim")
    with pytest.raises(WriteError, match="link: is a link"):
        open_run_folder(tmp_path / "link")


def test_failed_swap_puts_the_old_folder_back(tmp_path, monkeypatch):
    new_report(tmp_path, "old")
    rename = Path.rename

    def fail_on_new(self, target):
        if self.parent != tmp_path:
            raise KeyboardInterrupt
        return rename(self, target)

    monkeypatch.setattr(run_folder.Path, "rename", fail_on_new)
    with pytest.raises(KeyboardInterrupt):
        new_report(tmp_path, "new")
    assert (tmp_path / "report" / "index.html").read_text() == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["report"]


def test_folder_in_place_of_an_output_file_is_not_removed(tmp_path):
    (tmp_path / "fit.h5").mkdir()
    (tmp_path / "fit.h5" / "precious").write_text("")
    with stage_folder(tmp_path, "fit") as out:
        (out / "fit.h5").write_text("")
        with pytest.raises(WriteError, match=r"fit\.h5"), refusals_told(tmp_path):
            swap_in(out, tmp_path, ("fit.h5",))
    assert (tmp_path / "fit.h5" / "precious").exists()


def test_recover(tmp_path):
    (tmp_path / ".old-report").mkdir()
    (tmp_path / ".old-report" / "index.html").write_text("old")
    (tmp_path / ".tmp-0123456789ab-report" / "report").mkdir(parents=True)
    (tmp_path / ".tmp-0123456789ab-run.json").write_text("{")
    (tmp_path / "fit.h5").write_text("kept")
    recover(tmp_path, ["report"])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fit.h5", "report"]
    (tmp_path / ".old-report").mkdir()
    recover(tmp_path, ["report"])  # the new folder is in place: the old one goes
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fit.h5", "report"]


def test_only_temporaries_of_our_own_are_removed(tmp_path):
    for name in (".tmp-x", ".tmp-notes.txt", ".tmp-notes-20260101", ".old-thesis"):
        (tmp_path / name).write_text("precious")
    recover(tmp_path, ["report"])
    assert len(list(tmp_path.iterdir())) == 4


def killed_while_it_writes(path):
    """A process that dies with an unfinished file, and with an unfinished folder, for `path`."""
    child = os.fork()
    if child == 0:
        with (
            unfinished_beside(path) as file,
            unfinished_beside(path.with_name("folder"), folder=True) as folder,
        ):
            file.write_text("half")
            (folder / "half").write_text("half")
            os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)


def test_the_next_write_clears_away_what_a_killed_one_left(tmp_path):
    killed_while_it_writes(tmp_path / "model.c")
    precious = [
        ".tmp-0123456789ab-other.c",
        ".tmp-model.c",
        "x.tmp-0123456789ab-model.c",
        ".tmp-0123456789AB-model.c",
    ]
    for name in precious:
        (tmp_path / name).write_text("precious")
    assert len(list(tmp_path.iterdir())) == 2 + len(precious)
    with written_as_text(tmp_path / "model.c") as text:
        text.write("whole")
    with unfinished_beside(tmp_path / "folder", folder=True) as folder:
        folder.rename(tmp_path / "folder")
    assert {path.name for path in tmp_path.iterdir()} == {"model.c", "folder", *precious}
    assert list((tmp_path / "folder").iterdir()) == []


def test_what_another_process_is_writing_stays(tmp_path):
    written, go_on = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        with replacing(tmp_path / "model.c") as file:
            file.write(b"theirs")
            os.write(written[1], b".")
            os.read(go_on[0], 1)
        os._exit(0)
    os.read(written[0], 1)
    write_bytes(tmp_path / "model.c", b"ours")
    assert len(list(tmp_path.iterdir())) == 2
    os.write(go_on[1], b".")
    assert os.waitpid(child, 0)[1] == 0
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"theirs"]


def test_a_file_that_was_taken_for_abandoned_is_begun_again(tmp_path, monkeypatch):
    """Another process may look between the making of a file and the lock on it."""
    touch, begun = Path.touch, []

    def looked_at(self, **options):
        touch(self, **options)
        begun.append(self)
        if len(begun) == 1:
            atomic._clear_abandoned(tmp_path / "a")

    monkeypatch.setattr(Path, "touch", looked_at)
    write_bytes(tmp_path / "a", b"whole")
    assert len(begun) == 2
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"whole"]


@pytest.mark.parametrize("name", ["scores.csv", "report/notes.txt", "run.json", ".tmp-x"])
def test_a_folder_of_the_user_is_refused(name, tmp_path):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text('{"mine": 1}')
    with pytest.raises(WriteError, match="holds files that mapmore did not write"):
        open_run_folder(tmp_path)
    assert (tmp_path / name).read_text() == '{"mine": 1}'


@pytest.mark.parametrize(
    ("files", "named"), [("abc", r"\(a, b, c\)"), ("abcd", r"\(a, b, c, \.\.\.\)")]
)
def test_three_files_of_the_user_are_named(files, named, tmp_path):
    for name in files:
        (tmp_path / name).write_text("mine")
    with pytest.raises(WriteError, match=named):
        open_run_folder(tmp_path)


def test_what_a_killed_start_leaves_is_no_folder_of_the_user(tmp_path):
    (tmp_path / ".lock").write_text("")
    (tmp_path / ".tmp-0123456789ab-run.json").write_text("{")
    open_run_folder(tmp_path)
    (tmp_path / "run.json").write_text('{"stages": {')
    open_run_folder(tmp_path)


@pytest.mark.parametrize("make", [Path.mkdir, lambda lock: lock.symlink_to("kept")])
def test_a_folder_or_a_link_in_place_of_the_lock(tmp_path, make):
    make(tmp_path / ".lock")
    with (
        pytest.raises(WriteError, match="is a folder or a link, but this is the place of the lock"),
        run_lock(tmp_path),
    ):
        pass
    assert [path.name for path in tmp_path.iterdir()] == [".lock"]


def test_only_one_process_writes_a_run(tmp_path):
    for _ in range(2):
        with (
            run_lock(tmp_path),
            pytest.raises(WriteError, match="another process is writing this run"),
            run_lock(tmp_path),
        ):
            pass


def test_remains_of_a_process_show_that_a_run_is_not_tidy(tmp_path):
    for name, tidy in (
        *(("fit.h5", True), (".tmp-x", True), (".tmp-0123456789ab-fit.h5", False)),
        *((".old-report", False), ("x.old-report", True)),
    ):
        (tmp_path / name).write_text("")
        assert is_tidy(tmp_path) is tidy
        (tmp_path / name).unlink()


def test_the_structures_of_a_search_are_read_or_told_to_be_damaged(tmp_path):
    assert RunFiles(tmp_path).search() is None
    (tmp_path / "search.json").write_text("{")
    with pytest.raises(DataError, match=r"search\.json: is damaged"):
        RunFiles(tmp_path).search()


@pytest.mark.skipif(os.name != "posix", reason="flock is of POSIX")
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.EBADF, errno.EINVAL])
def test_a_file_system_without_locks(number, tmp_path, monkeypatch):
    """As network drives do: the error was an internal fault, or said that stdout were closed."""
    import fcntl

    def refused(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refused)
    with (
        pytest.raises(WriteError, match=rf"cannot be locked \({os.strerror(number)}\)") as told,
        run_lock(tmp_path),
    ):
        pass
    assert told.value.remedy == "choose a local folder with --runs"


@pytest.mark.skipif(not Path("/dev/fd").is_dir(), reason="needs the open files as a folder")
def test_an_open_file_is_written_by_its_name_although_the_name_is_a_link(tmp_path):
    with (
        (tmp_path / "a").open("wb") as file,
        atomic.opened_special(Path(f"/dev/fd/{file.fileno()}")) as stream,
    ):
        stream.write(b"x")
    assert (tmp_path / "a").read_bytes() == b"x"


@pytest.mark.skipif(os.name != "posix", reason="flock is of POSIX")
def test_a_locked_file_is_waited_for_unless_it_may_be_abandoned(tmp_path):
    (tmp_path / "a").touch()
    held = atomic._locked(tmp_path / "a")
    assert atomic._locked(tmp_path / "a", patient=False) is None
    Timer(0.05, os.close, [held]).start()
    os.close(atomic._locked(tmp_path / "a"))


@pytest.mark.parametrize("name", ["run.json", ".seal", "model.h5", "report/a.svg", "notes.txt"])
def test_no_output_replaces_a_file_of_a_run(tmp_path, name):
    """Whatever else stands in its folder may be replaced."""
    stamp = {"size": 1, "mtime_ns": 1, "sha256": "-"}
    files = {"model.h5": stamp, "report/a.svg": stamp}
    record = {"format_version": "1.2", "stages": {}, "files": files}
    path = tmp_path / name
    path.parent.mkdir(exist_ok=True)
    path.write_text("x")
    (tmp_path / "run.json").write_text(json.dumps(record))
    is_own = name != "notes.txt"
    with pytest.raises(WriteError, match="belongs to the run") if is_own else nullcontext():
        refuse_needed(path)


@pytest.mark.parametrize("now", [True, False])
def test_the_record_of_a_run_is_removed_last(tmp_path, monkeypatch, now):
    gone = []
    monkeypatch.setattr(ownership, "remove", lambda path: gone.append(path.name))
    monkeypatch.setattr(ownership, "to_trash", lambda _folder, paths: gone.extend(paths))
    ownership.remove_own(tmp_path, ["run.json", "z", ".lock", "a"], now)
    assert gone == ["a", "z", "run.json"]
