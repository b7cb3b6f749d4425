"""Exported models replay held-out recordings through the other side's readers: `python
tests/exporting/replay.py RUNS` writes the table.

The readers are not ours: SciPy's for MAT files and its interpolation, a Python without packages,
gcc, MuJoCo, FMPy.
"""

import ctypes
import io
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.io import loadmat

from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.annexes.exporting.templates import names_of_inputs
from mapmore_cli.domain.errors import UsageError
from mapmore_cli.modelling.kinds import fed_back, outside_range, runs_over_time, simulate
from mapmore_cli.modelling.programs import program_of
from mapmore_cli.storage.artefacts import read_dataset, read_model

OCTAVE = shutil.which("octave-cli") or shutil.which("octave")
Columns = Mapping[str, np.ndarray]
SIMULATED = (
    "m2/dmsp-20-88-static",
    "m2/peano-static",
    "m1/dmsp-20-88-inner-reversals",
    "m1/peano-inner-reversals",
)
MEASURED = (
    "festo/festo_10mm_10cm_strain",
    "festo/festo_10mm_20cm_repeat",
    "festo/festo_10mm_30cm_pressure",
    "coiled/coiled_loops",
)


def held_out(folder, model):
    """The held-out recordings of a run, each with the rows that are held out; without memory these
    rows alone, where the model is valid.
    """
    found = []
    for curve in read_dataset(folder / "ingest.h5").curves:
        for rows in curve.logs:
            if runs_over_time(model):
                columns, counts = (
                    {name: column[rows] for name, column in curve.columns.items()},
                    curve.held_out[rows],
                )
            else:
                columns = {
                    name: column[rows[curve.held_out[rows]]]
                    for name, column in curve.columns.items()
                }
                columns = {
                    name: column[~outside_range(model, columns)] for name, column in columns.items()
                }
                counts = np.ones(len(columns[model.inputs[0].name]), dtype=bool)
            if counts.any():
                found.append((columns, counts))
    return found


def written(model, to, folder):
    """The files of an export in a folder."""
    files = exported(model, to)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return [folder / name for name in files]


def looked_up(axes, values, model, columns):
    """Linear interpolation between the points of a table, held at its ends as lookup blocks do."""
    places = [
        np.clip(columns[q.name], axis[0], axis[-1])
        for q, axis in zip(model.inputs, axes, strict=True)
    ]
    return np.asarray(RegularGridInterpolator(axes, values)(np.column_stack(places)))


def by_mat(model, columns, folder):
    """The MAT file as SciPy reads it."""
    (file,) = (path for path in written(model, "table", folder) if path.suffix == ".mat")
    table, names = loadmat(file), names_of_inputs(model.inputs, [model.output.name, "valid"])
    return looked_up(
        [table[names[q.name]].ravel() for q in model.inputs],
        table[model.output.name],
        model,
        columns,
    )


def combi_tables(text):
    """Both tables of a text for CombiTable2D, by the grammar of ModelicaStandardTables: places
    along rows and columns, and values.
    """
    assert text.startswith("#1\n")
    found = {}
    for part in text.split("\ndouble ")[1:]:
        head = re.match(r"(\w+)\((\d+),(\d+)\)\n", part)
        assert head
        grid = np.loadtxt(io.StringIO(part[head.end() :]), max_rows=int(head[2])).reshape(
            int(head[2]), int(head[3])
        )
        found[head[1]] = ([grid[1:, 0], grid[0, 1:]], grid[1:, 1:])
    return found


def by_modelica(model, columns, folder):
    """The text for Modelica as NumPy reads it, where there are two inputs."""
    text = [path for path in written(model, "table", folder) if path.suffix == ".txt"]
    return (
        looked_up(*combi_tables(text[0].read_text())[model.output.name], model, columns)
        if text
        else None
    )


PLAIN = """
import json, sys
sys.path.insert(0, sys.argv[1])
import {module} as muscle
rows, measured = json.load(sys.stdin)
state, found = muscle.reset(), []
for k, row in enumerate(rows):
    found.append(muscle.{output}(*row, state))
    if measured and k < 10 and found[-1] != found[-1]:
        state.measured(measured[k])
json.dump(found, sys.stdout)
"""


def by_python(model, columns, folder):
    """The Python file in an isolated interpreter that has no package at all."""
    (file,) = written(model, "py", folder)
    rows = np.column_stack([columns[q.name] for q in model.inputs]).tolist()
    measured = [columns[name].tolist() for name in fed_back(model)]
    code = PLAIN.format(module=file.stem, output=model.output.name)
    call = [sys.executable, "-I", "-S", "-c", code, str(folder)]
    done = subprocess.run(
        call,
        input=json.dumps([rows, *(measured or [None])]),
        capture_output=True,
        text=True,
        check=True,
    )
    return np.array(json.loads(done.stdout))


def compiled(files, folder, *extra):
    """An export in C as a shared library, without a warning, and the name of its functions."""
    for name, data in files.items():
        (folder / name).write_bytes(data)
    sources = [
        name
        for name in files
        if name.endswith(".c") and "_main" not in name and "_inverse" not in name
    ]
    command = [
        "gcc",
        "-std=c99",
        "-Wall",
        "-Werror",
        "-shared",
        "-fPIC",
        "-o",
        "lib.so",
        *sources,
        *extra,
        "-lm",
    ]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "lib.so")), min(files, key=len).removesuffix(".c").removesuffix(
        ".h"
    )


def by_c_caller(model, columns, folder):
    """The function that Simulink's C Caller calls."""
    library, name = compiled(exported(model, "simulink"), folder)
    function = getattr(library, f"{name}_{model.output.name}")
    function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double] * len(model.inputs)
    return np.array(
        [
            function(*row)
            for row in zip(*(columns[q.name].tolist() for q in model.inputs), strict=True)
        ]
    )


SCENE = """
<mujoco>
  <size nuser_actuator="2"/>
  <option timestep="0.0005" integrator="implicitfast"/>
  <worldbody>
    <site name="top" pos="0 0 1"/>
    <body name="load" pos="0 0 0.8">
      <joint name="z" type="slide" axis="0 0 1" damping="60"/>
      <geom size="0.02" mass="{mass}"/>
      <site name="hook"/>
    </body>
  </worldbody>
  <tendon><spatial name="muscle"><site site="top"/><site site="hook"/></spatial></tendon>
  <actuator>
    <general tendon="muscle" gaintype="fixed" gainprm="0" biastype="user" user="0.2 0"/>
  </actuator>
</mujoco>
"""
"""A muscle of 0.2 m that lifts a weight."""


class Lift:
    """MuJoCo with an exported muscle: `with Lift(model, folder) as lift`, then `lift.world` and
    `lift.data`.
    """

    def __init__(self, model, folder, mass=12.0):
        import mujoco

        self.mujoco = mujoco
        include = Path(mujoco.__file__).parent / "include"
        library, name = compiled(exported(model, "mujoco"), folder, f"-I{include}", "-Wno-pedantic")
        self.callback = getattr(library, f"{name}_act_bias")
        self.callback.restype, self.callback.argtypes = (
            ctypes.c_double,
            [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int],
        )
        self.world = mujoco.MjModel.from_xml_string(SCENE.format(mass=mass))
        self.data = mujoco.MjData(self.world)

    def __enter__(self):
        self.mujoco.set_mjcb_act_bias(
            lambda m, d, actuator: self.callback(m._address, d._address, actuator)
        )
        return self

    def __exit__(self, *_error):
        self.mujoco.set_mjcb_act_bias(None)

    def force(self, pressure, strain):
        """The pull of the muscle where the weight is held at a strain."""
        self.data.ctrl[0], self.data.qpos[0] = pressure, 0.2 * strain
        self.mujoco.mj_forward(self.world, self.data)
        return float(-self.data.actuator_force[0])


def by_mujoco(model, columns, folder):
    """The callback in MuJoCo, with the weight moved along the recording."""
    with Lift(model, folder) as lift:
        return np.array(
            [lift.force(p, e) for p, e in zip(columns["pressure"], columns["strain"], strict=True)]
        )


def simulated(model, file, columns, step):
    """What FMPy gets from a unit for a recording; its row k + 1 answers to the recording's row
    k.
    """
    import fmpy

    n = len(next(iter(columns.values())))
    given = {quantity.name: columns[quantity.name] for quantity in model.inputs}
    given |= {f"{name}_measured": columns[name] for name in fed_back(model)}
    signals = np.zeros(n, dtype=[("time", float), *((name, float) for name in given)])
    signals["time"] = np.arange(n) * step
    for name, values in given.items():
        signals[name] = values
    found = fmpy.simulate_fmu(
        str(file),
        stop_time=n * step,
        output_interval=step,
        input=signals,
        output=[model.output.name, "outside_range"],
        fmi_type="CoSimulation",
    )
    assert len(found) == n + 1
    return found


def by_fmpy(model, columns, folder, to="fmu"):
    """The unit as FMPy simulates it."""
    (file,) = written(model, to, folder)
    return np.asarray(
        simulated(model, file, columns, program_of(model).step or 0.1)[model.output.name][1:]
    )


def by_octave(model, columns, folder):
    """The function file in Octave: with memory in two calls, of which the second goes on from the
    state of the first.
    """
    (file,) = written(model, "matlab", folder)
    names = [*(quantity.name for quantity in model.inputs), *fed_back(model)]
    np.savetxt(folder / "rows.txt", np.column_stack([columns[name] for name in names]), "%.17g")
    call = f"[y, ~] = {file.stem}(x{{:}});"
    if program_of(model).step is not None:
        call = (
            "h = floor(size(rows, 1) / 2);"
            "first = num2cell(rows(1:h, :), 1); rest = num2cell(rows(h + 1:end, :), 1);"
            f"[y, ~, s] = {file.stem}(first{{:}}); [z, ~] = {file.stem}(rest{{:}}, s); y = [y; z];"
        )
    text = f'rows = load("rows.txt"); x = num2cell(rows, 1); {call} printf("%.17g\\n", y);'
    done = subprocess.run(
        [OCTAVE, "--norc", "--no-gui", "--eval", text],
        cwd=folder,
        capture_output=True,
        text=True,
        check=True,
    )
    return np.array(done.stdout.split(), dtype=float)


READERS = {
    "MAT by SciPy": by_mat,
    "Modelica's text by NumPy": by_modelica,
    "Python alone": by_python,
    "C Caller": by_c_caller,
    "MuJoCo": by_mujoco,
    "FMU by FMPy": by_fmpy,
    "FMU 3 by FMPy": partial(by_fmpy, to="fmu3"),
    "MATLAB by Octave": by_octave,
}
TABLES = ("MAT by SciPy", "Modelica's text by NumPy")


def replayed(folder, readers=READERS):
    """Held-out samples of a run, and by reader the largest difference from `predict`, in % of the
    prediction's range; None if refused.
    """
    model = read_model(folder / "model.h5")
    recordings = held_out(folder, model)
    expected = [simulate(model, columns).values[counts] for columns, counts in recordings]
    known = np.concatenate(expected)
    assert np.isfinite(known).any()
    worst = {}
    for name, reader in readers.items():
        try:
            with TemporaryDirectory() as place:
                answers = [reader(model, columns, Path(place)) for columns, _ in recordings]
        except UsageError:
            answers = [None]
        found = [
            a[counts] for a, (_, counts) in zip(answers, recordings, strict=False) if a is not None
        ]
        worst[name] = largest(np.concatenate(found), known) if found else None
    return len(known), worst


def largest(found, expected):
    """The largest difference in % of the range of what is expected; both are NaN in the same
    places.
    """
    assert np.array_equal(np.isnan(found), np.isnan(expected))
    return float(
        100 * np.nanmax(np.abs(found - expected)) / (np.nanmax(expected) - np.nanmin(expected))
    )


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
    from pages import DOCS, run, write_tables

    from mapmore_cli.reporting.table import Column, Table

    def table():
        """The table of docs/export.md."""
        columns = (
            Column("held out in"),
            Column("samples"),
            *(Column(name, "%", ".1e") for name in READERS),
        )
        rows = []
        for study in (*SIMULATED, *MEASURED):
            samples, worst = replayed(run(study, Path(sys.argv[1])).folder)
            rows.append((study.partition("/")[2], samples, *worst.values()))
            print(rows[-1], file=sys.stderr)
        return Table(
            "replays",
            "Largest difference from `predict`, in % of the prediction's range",
            columns,
            tuple(rows),
        )

    write_tables(DOCS / "export.md", {"replays": table})
