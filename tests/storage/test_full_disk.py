"""A disk that fills up, or Ctrl-C, while HDF5 writes, which would crash at the exit of the program;
and while a long column is made.
"""

import os
import signal

import pytest
from common import python

from mapmore_cli.storage.artefacts import hdf5

pytest.importorskip("resource", reason="the size of files can be limited on POSIX alone")


def told_by(script, *arguments):
    """What a program of its own says."""
    done = python(script, *arguments)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_after_a_fault_everything_seems_to_succeed(tmp_path):
    with hdf5.SteadyFile(tmp_path / "a", "w") as file:
        file.fault = OSError()
        assert (file.write(b"abc"), file.truncate(7), file.truncate()) == (3, 7, 0)
    assert (tmp_path / "a").read_bytes() == b""


SCRIPT = """
import resource, sys
from pathlib import Path
import numpy as np
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.storage.artefacts import read_dataset, write_dataset

def dataset(n):
    columns = {"force": np.random.default_rng(0).normal(size=n), "strain": np.arange(n) * 1.0}
    curve = Curve("all", None, columns, np.zeros(n, bool), ())
    return Dataset("force", None, {"force": Quantity("force", "N"), "strain": Quantity("strain",
        "1")}, (), (curve,))

path = Path(sys.argv[1])
write_dataset(path, dataset(10))
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[2]), resource.RLIM_INFINITY))
try:
    write_dataset(path, dataset(int(sys.argv[3])))
except WriteError as error:
    print(error)
print(read_dataset(path).curves[0].size)
"""


@pytest.mark.parametrize(
    ("limit", "n", "kept"),
    [
        pytest.param(50_000, 200_000, 10, id="compressed samples"),
        pytest.param(20_000, 4_000, 10, id="contiguous samples"),
        pytest.param(700, 10, 10, id="names and units"),
        pytest.param(10_000_000, 200_000, 200_000, id="room enough"),
    ],
)
def test_the_old_file_stays_and_the_program_goes_on(tmp_path, limit, n, kept):
    *told, found = told_by(SCRIPT, tmp_path / "ingest.h5", limit, n).splitlines()
    assert [file.name for file in tmp_path.iterdir()] == ["ingest.h5"]
    assert ("cannot be written" in "".join(told)) == bool(told) == (kept == 10)
    assert int(found) == kept


INTERRUPTED = """
import signal
from mapmore_cli.storage.artefacts.hdf5 import SteadyFile
written, calls = SteadyFile.write, []

def write(self, data):
    calls.append(len(data))
    if len(calls) == int(sys.argv[2]):
        signal.raise_signal(signal.SIGINT)
    return written(self, data)

SteadyFile.write = write
try:
    write_dataset(path, dataset(100_000))
except KeyboardInterrupt:
    print("interrupted")
print(read_dataset(path).curves[0].size)
"""


@pytest.mark.parametrize("call", [1, 2, 5])
def test_an_interruption_is_not_lost_within_hdf5(tmp_path, call):
    """Found by torture: raised while HDF5 called back, it was swallowed, or came out as another
    error.
    """
    start = SCRIPT[: SCRIPT.index("resource.setrlimit")]
    assert told_by(start + INTERRUPTED, tmp_path / "ingest.h5", call).splitlines() == [
        "interrupted",
        "10",
    ]
    assert [file.name for file in tmp_path.iterdir()] == ["ingest.h5"]


LONG_COLUMN = """
import resource, sys
from pathlib import Path
import numpy as np
from mapmore_cli.domain.errors import WriteError
from mapmore_cli.domain.arrays import SCRATCH, by_blocks
from mapmore_cli.storage.atomic import refusals_told

resource.setrlimit(resource.RLIMIT_FSIZE, (5_000_000, resource.RLIM_INFINITY))
try:
    SCRATCH.set(sys.argv[1])
    with refusals_told(Path(sys.argv[1])):
        by_blocks(np.negative, np.zeros(2_000_000))
except WriteError as error:
    print(error)
"""


KILLED = """
import os, signal, stat, sys, tempfile
import numpy as np
from mapmore_cli.domain.arrays import by_blocks
from mapmore_cli.storage.atomic import scratch_folder

made = []

def remembered(make):
    def opened(*arguments, **options):
        made.append(make(*arguments, **options))
        return made[-1]
    return opened

tempfile.TemporaryFile = remembered(tempfile.TemporaryFile)
step = sys.argv[1]

def die(event, _):
    if event == step:
        os.kill(os.getpid(), signal.SIGKILL)

with scratch_folder() as folder:
    states = [folder.stat()]
    (folder / "study").write_text("x")
    if step == "folder":
        os.kill(os.getpid(), signal.SIGKILL)
column = by_blocks(lambda part: (states.append(os.fstat(made[0].fileno())) if made else None,
    np.negative(part))[1], np.zeros(2_000_000))
assert [stat.S_IMODE(one.st_mode) for one in states[:2]] == [0o700, 0o600], states
assert states[1].st_nlink == 0
sys.addaudithook(die)
sys.audit("end")
"""


@pytest.mark.skipif(not hasattr(os, "O_TMPFILE"), reason="files without a name are of Linux")
def test_nothing_stays_in_the_temporary_folder_of_a_program_that_is_killed(tmp_path):
    """Long columns are in files without a name, which others cannot read; a folder of a study in
    memory goes with the next one.
    """
    there = {"TMPDIR": str(tmp_path)}
    for step, left in (("end", 0), ("folder", 1), ("end", 0)):
        done = python(KILLED, step, env=there)
        assert (done.returncode, done.stderr) == (-signal.SIGKILL, "")
        assert len(list(tmp_path.iterdir())) == left


def test_a_disk_without_room_for_a_column_is_told(tmp_path):
    assert "cannot be written" in told_by(LONG_COLUMN, tmp_path)
    assert not list(tmp_path.iterdir())
