"""Compile exported code and compare it with `predict` before it is written, on random points inside
and outside the training range.

The code runs in a separate process with a time limit, because it is made from a model file that may
be hostile.
"""

from __future__ import annotations

import os
import platform
import shutil
import struct
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from mapmore_cli.annexes.exporting.templates import rendered_template
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.expressions import Name
from mapmore_cli.modelling.kinds import fed_back, outside_range, simulate
from mapmore_cli.modelling.program.values import INPUT
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.storage.atomic import scratch_folder, write_own

COMPILERS = ("cc", "gcc", "clang")
"""Compilers that are tried in this order, after the one in the environment variable CC."""

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off")
LIBRARY = ("-shared", "-fPIC", "-fvisibility=hidden")

SECONDS = 300
"""Time in seconds after which a compiler is stopped. Exported code that runs longer is stopped,
too.
"""

SYSTEMS = {
    "linux": ("linux", "linux", "so"),
    "darwin": ("darwin", "darwin", "dylib"),
    "win32": ("win", "windows", "dll"),
}
"""Names of systems in FMI 2.0 and 3.0, and suffixes of their shared libraries, by
`sys.platform`.
"""

MACHINES = {
    **dict.fromkeys(("x86_64", "amd64"), "x86_64"),
    **dict.fromkeys(("i386", "i686"), "x86"),
    **dict.fromkeys(("arm64", "aarch64"), "aarch64"),
}
"""Names of processors in FMI 3.0."""


class CompilerMissing(Exception):
    """No compiler was found, or the compiler cannot compile even an empty program. The message
    gives the reason.
    """


class CompilerFailed(CompilerMissing):
    """The compiler works, but it refused the files of a model."""


def library_place(name: str, standard: int) -> str:
    """Return the path of this machine's shared library in an FMU for FMI 2 or 3. Raises
    CompilerMissing for an unknown machine.
    """
    machine = platform.machine().lower()
    known = sys.platform in SYSTEMS and machine in MACHINES
    if not known or (standard == 2 and machine == "aarch64"):
        raise CompilerMissing(
            f"FMI {standard}.0 has no name for this machine ({sys.platform}, {platform.machine()})"
        )
    old, system, ending = SYSTEMS[sys.platform]
    place = f"{old}{8 * struct.calcsize('P')}" if standard == 2 else f"{MACHINES[machine]}-{system}"
    return f"binaries/{place}/{name}.{ending}"


def built(
    files: Mapping[str, str], compiled: Sequence[str], flags: Sequence[str] = LIBRARY
) -> bytes:
    """Compile the files named in `compiled`, and return the shared library, or the executable if no
    library flags are given.

    Raises CompilerMissing if there is no compiler, CompilerFailed if it refuses the files.
    """
    wanted = (os.environ["CC"],) if os.environ.get("CC") else COMPILERS
    compiler = next(filter(None, map(shutil.which, wanted)), None)
    if compiler is None:
        raise CompilerMissing(f"there is no C compiler here ({', '.join(wanted)})")
    try:
        return _compiled(compiler, files, compiled, flags)
    except (OSError, subprocess.SubprocessError) as fault:
        lines = (getattr(fault, "stderr", "") or str(fault)).strip().splitlines()
        why = f"the C compiler {compiler} failed: {lines[0] if lines else fault}"
    try:
        _compiled(compiler, {"empty.c": "int nothing;\n"}, ["empty.c"], LIBRARY)
    except (OSError, subprocess.SubprocessError) as fault:
        raise CompilerMissing(why) from fault  # this compiler cannot compile anything at all
    raise CompilerFailed(why)


def _compiled(
    compiler: str, files: Mapping[str, str], compiled: Sequence[str], flags: Sequence[str]
) -> bytes:
    with scratch_folder() as folder:
        for name, text in files.items():
            write_own(folder / name, text)
        line = [compiler, *FLAGS, *flags, *compiled, "-o", "built", "-lm"]
        subprocess.run(
            line, cwd=folder, check=True, capture_output=True, text=True, timeout=SECONDS
        )
        return (folder / "built").read_bytes()


POINTS = 100
CLOSE, CLOSE_SINGLE = 1e-6, 1e-2
"""Largest difference between the numbers of exported code and of `predict`, in double and in single
precision. It is relative to the value, or to a tenth of the median if this is larger. A wrong input
or a wrong term makes a far larger difference.
"""


def verify_program(
    model: Model, texts: Mapping[str, str], compiled: Sequence[str], close: float = CLOSE
) -> None:
    """Compile a program that evaluates a model, and compare it with `predict`.

    Raises CompilerMissing if there is no compiler; MapmoreError if it refuses the code, or if the
    numbers differ.
    """
    try:
        program = built(texts, compiled, ())
    except CompilerFailed as fault:
        raise _unequal(model, str(fault)) from fault
    with scratch_folder() as folder:
        place = folder / "verify.exe"
        write_own(place, program)
        place.chmod(0o700)
        _verify(model, [str(place)], folder, close)


def verify_module(model: Model, text: str, each: bool) -> None:
    """Import a module and compare it with `predict`. If `each` is True, the module is called
    for one sample at a time. Raises MapmoreError like `verify_program`.
    """
    memory, count = program_of(model).step is not None, len(model.inputs)
    driver = rendered_template("verify.py", memory=memory, each=each, count=count)
    libraries = str(Path(np.__file__).parents[1])
    command = [sys.executable, "-I", "-S", "-B", "verify.py", ".", libraries]
    verify_files(model, {"exported.py": text, "verify.py": driver}, command)


def verify_files(model: Model, files: Mapping[str, str], command: Sequence[str]) -> None:
    """Write files into a folder and compare the output of a command there. Raises the same errors
    as `verify_program`.
    """
    with scratch_folder() as folder:
        for name, code in files.items():
            write_own(folder / name, code)
        _verify(model, command, folder)


def _verify(model: Model, command: Sequence[str], folder: Path, close: float = CLOSE) -> None:
    """Run a program in a folder and compare its numbers with `predict`. The program reads inputs
    and measured outputs line by line. It prints the outputs, and bits that mark the inputs outside
    their range.
    """
    columns, count = points(model), len(model.inputs)
    names = [*model.input_names, *fed_back(model)]
    rows = np.column_stack([np.empty((POINTS, 0)), *(columns[name] for name in names)]).tolist()
    rows_as_text = "".join(" ".join(map(repr, row)) + "\n" for row in rows)
    answers = _answers(model, command, rows_as_text, folder).reshape(-1, len(model.each) + 1)
    # the answer has one line if the model has no input
    *values, bits = np.broadcast_to(answers, (POINTS, answers.shape[1])).T
    outside = bits.astype(int) & ((1 << count) - 1) != 0
    flags = outside != outside_range(model, columns)
    for output, answered in zip(model.each, values, strict=True):
        with np.errstate(all="ignore"):
            expected = simulate(output, columns).values
            size = np.abs(expected[np.isfinite(expected)])
            least = 0.1 * np.median(size) if size.size else 0.0
            equal = np.abs(answered - expected) <= close * np.maximum(np.abs(expected), least)
            equal |= (answered == expected) | (np.isnan(answered) & np.isnan(expected))
        for row in np.flatnonzero(~equal | flags)[:1]:
            where = ", ".join(f"{name} = {columns[name][row]:.6g}" for name in names[:count])
            difference = (
                f"the code gives {answered[row]:.9g} and `predict` gives {expected[row]:.9g} at "
                f"{where}"
            )
            raise _unequal(model, difference)


def _answers(model: Model, command: Sequence[str], text: str, folder: Path) -> Array:
    """Return the numbers that a program prints. The program runs in a separate process. Raises
    MapmoreError if it fails, and CompilerMissing if it cannot be started.
    """
    try:
        done = subprocess.run(
            command,
            input=text,
            capture_output=True,
            text=True,
            check=True,
            timeout=SECONDS,
            cwd=folder,
        )
        return np.array(done.stdout.split(), dtype=np.float64)
    except subprocess.CalledProcessError as fault:
        why = (fault.stderr.strip() or f"it ends with {fault.returncode}").splitlines()[-1]
        raise _unequal(model, why) from fault
    except subprocess.TimeoutExpired as fault:
        raise _unequal(model, f"it takes longer than {SECONDS} s for {POINTS} samples") from fault
    except OSError as fault:
        raise CompilerMissing(f"{command[0]} cannot be run ({fault.strerror})") from fault


def points(model: Model) -> Columns:
    """Return random points for a comparison, (n,) for each input: inside the training range and up
    to a fifth of its width outside. For a model with memory, the points are a recording with equal
    time steps, and contain random values of the measured output, too.
    """
    rng, code = np.random.default_rng(1), program_of(model)
    columns = {"time": (code.step or 1.0) * np.arange(float(POINTS))}
    for name, ends in training_ends(model).items():
        low, high = min(ends[0], default=-1.0), max(ends[1], default=1.0)
        # the time of a recording has equal steps instead of random values
        if name != "time" or code.step is None:
            columns[name] = low + (high - low) * rng.uniform(-0.2, 1.2, POINTS)
    for memory in model.memories:
        columns.setdefault(memory.output, rng.uniform(*memory.limits, POINTS))
    return columns


def middle(model: Model) -> dict[str, float]:
    """Return, for each input, the middle of the range that is common to all levels, rounded to four
    significant digits.
    """
    return {
        name: float(f"{np.mean([max(low, default=0.0), min(high, default=0.0)]):.4g}")
        for name, (low, high) in training_ends(model).items()
    }


def training_ends(model: Model) -> dict[str, tuple[list[float], list[float]]]:
    """Return the lower and the upper ends of the training range of each input, one of each for
    every level. The lists of an input are empty if its range is unknown.
    """
    limits, ends = program_of(model).limits, {}
    for name in model.input_names:
        known = [limit for limit in limits if limit.inputs == {name}]
        # limits of the input itself are used, not limits of quantities that are computed from it
        known = [limit for limit in known if limit.value == Name(f"{INPUT}{name}")] or known
        ends[name] = (
            [place for limit in known for place in limit.low.tolist()],
            [place for limit in known for place in limit.high.tolist()],
        )
    return ends


def _unequal(model: Model, why: str) -> MapmoreError:
    return MapmoreError(
        (
            f"the exported code of {model.name} gives other values than the model, so it is not "
            f"written: {why}"
        ),
        "please report this error; --no-verify writes the code without this check",
    )
