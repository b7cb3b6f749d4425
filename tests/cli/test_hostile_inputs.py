"""Tables, folders and outputs that nobody expects: each ends with the right code and a message that
says where.
"""

import os
import resource
import sys
import threading
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from cli_samples import write_study
from common import process

import mapmore_cli
from mapmore_cli.domain.errors import DataError, WriteError
from mapmore_cli.domain.foreign import csv_cell, printable
from mapmore_cli.storage.outputs import write_text, written_as_text
from mapmore_cli.storage.readers import READERS, TableRequest


def test_a_pipe_is_written_into_and_not_replaced(tmp_path):
    pipe, found = tmp_path / "out.csv", []
    os.mkfifo(pipe)
    for write in (lambda: write_text(pipe, "a\n"), lambda: _stream(pipe)):
        reader = threading.Thread(target=lambda: found.append(pipe.read_text()))
        reader.start()
        write()
        reader.join()
    assert found == ["a\n", "a\n"]
    assert pipe.is_fifo()


def _stream(path):
    with written_as_text(path) as text:
        text.write("a\n")


def test_devices_are_written_into_and_links_are_refused(tmp_path):
    write_text(Path("/dev/null"), "a")
    assert not Path("/dev/null").is_file()
    with pytest.raises(WriteError):
        write_text(Path("/dev/full"), "a")
    with pytest.raises(WriteError), written_as_text(Path("/dev/full")) as text:
        text.write("a")
    assert not Path("/dev/full").is_file()
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "link.csv").symlink_to("real.csv")
    for write in (
        lambda path: write_text(path, "new"),
        lambda path: written_as_text(path).__enter__(),
    ):
        with pytest.raises(WriteError, match=r"link\.csv: is a link"):
            write(tmp_path / "link.csv")
    assert (tmp_path / "real.csv").read_text() == "old"


@pytest.mark.parametrize(
    ("line", "code", "words"),
    [
        ("schema", 7, "it is closed"),
        ("--help", 7, "it is closed"),
        ("check none.yaml --json", 3, "error: none.yaml: no such file or directory"),
    ],
)
def test_what_a_closed_stdout_loses_is_told(line, code, words, tmp_path, shell):
    done = shell(*line.split(), cwd=tmp_path, preexec_fn=lambda: os.close(1))
    told, _ = done.stderr.splitlines()
    assert (done.returncode, words in told) == (code, True)


def test_a_closed_stdin_has_no_table(model_file, tmp_path, shell):
    done = shell("predict", model_file, "-", cwd=tmp_path, preexec_fn=lambda: os.close(0))
    assert done.returncode == 2
    assert done.stderr.startswith("error: stdin: cannot be read (Bad file descriptor)")


def test_a_closed_stdin_asks_nobody(tmp_path, shell):
    write_study(tmp_path)
    done = shell("init", "bench_1.csv", "-o", "-", cwd=tmp_path, preexec_fn=lambda: os.close(0))
    assert "internal fault" not in done.stderr
    assert "Traceback" not in done.stderr


def without_privileges(*arguments, folder):
    """The command as a user whom permissions bind: root is not."""
    drop = (
        []
        if os.getuid()
        else [
            "setpriv",
            "--bounding-set=-dac_override,-dac_read_search",
            "--inh-caps=-dac_override,-dac_read_search",
        ]
    )
    environment = {**os.environ, "PYTHONPATH": str(Path(mapmore_cli.__file__).parents[1])}
    command = [*drop, sys.executable, "-m", "mapmore_cli", *arguments]
    return process(*command, cwd=folder, env=environment)


@pytest.mark.skipif(os.name != "posix", reason="permissions of files are those of POSIX")
@pytest.mark.parametrize(
    ("dark", "command"),
    [("runs/bench", ["show", "runs/bench/model.h5"]), ("logs", ["check", "logs.yaml"])],
)
def test_what_may_not_be_read_is_no_internal_fault(dark, command, tmp_path):
    shown = write_study(tmp_path).read_text()
    (tmp_path / "logs.yaml").write_text(shown.replace("bench_*.csv", "logs/bench_*.csv"))
    (tmp_path / "logs").mkdir()
    (tmp_path / "runs" / "bench" / "report").mkdir(parents=True)
    for name in ("model.h5", "run.json", "report/index.html"):
        (tmp_path / "runs" / "bench" / name).write_text('{"stages": {}}')
    (tmp_path / dark).chmod(0)
    try:
        done = without_privileges(*command, folder=tmp_path)
    finally:
        (tmp_path / dark).chmod(0o755)
    assert done.returncode == 4, done.stderr
    assert "error: " in done.stderr
    assert str(Path(dark)) in done.stderr


def test_commands_to_a_terminal_in_names_are_shown_and_not_obeyed():
    assert printable("a\x1b[2J\x9b31m\u202eb\r\tc\nd") == "a\\x1b[2J\\x9b31m\\u202eb\\r\tc\nd"


@pytest.mark.parametrize(
    ("text", "cell"),
    [("=1+1", "'=1+1"), ("@x", "'@x"), ("+x", "'+x"), ("-3*strain", "'-3*strain"), ("", "")],
)
def test_no_cell_of_a_table_is_a_formula(text, cell):
    assert csv_cell(text) == cell


@pytest.mark.parametrize("reader", ["hdf5", "mat"])
def test_recordings_do_not_lead_into_other_files(reader, tmp_path):
    path = tmp_path / "log.h5"
    (tmp_path / "secret").write_bytes(b"a secret of the user" * 10)
    for file_name, name in (("other.h5", "x"), ("log.h5", "run/x")):
        with h5py.File(tmp_path / file_name, "w") as file:
            file[name] = [1.0, 2.0]
    request = TableRequest("log.h5", ("run/x",))
    assert len(READERS[reader].read(path, request)[0].rows) == 2
    for storage in ("external", "virtual"):
        with h5py.File(path, "r+") as file:
            del file["run/x"]
            if storage == "external":
                file["run"].create_dataset(
                    "x", (2,), "<f8", external=[(str(tmp_path / "secret"), 0, 16)]
                )
            else:
                layout = h5py.VirtualLayout((2,), "<f8")
                layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "x", (2,))
                file["run"].create_virtual_dataset("x", layout)
        with pytest.raises(DataError, match="takes its values from other files"):
            READERS[reader].read(path, request)
    with h5py.File(path, "r+") as file:
        del file["run/x"]
        file["run/x"] = h5py.ExternalLink(str(tmp_path / "other.h5"), "x")
    with pytest.raises(DataError, match="'run/x' is a link to another file"):
        READERS[reader].read(path, request)


@pytest.fixture
def limited(tmp_path, shell):
    """A command in the folder of the test that may take 1 GiB for what it computes with."""
    limit = partial(resource.setrlimit, resource.RLIMIT_DATA, (1 << 30, 1 << 30))
    return partial(
        shell,
        cwd=tmp_path,
        preexec_fn=limit,
        timeout=120,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )


def endless(folder):
    (folder / "a.csv").symlink_to("/proc/self/pagemap")


def unpacking(folder):
    with h5py.File(folder / "a.h5", "w") as file:
        for name in ("P", "eps", "F"):
            file.create_dataset(
                name, shape=(180_000_000,), dtype="f8", chunks=True, compression="gzip"
            )


def packed(folder):
    scipy.io.savemat(
        folder / "a.mat",
        {name: np.zeros(20_000_000) for name in ("P", "eps", "F")},
        do_compression=True,
    )


SPEC = """\
name: a
data: {files: ["a*"], reader: READER, columns: {pressure: {column: P, unit: kPa},
    strain: {column: eps}, force: {column: F, unit: N}}}
target: static
dictionary: [{terms: [strain]}]
"""


@pytest.mark.parametrize(
    ("make", "reader", "words"),
    [
        (endless, "csv", "a.csv: is empty"),
        (unpacking, "hdf5", "MB to 1440 MB"),
        pytest.param(packed, "mat", "unpacks from 0.", marks=pytest.mark.long),
    ],
)
def test_a_small_file_takes_little_memory(make, reader, words, tmp_path, limited):
    make(tmp_path)
    (tmp_path / "spec.yaml").write_text(SPEC.replace("READER", reader))
    found = limited("check", "spec.yaml")
    assert (found.returncode, words in found.stderr) == (4, True), found.stderr


def test_a_table_of_thousands_of_columns_is_refused_by_init(tmp_path, limited):
    (tmp_path / "a.csv").write_text(
        "\n".join([",".join(f"c{i}" for i in range(100_000)), ",".join(["1"] * 100_000)])
    )
    found = limited("init", "a.csv")
    assert (found.returncode, "has 100000 columns, more than 2000" in found.stderr) == (4, True), (
        found.stderr
    )


@pytest.mark.timeout(60)  # to open a pipe waits for its other end
@pytest.mark.parametrize("command", ["check", "run", "batch", "plan", "fit", "clean"])
def test_a_pipe_is_no_spec(tmp_path, mapmore, command):
    os.mkfifo(tmp_path / "spec.yaml")
    mapmore(
        command, tmp_path / "spec.yaml", "--runs", tmp_path, code=3, says="is a pipe or a device"
    )
