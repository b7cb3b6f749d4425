"""Exported C beside `predict`: compiles a model, runs it, and says by how much they differ.

python tests/exporting/agreement.py RUNS     every model of a folder of runs, as the table of docs/export.md
"""

from __future__ import annotations

import ctypes
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.domain.models import CurveFunction, CurveRange, Formula, Memory, Model, Pieces, StateSpace, Sum
from mapmore_cli.exporting.c import c_source
from mapmore_cli.modelling.kinds import assignments, fed_back, outside_range, runs_over_time, simulate
from mapmore_cli.modelling.pieces.weights import zones
from mapmore_cli.modelling.terms import parse

FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic"]
POINTS = 100_000

STATIC = """
void batch(const {real} *in, int n, double *out, int *bits)
{{
    for (int i = 0; i < n; i++) {{
        {real} y;
        bits[i] = {name}_eval(in + i * {inputs}, &y);
        out[i] = y;
    }}
}}
"""
STEPS = """
void batch(const {real} *in, int n, double *out, int *bits, const {real} *measured)
{{
    {name}_state s;
    {name}_reset(&s);
    (void)measured;
    for (int i = 0; i < n; i++) {{
        {real} y;
        bits[i] = {name}_step(&s, in + i * {inputs}, &y);
        out[i] = y;
        {tell}
    }}
}}
"""


@dataclass
class Compiled:
    """A model in C, ready to be called."""

    model: Model
    library: ctypes.CDLL
    single: bool

    def run(self, columns: Mapping[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Outputs and bits of every row."""
        kind = np.float32 if self.single else np.float64
        given = np.ascontiguousarray(np.stack([columns[q.name] for q in self.model.inputs], axis=1), dtype=kind)
        out, bits = np.empty(len(given)), np.empty(len(given), dtype=np.int32)
        arguments = [given.ctypes, len(given), out.ctypes, bits.ctypes]
        if runs_over_time(self.model):
            measured = np.ascontiguousarray(columns.get(next(iter(fed_back(self.model)), ""), np.zeros(len(given))), dtype=kind)
            arguments.append(measured.ctypes)
        self.library.batch(*arguments)
        return out, bits


def compiled(model: Model, folder: Path, *, single: bool = False, more: tuple[str, ...] = ("-O1",)) -> Compiled:
    """Write, compile and load a model; any warning is an error."""
    source = c_source(model, single)
    for name, text in source.files.items():
        (folder / name).write_text(text)
    name, real = source.name, "float" if single else "double"
    tell = f"if (bits[i] & {name.upper()}_NO_VALUE) {name}_measured(&s, measured[i]);" if fed_back(model) else ""
    batch = (STEPS if runs_over_time(model) else STATIC).format(name=name, real=real, inputs=len(model.inputs), tell=tell)
    (folder / "batch.c").write_text(f'#include "{name}.h"\n' + batch)
    library = folder / f"{name}.so"
    subprocess.run(["gcc", *FLAGS, *more, "-c", f"{name}.c", "-o", f"{name}.o", "-fPIC"], cwd=folder, check=True)
    subprocess.run(
        ["gcc", "-std=c99", "-shared", "-fPIC", "-O1", f"{name}.o", "batch.c", "-o", library.name, "-lm"], cwd=folder, check=True
    )
    return Compiled(model, ctypes.CDLL(str(library)), single)


def difference(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest difference, relative to the value, or to a tenth of the median magnitude where the value is smaller."""
    assert np.array_equal(np.isnan(found), np.isnan(expected)), "one has a value where the other has none"
    known = np.isfinite(expected)
    size = np.abs(expected[known])
    assert size.any()
    return float(np.max(np.abs(found[known] - expected[known]) / np.maximum(size, 0.1 * np.median(size[size > 0]))))


def points(model: Model, n: int, seed: int = 1) -> dict[str, np.ndarray]:
    """Points inside of the training range, up to half of it outside, and exactly at every boundary and beside it."""
    rng = np.random.default_rng(seed)
    columns = {}
    for quantity in model.inputs:
        edges = np.unique([edge for edge in edges_of(model, quantity.name) if np.isfinite(edge)])
        low, high = (edges[0], edges[-1]) if len(edges) else (-1.0, 1.0)
        width = (high - low) or 1.0
        x = rng.uniform(low - 0.5 * width, high + 0.5 * width, n)
        near = np.concatenate([edges, np.nextafter(edges, -np.inf), np.nextafter(edges, np.inf), np.zeros(1)])
        at = rng.random(n) < 0.4
        x[at] = rng.choice(near, at.sum())
        columns[quantity.name] = x
    return columns


def edges_of(model: Model, name: str) -> list[float]:
    """Every number at which something changes along an input."""
    match model.body:
        case Pieces(level, variables, curves):
            found = _range_edges(model.body.ranges, level, name)
            return found + [edge for curve in curves for edge in _zone_edges(curve, variables, name, model.body.fusion.z_s)]
        case Formula(_, level, ranges):
            return _range_edges(ranges, level, name)
        case Memory(_, ranges):
            return _range_edges(ranges, None, name)
        case StateSpace(motion, ranges):
            return _range_edges(ranges, None, name) + list(motion.boundaries if name == motion.input else ())
        case Sum(parts):
            return [
                edge
                for part in parts
                for own in (q.name for q in part.model.inputs)
                if name in parse(part.inputs.get(own, own)).names
                for edge in edges_of(part.model, own)
            ]
    raise TypeError(model.body)


def _range_edges(ranges: tuple[CurveRange, ...], level: str | None, name: str) -> list[float]:
    limits = [end for one in ranges if name in one.limits for end in one.limits[name]]
    return limits + [one.level for one in ranges if name == level and one.level is not None]


def _zone_edges(curve: CurveFunction, variables: tuple[str, ...], name: str, z_s: float) -> list[float]:
    for variable, boundaries in zip(variables, curve.boundaries, strict=True):
        if variable == name:
            return [*boundaries.tolist(), *(edge for ends in zones(boundaries, z_s) for edge in ends.tolist())]
    return []


def recording(model: Model, n: int, seed: int = 1) -> dict[str, np.ndarray]:
    """A recording for a model with memory: smooth, with stands, and a step beyond the training range; the output where it is fed back."""
    rng = np.random.default_rng(seed)
    step = assignments(model).step or 1.0
    t = np.arange(n) * step
    columns = {"time": t}
    for quantity in model.inputs:
        edges = edges_of(model, quantity.name) or [0.0, 1.0]
        low, high = min(edges), max(edges)
        waves = sum(np.sin(2 * np.pi * rng.uniform(0.5, 30) * np.arange(n) / n + rng.uniform(0, 6)) for _ in range(4)) / 4
        x = (low + high) / 2 + 0.6 * (high - low) * waves
        x[n // 3 : n // 2] = x[n // 3]
        columns[quantity.name] = x
    for memory in model.memories:
        low, high = memory.limits
        columns.setdefault(memory.output, rng.uniform(low, high, n))
    return columns


def compare(model: Model, folder: Path, n: int = POINTS, **how: object) -> tuple[float, int]:
    """The largest relative difference between C and `predict`, and the number of points."""
    built = compiled(model, folder, **how)
    columns = recording(model, n) if runs_over_time(model) else points(model, n)
    with np.errstate(all="ignore"):
        expected = simulate(model, columns).values
    found, bits = built.run(columns)
    flags = outside_range(model, columns)
    inputs = (1 << len(model.inputs)) - 1
    assert np.array_equal((bits & inputs) != 0, flags), "the bits of inputs out of range"
    return difference(found, expected), n


def main(runs: Path) -> None:
    """The table of docs/export.md."""
    from mapmore_cli.storage.artefacts import read_model

    print("| study | kind | points | largest relative difference | source, kB |\n|---|---|---:|---:|---:|")
    for file in sorted(runs.glob("*/model.h5")):
        model = read_model(file)
        with tempfile.TemporaryDirectory() as folder:
            kind = type(model.body).__name__.lower()
            try:
                worst, n = compare(model, Path(folder))
                size = sum(path.stat().st_size for path in Path(folder).glob("*.c") if path.name != "batch.c") / 1000
                print(f"| {file.parent.name} | {kind} | {n} | {worst:.1e} | {size:.0f} |")
            except MapmoreError as error:
                print(f"| {file.parent.name} | {kind} | | refused: {error.message} | |")
            except (AssertionError, subprocess.CalledProcessError) as error:
                print(f"| {file.parent.name} | {kind} | | FAILED: {error} | |")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
