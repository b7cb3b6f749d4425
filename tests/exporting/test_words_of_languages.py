"""Models, inputs and outputs that are called by a word of a language: nothing that is exported has
that name, and compilers and interpreters take it.
"""

import builtins
import keyword
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from export_samples import formula
from test_foreign_text import needs_compiler

from mapmore_cli.annexes.exporting.exports import exported, snippet
from mapmore_cli.annexes.exporting.templates import OWN, identifier
from mapmore_cli.annexes.exporting.words import (
    FILES,
    KEYWORDS,
    LIBRARY,
    TAKEN,
    WORDS,
    identifiers,
)
from mapmore_cli.annexes.sums import Part, Sum
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Quantity
from mapmore_cli.modelling.expressions.functions import FUNCTIONS

ROWS = {**KEYWORDS, **LIBRARY, "templates": " ".join(OWN)}
EVERY = sorted(
    {word for row in ROWS.values() for word in row.split()} | {"curve_1", "segment_2"} | FILES
)
TO = ("c", "py", "numpy", "matlab", "js", "simulink", "table", "tex", "fmu", "fmu3")


def called(name, inputs, output):
    """Sarosi's formula with other names."""
    inner = formula("sarosi")
    places = dict(zip((one.name for one in inner.inputs), inputs, strict=True))
    quantities = [replace(one, name=places[one.name]) for one in inner.inputs]
    return Model(name, Quantity(output, "N"), tuple(quantities), Sum((Part(inner, 1.0, places),)))


def test_python_has_no_other_words():
    known = {*TAKEN}
    assert {word.lower() for word in dir(builtins) if not word.startswith("_")} <= known
    assert {word.lower() for word in keyword.kwlist} <= known
    assert {word.lower() for word in sys.stdlib_module_names if not word.startswith("_")} <= known


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="there is no Octave")
def test_octave_has_no_other_functions():
    """A file that is called as a function of Octave would stand before it."""
    ask = "x = [__builtins__(); __list_functions__()]; printf('%s ', x{:})"
    call = ["octave-cli", "--norc", "--quiet", "--eval", ask]
    names = subprocess.run(call, check=True, capture_output=True, text=True).stdout.split()
    words = [name for name in names if name.isidentifier() and name[0] != "_" and len(name) > 1]
    assert len(words) > 1000
    assert {word.lower() for word in words} <= FILES | {one.lower() for one in OWN}


def test_functions_of_the_library_are_words_in_both_precisions():
    names = {row.texts["c"] for row in FUNCTIONS.values() if row.is_in_library("c")}
    assert {*names, *(f"{name}f" for name in names)} <= WORDS


def test_no_function_and_no_file_is_called_by_a_word():
    words = {one.lower() for one in EVERY}
    assert all(identifier(name).lower() not in words for name in EVERY)


FAULTS = [
    ("math", ("isfinite", "NaN"), "eval"),
    ("beyond", ("curve_1", "len"), "derivatives"),
    ("m", ("m_eval", "out"), "invert_out"),
    ("x", ("reset", "state"), "step"),
    ("demo", ("step", "evaluate"), "force"),
    ("end", ("range", "input"), "range"),
    ("_Bool", ("_Bool", "__LINE__"), "__func__"),
]


@pytest.mark.parametrize("name", ["_Bool", "__LINE__", "_", "2bar", "x" * 80])
def test_a_name_begins_with_a_letter_and_is_short_enough_to_be_distinguished(name):
    """MATLAB and C distinguish 63 characters, prefixes included."""
    found = identifiers([name, f"{name}2"])
    assert len({*found}) == 2
    assert all(one[0].isalpha() and len(one) < 60 for one in found)


def check(name, inputs, output, to):
    """Compiled or run, and compared with `predict`, by the exporter itself."""
    model, told = called(name, inputs, output), []
    files = exported(model, to, warn=told.append)
    assert [text for text in told if "no C compiler" not in text and "Octave" not in text] == []
    if to in ("c", "simulink"):
        with TemporaryDirectory() as folder:
            for file, data in files.items():
                (Path(folder) / file).write_bytes(data)
            sources = [file for file in files if file.endswith(".c")]
            options = [
                "-std=c99",
                "-Wall",
                "-Wextra",
                "-Werror",
                "-pedantic",
                "-I.",
                "-fsyntax-only",
            ]
            subprocess.run(["gcc", *options, *sources], check=True, cwd=folder)
    for file in files:
        assert file.partition(".")[0].lower() not in FILES
    snippet(model, to, list(files))


@needs_compiler
@pytest.mark.parametrize(("name", "inputs", "output"), FAULTS)
def test_words_that_a_target_reserves(name, inputs, output):
    for to in ("c", "py", "js", "simulink", "table"):
        check(name, inputs, output, to)
