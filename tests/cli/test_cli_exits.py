"""Every way in which a command ends has its code and one message; no traceback reaches a user who
did not ask for it.
"""

import errno
import json
import os
import re
import signal
import subprocess
import sys
import warnings
from pathlib import Path
from subprocess import PIPE

import numpy as np
import pytest
from common import process
from numpy._core._exceptions import _ArrayMemoryError

from mapmore_cli.cli.app import _show_warning, main
from mapmore_cli.domain import errors
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.plugins import PluginLeftOut
from mapmore_cli.pipeline import runner

COMMAND = [sys.executable, "-m", "mapmore_cli"]
MENDABLE = [
    (errors.UsageError, 2),
    (errors.SpecError, 3),
    (errors.DataError, 4),
    (errors.FitError, 5),
    (errors.LimitMissed, 6),
    (errors.WriteError, 7),
]


def failing(monkeypatch, error):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(runner, "bring_up_to_date", fail)


def within_c():
    """What comes of Ctrl-C while a function in C calls one of Python, as libraries do."""
    error = SystemError("<class 'float'> returned a result with an exception set")
    error.__cause__ = KeyboardInterrupt()
    return error


def without_memory():
    """What comes of too little memory: in Python, in NumPy, from the system, from a library, and of
    a file that was to be read.
    """
    told = DataError("a.csv: cannot be read: Cannot allocate memory")
    told.__cause__ = OSError(errno.ENOMEM, os.strerror(errno.ENOMEM))
    library = ImportError("libm.so: failed to map segment from shared object")
    return [
        MemoryError(),
        _ArrayMemoryError((10**9,), np.dtype(float)),
        OSError(errno.ENOMEM, os.strerror(errno.ENOMEM)),
        library,
        told,
    ]


@pytest.mark.parametrize(
    ("error", "code", "told"),
    [
        *(
            (kind("trace.csv:7: it is broken", "mend it"), code, "error: trace.csv:7: it is broken")
            for kind, code in MENDABLE
        ),
        (
            ZeroDivisionError("division by zero\nand more"),
            1,
            "internal fault: ZeroDivisionError: division by zero; "
            "run again with --debug to see where",
        ),
        *((error, 1, "error: there is not enough memory for this") for error in without_memory()),
        (KeyboardInterrupt(), 130, "interrupted"),
        (within_c(), 130, "interrupted"),
        (errors.Stopped(15), 143, "ended by SIGTERM"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_whatever_ends_a_run_is_told_in_a_line_with_its_remedy(
    error, code, told, study, mapmore, monkeypatch
):
    failing(monkeypatch, error)
    result = mapmore("run", study, code=code)
    first, *remedy = result.stderr.splitlines()
    assert (first, result.stdout) == (told, "")
    assert len(remedy) == told.startswith("error: ")
    assert all(line.startswith("  ") for line in remedy)


def test_every_error_class_has_a_test_a_code_of_its_own_and_a_row_of_the_page():
    assert {kind for kind, _ in MENDABLE} == set(errors.MapmoreError.__subclasses__())
    page = (Path(__file__).parents[2] / "docs/messages.md").read_text(encoding="utf-8")
    codes = [code for _, code in MENDABLE]
    rows = map(int, re.findall(r"^\| (\d+) \|", page, re.MULTILINE))
    assert codes == [row for row in rows if 1 < row < 128]


@pytest.mark.parametrize("place", ["front", "end"])
def test_debug_shows_the_traceback(place, study, mapmore, monkeypatch):
    failing(monkeypatch, ZeroDivisionError("division by zero"))
    result = (
        mapmore("--debug", "run", study) if place == "front" else mapmore("run", study, "--debug")
    )
    assert result.exit_code == 1
    assert "Traceback (most recent call last)" in result.stderr
    assert "in fail" in result.stderr


def test_an_interrupted_run_prints_no_document(study, mapmore, monkeypatch):
    failing(monkeypatch, KeyboardInterrupt())
    result = mapmore("run", study, "--json", code=130)
    assert (result.stdout, result.stderr) == ("", "interrupted\n")


def test_a_fault_of_the_program_is_a_document_too(study, mapmore, monkeypatch):
    failing(monkeypatch, ZeroDivisionError("division by zero"))
    error = json.loads(mapmore("run", study, "--json", code=1).stdout)["error"]
    assert (error["exit_code"], error["remedy"]) == (1, None)


BEFORE = """
import mapmore_cli.cli.app as app
from mapmore_cli.__main__ import main
def interrupted():
    {error}
app.main = interrupted
main()
"""


@pytest.mark.parametrize(
    ("error", "code", "last"),
    [
        ("raise KeyboardInterrupt", 130, "interrupted"),
        (
            "exec('raise KeyboardInterrupt')",
            -signal.SIGINT,
            "interrupted",
        ),  # Python ends itself so: 130 to a shell
        (
            "raise SystemError('returned a result with an exception set') from KeyboardInterrupt()",
            130,
            "interrupted",
        ),
        ("raise SystemError('bad argument')", 1, "SystemError: bad argument"),
    ],
)
def test_interrupted_before_the_command(error, code, last, tmp_path):
    (tmp_path / "before.py").write_text(BEFORE.format(error=error))
    search = os.pathsep.join([str(tmp_path), *sys.path])
    # as `python -m mapmore_cli`, after which Python may kill itself
    command = [
        sys.executable,
        "-m",
        "before",
    ]
    done = process(*command, env={"PYTHONPATH": search})
    assert (done.returncode, done.stderr.splitlines()[-1]) == (code, last)


@pytest.mark.parametrize(("error", "code"), [(OSError(errno.ENOSPC, "x"), 7), (MemoryError(), 1)])
def test_an_error_outside_of_a_command_is_one_message_and_no_document(
    error, code, capsys, monkeypatch
):
    def fail(**_):
        raise error

    monkeypatch.setattr("mapmore_cli.cli.app.app", fail)
    monkeypatch.setattr("mapmore_cli.cli.console._silence_stdout", lambda: None)
    monkeypatch.setattr(os, "dup2", lambda *_: None)
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == code
    printed = capsys.readouterr()
    assert (printed.out, "Traceback" in printed.err) == ("", False)
    assert printed.err.startswith("error: ")


def test_only_warnings_about_plug_ins_have_the_form_of_the_program(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["mapmore", "run"])
    _show_warning(UserWarning("odd"), UserWarning, "lib.py", 3)
    assert capsys.readouterr().err.startswith("lib.py:3: UserWarning: odd")
    left_out = PluginLeftOut("a plug-in is left out")
    for option, printed in (("-v", f"warning: {left_out}\n"), ("-q", "")):
        monkeypatch.setattr(sys, "argv", ["mapmore", "run", option])
        _show_warning(left_out, PluginLeftOut, "plugins.py", 3)
        assert capsys.readouterr().err == printed


def test_broken_pipe(model_file):
    """`mapmore predict ... | head -1` ends without complaint, like any other filter."""
    grid = "pressure=100:200:0.01,strain=0:0.1:0.001"
    with subprocess.Popen(
        [*COMMAND, "predict", model_file, "--grid", grid], stdout=PIPE, stderr=PIPE
    ) as process:
        assert process.stdout.readline() == b"pressure,strain,force_predicted,outside_range\n"
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141


def test_broken_pipe_that_only_the_last_flush_notices(finished):
    spec, runs = finished
    line = (
        f'"{sys.executable}" -m mapmore_cli run "{spec}" --runs "{runs}" -q | true; echo '
        f'"${{PIPESTATUS[0]}}"'
    )
    done = process("bash", "-c", line, check=True)
    assert (done.stdout, done.stderr) == ("141\n", "")


def test_interrupted_by_the_keyboard(model_file):
    with subprocess.Popen(
        [*COMMAND, "predict", model_file, "-"], stdin=PIPE, stdout=PIPE, stderr=PIPE
    ) as process:
        process.stdin.write(b"pressure,strain\n" + b"150,0.05\n" * 25_000)
        process.stdin.flush()
        process.stdout.readline()  # it is at work now
        process.send_signal(signal.SIGINT)
        _, stderr = process.communicate(timeout=20)
    assert (process.returncode, stderr) == (130, b"interrupted\n")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_stdout_on_a_full_disk(finished):
    _, runs = finished
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*COMMAND, "show", runs / "bench"], stdout=full, stderr=PIPE, text=True, check=False
        )
    assert done.returncode == 7
    assert done.stderr.startswith("error: stdout: cannot be written")


def test_a_terminal_with_few_letters(finished, shell):
    """The tables have a few signs that some encodings lack."""
    _, runs = finished
    environment = {"PYTHONIOENCODING": "ascii"}
    for arguments in ([], ["--json"]):
        done = shell("show", runs / "bench", *arguments, env=environment)
        assert (done.returncode, done.stderr) == (0, "")


def test_a_run_path_that_is_a_file(study, tmp_path, mapmore):
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "bench").write_text("precious")
    for runs in ((), ("--runs", tmp_path / "runs" / "bench")):
        mapmore("run", study, *runs, code=7, says="bench")
    assert (tmp_path / "runs" / "bench").read_text() == "precious"
