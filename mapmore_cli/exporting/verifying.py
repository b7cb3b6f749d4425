"""Exported code is compiled and run beside `predict` before it is written: on random points within and beyond the training range."""

from __future__ import annotations

import _ctypes
import ast
import ctypes
import os
import platform
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import Model
from mapmore_cli.exporting.dialect import rendered, source
from mapmore_cli.modelling.expressions import Name
from mapmore_cli.modelling.kinds import fed_back, outside_range, simulate
from mapmore_cli.modelling.program.model import program_of
from mapmore_cli.modelling.program.values import INPUT

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
    """Return where the shared library of this machine lies in a unit of FMI 2.0; raises CompilerMissing where it has no name for it."""
    if sys.platform not in SYSTEMS or platform.machine().lower() not in ("x86_64", "amd64", "i386", "i686", "arm64"):
        raise CompilerMissing(f"FMI 2.0 has no name for this machine ({sys.platform}, {platform.machine()})")
    system, ending = SYSTEMS[sys.platform]
    return f"binaries/{system}{8 * struct.calcsize('P')}/{name}.{ending}"


def shared_library(files: Mapping[str, str], compiled: Sequence[str]) -> bytes:
    """Return the library that those of the files are compiled to.

    Raises CompilerMissing where there is no compiler, CompilerFailed where it refuses the files.
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


POINTS = 100
CLOSE, CLOSE_SINGLE = 1e-6, 1e-2
"""How far code may lie from `predict`, relative to the value or to a tenth of the median; a wrong input or term is farther by far."""


def verify_c(model: Model, name: str, texts: Mapping[str, str], single: bool) -> None:
    """Compile the C of a model and compare it.

    Raises CompilerMissing where there is no compiler; MapmoreError where it refuses the code, or its numbers are others.
    """
    measured, real = bool(fed_back(model)), "float" if single else "double"
    words = {"name": name, "prefix": name.upper(), "real": real, "columns": len(model.inputs) + measured, "measured": measured}
    driver = rendered("verify.c", **words, memory=program_of(model).step is not None)
    _verify_library(model, {**texts, "verify.c": driver}, [f"{name}.c", "verify.c"], CLOSE_SINGLE if single else CLOSE)


def verify_unit(model: Model, texts: Mapping[str, str], compiled: Sequence[str]) -> None:
    """Compile the sources of a functional mock-up unit and compare what it answers to a tool; raises as `verify_c`."""
    _verify_library(model, {**texts, "verify-unit.c": source("verify-unit.c")}, [*compiled, "verify-unit.c"], CLOSE)


def verify_module(model: Model, text: str, each: bool = False) -> None:
    """Import a module and compare it, sample by sample where it takes `each` alone.

    MapmoreError where it holds what no module of ours does, or its numbers are others.
    """
    columns = points(model)
    if not _is_ours(ast.parse(text)):
        raise _unequal(model, "the module holds statements that are not its own")
    module: dict[str, Any] = {"__name__": "model"}
    exec(compile(text, "model", "exec"), module)
    given = [columns[quantity.name] for quantity in model.inputs]
    with np.errstate(all="ignore"):
        if program_of(model).step is None:
            found = np.broadcast_to(_called(module["evaluate"], given, each), POINTS)
        else:
            found, state = np.empty(POINTS), module["State"]()
            for row in range(POINTS):
                found[row] = module["step"](state, *(x[row] for x in given))
                if np.isnan(found[row]):
                    for output in fed_back(model):
                        state.measured(columns[output][row])
        outside = np.broadcast_to(_called(module["outside_range"], given, each), POINTS)
    _compare(model, columns, found, outside, CLOSE)


def _called(function: Any, given: Sequence[Array], each: bool) -> Any:
    """Return a function of whole arrays, or of one sample after the other."""
    return np.array([function(*row) for row in zip(*given, strict=True)]) if each and given else function(*given)


def points(model: Model) -> Columns:
    """Return random points around the training range, a fifth of it beyond; for a model with memory a recording, with its output."""
    rng, code = np.random.default_rng(1), program_of(model)
    columns = {"time": (code.step or 1.0) * np.arange(float(POINTS))}
    for quantity in model.inputs:
        known = [limit for limit in code.limits if limit.inputs == {quantity.name}]
        known = [limit for limit in known if limit.value == Name(f"{INPUT}{quantity.name}")] or known  # and not of what follows from it
        low = min((float(limit.low.min()) for limit in known), default=-1.0)
        high = max((float(limit.high.max()) for limit in known), default=1.0)
        if quantity.name != "time" or code.step is None:  # the clock of a recording is even
            columns[quantity.name] = low + (high - low) * rng.uniform(-0.2, 1.2, POINTS)
    for memory in model.memories:
        columns.setdefault(memory.output, rng.uniform(*memory.limits, POINTS))
    return columns


def _verify_library(model: Model, texts: Mapping[str, str], compiled: Sequence[str], close: float) -> None:
    columns = points(model)
    names = [*(quantity.name for quantity in model.inputs), *fed_back(model)]
    rows = np.column_stack([columns[name] for name in names]) if names else np.empty((POINTS, 0))
    out, bits = np.empty(POINTS), np.empty(POINTS, dtype=np.intc)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        place = Path(folder) / "verify"
        try:
            place.write_bytes(shared_library(texts, compiled))
        except CompilerFailed as fault:
            raise _unequal(model, str(fault)) from fault
        library = ctypes.CDLL(str(place))
        library.verify(np.ascontiguousarray(rows).ctypes, POINTS, out.ctypes, bits.ctypes)
        if os.name == "posix":  # or every export of a process would keep its library in memory
            _ctypes.dlclose(library._handle)
    _compare(model, columns, out, (bits & ((1 << len(model.inputs)) - 1)) != 0, close)


def _compare(model: Model, columns: Columns, found: Array, outside: Array, close: float) -> None:
    with np.errstate(all="ignore"):
        expected = simulate(model, columns).values
        size = np.abs(expected[np.isfinite(expected)])
        room = close * np.maximum(np.abs(expected), 0.1 * (np.median(size) if size.size else 0.0))
        equal = (np.abs(found - expected) <= room) | (found == expected) | (np.isnan(found) & np.isnan(expected))
    for row in np.flatnonzero(~equal | (outside != outside_range(model, columns)))[:1]:
        where = ", ".join(f"{quantity.name} = {columns[quantity.name][row]:.6g}" for quantity in model.inputs)
        raise _unequal(model, f"it is {found[row]:.9g} where `predict` has {expected[row]:.9g}, at {where}")


def _unequal(model: Model, what: str) -> MapmoreError:
    return MapmoreError(
        f"the exported code of {model.name} is not the model, and is not written: {what}",
        "please report it; --no-verify writes it all the same",
    )


def _is_ours(tree: ast.Module) -> bool:
    """Return whether a module imports NumPy or `math` alone, and calls nothing but that and its own functions."""
    known = {"float", "function", "range", "len", "max", "abs"}
    known |= {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    for node in ast.walk(tree):
        match node:
            case ast.Import([ast.alias("numpy", "np")]) | ast.Import([ast.alias("math", None)]):
                continue
            case ast.Import() | ast.ImportFrom():
                return False
            case ast.Call(ast.Name(name)) if name not in known:
                return False
            case ast.Call(ast.Attribute(ast.Name(name))) if name not in ("np", "s", "self", "math"):
                return False
    return True
