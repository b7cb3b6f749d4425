"""Shared libraries for this machine, by the C compiler that is found here."""

from __future__ import annotations

import os
import platform
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

COMPILERS = ("cc", "gcc", "clang")
"""Looked for in this order, after what the environment variable CC says."""

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-fvisibility=hidden")

SYSTEMS = {"linux": ("linux", "so"), "darwin": ("darwin", "dylib"), "win32": ("win", "dll")}
"""What FMI 2.0 calls a system, and how the names of its shared libraries end, by `sys.platform`."""


class CompilerMissing(Exception):
    """There is no compiler, or it failed; the message says which."""


class CompilerFailed(CompilerMissing):
    """The compiler refuses the files."""


def library_place(name: str) -> str:
    """Where the shared library of this machine lies in a unit of FMI 2.0.

    Raises
    ------
    CompilerMissing
        Where the standard has no name for this machine.
    """
    if sys.platform not in SYSTEMS or platform.machine().lower() not in ("x86_64", "amd64", "i386", "i686", "arm64"):
        raise CompilerMissing(f"FMI 2.0 has no name for this machine ({sys.platform}, {platform.machine()})")
    system, ending = SYSTEMS[sys.platform]
    return f"binaries/{system}{8 * struct.calcsize('P')}/{name}.{ending}"


def shared_library(files: Mapping[str, str], compiled: Sequence[str]) -> bytes:
    """The library that those of the files are compiled to.

    Raises
    ------
    CompilerMissing
        Where there is no compiler.
    CompilerFailed
        Where it refuses the files.
    """
    wanted = (os.environ["CC"],) if os.environ.get("CC") else COMPILERS
    found = next((path for path in map(shutil.which, wanted) if path), None)
    if found is None:
        raise CompilerMissing(f"there is no C compiler here ({', '.join(wanted)})")
    try:
        return _compiled(found, files, compiled)
    except (OSError, subprocess.CalledProcessError) as fault:
        said = (getattr(fault, "stderr", "") or str(fault)).strip().splitlines()
        why = f"the C compiler {found} failed: {said[0] if said else fault}"
    try:
        _compiled(found, {"empty.c": "int nothing;\n"}, ["empty.c"])
    except (OSError, subprocess.CalledProcessError) as fault:
        raise CompilerMissing(why) from fault  # it compiles nothing at all
    raise CompilerFailed(why)


def _compiled(compiler: str, files: Mapping[str, str], compiled: Sequence[str]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        subprocess.run([compiler, *FLAGS, *compiled, "-o", "library", "-lm"], cwd=folder, check=True, capture_output=True, text=True)
        return (Path(folder) / "library").read_bytes()
