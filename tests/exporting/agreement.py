"""Exported C beside `predict`: compiles a model, runs it, and says by how much they differ.

python tests/exporting/agreement.py RUNS [POINTS]     every model of a folder of runs, as the table
of docs/export.md
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from mapmore_cli.annexes.exporting.c_source import STATUS, c_source
from mapmore_cli.annexes.exporting.python_module import python_module
from mapmore_cli.annexes.motion.body import StateSpace
from mapmore_cli.annexes.sums import Sum
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import Formula, Memory, Model, Pieces
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.modelling.inverse import NEAREST
from mapmore_cli.modelling.kinds import fed_back, outside_range, runs_over_time, simulate
from mapmore_cli.modelling.pieces.definition import zones_of
from mapmore_cli.modelling.programs import program_of

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
POINTS = 100_000

SLOPES = """
void differentiate(const double *rows, int n, double *out, int *bits)
{{
    for (int i = 0; i < n; i++) {{
        {real} in[{inputs} + 1], y, slopes[{inputs} + 1];
        for (int j = 0; j < {inputs}; j++) in[j] = ({real})rows[i * {inputs} + j];
        bits[i] = {name}_derivatives(in, &y, slopes);
        for (int j = 0; j < {inputs}; j++) out[i * {inputs} + j] = slopes[j];
    }}
}}
"""
INVERSE = """
void invert_{input}(const double *rows, int n, const double *wanted, int follow, double *found,
    int *status)
{{
    {real} last = NAN;
    for (int i = 0; i < n; i++) {{
        {real} in[{inputs}], x;
        for (int j = 0; j < {inputs}; j++) in[j] = ({real})rows[i * {inputs} + j];
        if (follow) in[{place}] = last;
        status[i] = {name}_invert_{input}(in, ({real})wanted[i], &x);
        found[i] = x;
        if (status[i]) last = x;
    }}
}}
"""
MAIN = """
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv)
{{
    const int n = atoi(argv[argc - 1]);
    double *rows = malloc(sizeof *rows * {columns} * n), *out = malloc(sizeof *out * {columns} * n);
    int *bits = malloc(sizeof *bits * n);
    if (fread(rows, sizeof *rows * {columns}, n, stdin) != (size_t)n) return 1;
    {differentiate}
    verify(rows, n, out, bits);
    fwrite(out, sizeof *out, n, stdout);
    free(rows); free(out); free(bits);
    return 0;
}}
"""


@dataclass
class Compiled:
    """A model in C, ready to be called."""

    model: Model
    library: ctypes.CDLL

    def run(self, columns):
        """Outputs and bits of every row."""
        rows = table(self.model, columns)
        out, bits = np.empty(len(rows)), np.empty(len(rows), dtype=np.int32)
        self.library.verify(rows.ctypes, len(rows), out.ctypes, bits.ctypes)
        return out, bits

    def slopes(self, columns):
        """Derivatives of every row by each input."""
        rows = table(self.model, columns)
        out, bits = np.empty(rows.shape), np.empty(len(rows), dtype=np.int32)
        self.library.differentiate(rows.ctypes, len(rows), out.ctypes, bits.ctypes)
        assert np.array_equal(bits, self.run(columns)[1]), "derivatives have the bits of values"
        return {quantity.name: out[:, place] for place, quantity in enumerate(self.model.inputs)}

    def invert(self, wanted, given, name, rule):
        """What is picked, and the status of every row; `given` may say what to look near."""
        rows, wanted = (
            table(self.model, {name: np.full(len(wanted), np.nan), **given}),
            np.ascontiguousarray(wanted),
        )
        found, status = np.empty(len(rows)), np.empty(len(rows), dtype=np.int32)
        getattr(self.library, f"invert_{name}")(
            rows.ctypes, len(rows), wanted.ctypes, int(rule == NEAREST), found.ctypes, status.ctypes
        )
        return found, tuple(STATUS[number] for number in status)


def table(model, columns):
    """Inputs, and the measured output where the model goes on from it, row by row."""
    return np.column_stack(
        [
            columns[name]
            for name in (*(quantity.name for quantity in model.inputs), *fed_back(model))
        ]
    )


def compiled(
    model,
    folder,
    *,
    single=False,
    more=("-O0",),
    inverse=None,
):
    """Write, compile and load a model, with its derivatives and the `inverse` for some inputs if so
    wished; any warning is an error.
    """
    built(model, folder, [*more, "-fPIC"], ["-shared", "-fPIC", "-O1"], "library", inverse, single)
    return Compiled(model, ctypes.CDLL(str(folder / "library")))


def built(
    model,
    folder,
    strict,
    lenient,
    to,
    inverse,
    single=False,
    main="",
):
    """Compile a model by `strict` flags, and by `lenient` ones what runs along the rows of a table
    with it.
    """
    source = c_source(model, single)
    for file, text in source.files.items():
        (folder / file).write_text(text)
    names = {quantity.name: place for place, quantity in enumerate(model.inputs)}
    words = {"name": source.name, "real": "float" if single else "double", "inputs": len(names)}
    driver, sources = rows_driver(model, **words), [f"{source.name}.c"]
    if inverse is not None:
        sources.append(f"{source.name}_inverse.c")
        driver += f'#include "{source.name}_inverse.h"\n#include <math.h>\n' + SLOPES.format(
            **words
        )
        driver += "".join(INVERSE.format(**words, input=one, place=names[one]) for one in inverse)
    (folder / "batch.c").write_text(driver + main)
    subprocess.run(["gcc", *FLAGS, *strict, "-c", *sources], cwd=folder, check=True)
    objects = [one.replace(".c", ".o") for one in sources]
    subprocess.run(
        ["gcc", "-std=c99", *lenient, *objects, "batch.c", "-o", to, "-lm"], cwd=folder, check=True
    )


def rows_driver(model, name, real, inputs):
    """C that runs a model along the rows of a table: its inputs, and the measured output where it
    takes that.
    """
    memory, measured = runs_over_time(model), bool(fed_back(model))
    columns, call = inputs + measured, f"{name}_{'step(&s, in' if memory else 'eval(in'}, &found)"
    reset = f"{name}_state s;\n{name}_reset(&s);" if memory else ""
    told = (
        f"if (bits[i] & {name.upper()}_NO_VALUE) {name}_measured(&s, in[{inputs}]);"
        if measured
        else ""
    )
    return f"""#include "{name}.h"
void verify(const double *rows, int n, double *out, int *bits)
{{
    {reset}
    for (int i = 0; i < n; i++) {{
        {real} in[{columns} + 1], found;
        for (int j = 0; j < {columns}; j++) in[j] = ({real})rows[i * {columns} + j];
        bits[i] = {call};
        out[i] = found;
        {told}
    }}
}}
"""


def sanitized(model, folder, columns):
    """Outputs of every row by a program under the address and undefined-behaviour sanitizers, which
    takes the derivatives too.

    Raises `CalledProcessError` where they find something.
    """
    rows, memory = table(model, columns), runs_over_time(model)
    main = MAIN.format(
        columns=rows.shape[1], differentiate="" if memory else "differentiate(rows, n, out, bits);"
    )
    sanitize = ["-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    built(model, folder, sanitize, sanitize, "clean", None if memory else (), main=main)
    done = subprocess.run(
        ["./clean", str(len(rows))],
        input=rows.tobytes(),
        cwd=folder,
        check=True,
        stdout=subprocess.PIPE,
    )
    return np.frombuffer(done.stdout)


def difference(found, expected):
    """The largest difference, relative to the value, or to a tenth of the median magnitude where
    the value is smaller.
    """
    assert np.array_equal(np.isnan(found), np.isnan(expected)), (
        "one has a value where the other has none"
    )
    known = np.isfinite(expected)
    size = np.abs(expected[known])
    assert size.any()
    return float(
        np.max(
            np.abs(found[known] - expected[known])
            / np.maximum(size, 0.1 * np.median(size[size > 0]))
        )
    )


def points(model, n, seed=1):
    """Points inside of the training range, up to half of it outside, and exactly at every boundary
    and beside it.
    """
    rng = np.random.default_rng(seed)
    columns = {}
    for quantity in model.inputs:
        edges = np.unique([edge for edge in edges_of(model, quantity.name) if np.isfinite(edge)])
        low, high = (edges[0], edges[-1]) if len(edges) else (-1.0, 1.0)
        width = (high - low) or 1.0
        x = rng.uniform(low - 0.5 * width, high + 0.5 * width, n)
        near = np.concatenate(
            [edges, np.nextafter(edges, -np.inf), np.nextafter(edges, np.inf), np.zeros(1)]
        )
        at = rng.random(n) < 0.4
        x[at] = rng.choice(near, at.sum())
        own = rng.permutation(n)[: len(near)]
        x[own] = near[: len(own)]
        columns[quantity.name] = x
    return columns


def imported(model, plain=False):
    """The Python module of a model, which needs NumPy alone, or nothing in plain Python."""
    _, text = python_module(model, plain)
    needed = "import math" if plain else "import numpy as np"
    assert [line for line in text.splitlines() if "import" in line] == [needed]
    module: dict[str, object] = {}
    exec(text, module)
    return SimpleNamespace(**module)


def edges_of(model, name):
    """Every number at which something changes along an input."""
    match model.body:
        case Pieces(level, _, curves):
            found = _range_edges(model.body.ranges, level, name)
            return found + [
                edge for curve in curves for edge in _zone_edges(curve, model.body, name)
            ]
        case Formula(_, level, ranges):
            return _range_edges(ranges, level, name)
        case Memory(_, ranges):
            return _range_edges(ranges, None, name)
        case StateSpace(motion, ranges):
            return _range_edges(ranges, None, name) + list(
                motion.boundaries if name == motion.input else ()
            )
        case Sum(parts):
            return [
                edge
                for part in parts
                for one in part.models
                for own in (q.name for q in one.inputs)
                if name in parse(part.inputs.get(own, own)).names
                for edge in edges_of(one, own)
            ]
    raise TypeError(model.body)


def _range_edges(ranges, level, name):
    limits = [end for one in ranges if name in one.limits for end in one.limits[name]]
    return limits + [one.level for one in ranges if name == level and one.level is not None]


def _zone_edges(curve, body, name):
    if name not in body.variables:
        return []
    boundaries = curve.boundaries[body.variables.index(name)]
    return np.concatenate([boundaries, *zones_of(curve, body)[name]]).tolist()


def recording(model, n, seed=1):
    """A recording for a model with memory: smooth, with stands, and a step beyond the training
    range; the output where it is fed back.
    """
    rng = np.random.default_rng(seed)
    step = program_of(model).step or 1.0
    t = np.arange(n) * step
    columns = {"time": t}
    for quantity in model.inputs:
        edges = edges_of(model, quantity.name) or [0.0, 1.0]
        low, high = min(edges), max(edges)
        waves = (
            sum(
                np.sin(2 * np.pi * rng.uniform(0.5, 30) * np.arange(n) / n + rng.uniform(0, 6))
                for _ in range(4)
            )
            / 4
        )
        x = (low + high) / 2 + 0.6 * (high - low) * waves
        x[n // 3 : n // 2] = x[n // 3]
        columns[quantity.name] = x
    for memory in model.memories:
        low, high = memory.limits
        columns.setdefault(memory.output, rng.uniform(low, high, n))
    return columns


def compare(model, folder, n=POINTS, **how):
    """The largest relative difference between C and `predict`, and the number of points."""
    columns = recording(model, n) if runs_over_time(model) else points(model, n)
    found, expected = outputs(model, folder, columns, **how)
    return difference(found, expected), n


def outputs(model, folder, columns, **how):
    """Outputs by C and by `predict`; the bits of inputs out of range have to be those that Python
    flags.
    """
    found, bits = compiled(model, folder, **how).run(columns)
    with np.errstate(all="ignore"):
        expected = simulate(model, columns).values
    inputs = (1 << len(model.inputs)) - 1
    assert np.array_equal((bits & inputs) != 0, outside_range(model, columns)), (
        "the bits of inputs out of range"
    )
    return found, expected


@dataclass(frozen=True)
class Agreement:
    """A row of the table."""

    study: str
    kind: str
    points: int
    worst: float
    kilobytes: float

    def __str__(self):
        return (
            f"| {self.study} | {self.kind} | {self.points} | {self.worst:.1e} | "
            f"{self.kilobytes:.0f} |"
        )


def agreement(study, model, n=POINTS):
    """Compile a model without a warning, compare it, and run it at the same points under the
    sanitizers.

    Raises `AssertionError` or `CalledProcessError` where any of that fails.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        columns = recording(model, n) if runs_over_time(model) else points(model, n)
        found, expected = outputs(model, folder, columns, more=("-O2",))
        assert difference(sanitized(model, folder, columns), found) < 1e-12, (
            "the sanitizers' program has other numbers"
        )
        kilobytes = len((folder / f"{c_source(model).name}.c").read_text()) / 1000
        return Agreement(
            study, type(model.body).__name__.lower(), n, difference(found, expected), kilobytes
        )


def main(runs, n):
    """Print a row for every study, then the table of docs/export.md: the studies by kind."""
    from mapmore_cli.storage.artefacts import read_model

    found = []
    for file in sorted(runs.glob("*/model.h5")):
        study = file.parent.name
        if (runs / study.rpartition(".")[0] / "model.h5").is_file():
            continue  # a variation of another study
        model = read_model(file)
        try:
            found.append(agreement(study, model, n))
            print(found[-1], flush=True)
        except MapmoreError as error:
            print(
                f"| {study} | {type(model.body).__name__.lower()} | | refused: {error.message} | |"
            )
        except (AssertionError, subprocess.CalledProcessError) as error:
            print(f"| {study} | {type(model.body).__name__.lower()} | | FAILED: {error} | |")
    print("\n| kind | studies | points each | largest relative difference |\n|---|---:|---:|---:|")
    for kind in sorted({one.kind for one in found}):
        rows = [one for one in found if one.kind == kind]
        print(f"| {kind} | {len(rows)} | {n} | {max(one.worst for one in rows):.1e} |")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else POINTS)
