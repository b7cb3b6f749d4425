"""What tests of several packages build and measure."""

import os
import re
import shutil
import subprocess
import sys
import tracemalloc
from dataclasses import replace
from pkgutil import iter_modules

import numpy as np
import pytest

from mapmore_cli.domain import plugins
from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.pieces.definition import pieces_program
from mapmore_cli.modelling.program.values import evaluator

OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="there is no Node here")
NO_OCTAVE = "there is no Octave here (Debian's package octave), so MATLAB code is not run"


def curve_of(columns, held_out=None, name="a"):
    """One recording, all of which trains if nothing is said."""
    n = len(next(iter(columns.values())))
    return Curve(
        name,
        None,
        dict(columns),
        np.zeros(n, dtype=bool) if held_out is None else held_out,
        (name,),
    )


def dataset_of(*recordings, held_out=None, output="y"):
    """Recordings without levels, in quantities without units."""
    curves = [
        curve_of(columns, held_out, chr(ord("a") + number))
        for number, columns in enumerate(recordings)
    ]
    return Dataset(
        output, None, {name: Quantity(name, "1") for name in recordings[0]}, (), tuple(curves)
    )


def score_of(target="y", split="validate", curve="all", *, model="mapmore", rmse=1.0):
    """A row of a score table."""
    return Score(model, target, split, curve, 9, rmse, 1.0, 2.0, "range", 3.0, 4.0, 0.5)


def files_without_parts(group, form, package):
    """The files of a folder of the package that add nothing, because they declare no part."""
    declared = {part.source.__name__ for part in plugins.parts(group, form, package.__name__)}
    files = {f"{package.__name__}.{file.name}" for file in iter_modules(package.__path__)}
    return files - declared


def peak_memory(work):
    """The most bytes that Python has asked for at once while it works."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def parts(cell):
    """The words that a message has to have, with bars between."""
    return cell.split(" | ")


def rows_of(text, last=str):
    """The rows of a table in a text, whose cells stand two blanks or more apart; `last` reads the
    last cell of a row.
    """
    rows = [re.split(r"\s{2,}", line.strip()) for line in text.strip().splitlines()]
    return [(*cells, last(cell)) for *cells, cell in rows]


NO_NETWORK = """
import sys

def refuse(event, arguments):
    if event in ("socket.connect", "socket.bind", "socket.getaddrinfo", "socket.gethostbyname",
        "socket.sendto"):
        raise RuntimeError(f"{event} {arguments}")

sys.addaudithook(refuse)
"""
"""What a process runs first that may open no connection (`sitecustomize.py`)."""


def process(*command, env=None, **options):
    """What a process of its own did and told; `env` is added to the variables."""
    return subprocess.run(
        [*map(str, command)],
        capture_output=True,
        text=True,
        env={**os.environ, **(env or {})},
        **options,
    )


def mapmore(*arguments, **options):
    """The same of the command."""
    return process(sys.executable, "-m", "mapmore_cli", *arguments, **options)


def python(code, *arguments, **options):
    """The same of Python code."""
    return process(sys.executable, "-c", code, *arguments, **options)


def weight_of(body, segments, columns):
    """Weight of some segment functions together, (n,): what the model is with the functions of
    these ids one and all others zero. With `levels: pchip` it depends on the values of the curves.
    """

    def constant(segment):
        scaling = replace(segment.scaling, y_slope=1.0, y_intercept=float(segment.id in segments))
        return replace(segment, terms=(), theta=np.empty(0), scaling=scaling)

    curves = tuple(
        replace(curve, segments=tuple(map(constant, curve.segments))) for curve in body.curves
    )
    return evaluator(pieces_program(replace(body, curves=curves), list(columns)))(columns)[0]
