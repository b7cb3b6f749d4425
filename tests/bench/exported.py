"""Exported models a call: nanoseconds, bytes of code and of state, in C beside the formulas of the
literature and beside NumPy.

python tests/bench/exported.py      prints the table of docs/export.md; `make bench` has it among
others
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from table import exported_lines
from timing import in_turn

from mapmore_cli.annexes.exporting.c_source import c_source
from mapmore_cli.annexes.exporting.python_module import python_module
from mapmore_cli.domain.models import Formula, Model
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import runs_over_time
from mapmore_cli.storage.artefacts import read_model, read_validation

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "exporting"))
from agreement import compiled, points, recording, table  # noqa: E402 - its folder is not a package

CONFIGS = HERE.parents[1] / "configs"
POINTS, CALLS, ROUNDS = 5_000, 20, 200

STATIC = ("m2/dmsp-20-88-static.yaml", "validate.against=[sarosi, polynomial_2, polynomial_5]")
BACKBONE = (
    "m2/dmsp-20-88-static.yaml",
    "name=on-sarosi",
    "model.backbone=sarosi",
    "validate.against=[]",
)
MEMORY = ("m1/dmsp-20-88-inner-reversals.yaml", "validate.against=[]")
DAMPING = ("m2/dmsp-20-88-damping.yaml", "validate.against=[reynolds, peternel]")


def exported(runs):
    """A row for every model: nanoseconds a call in C and in NumPy, bytes of code and state."""
    models = every_model(Path(runs))
    with tempfile.TemporaryDirectory() as place:
        folders = {what: Path(place) / str(number) for number, what in enumerate(models)}
        for folder in folders.values():
            folder.mkdir()
        calls = {what: in_c(model, folders[what]) for what, model in models.items()}
        took = in_turn(calls, ROUNDS, min)
        return {
            what: {
                "c": took[what] / POINTS * 1e9,
                **in_numpy(model, folders[what]),
                "code": code_bytes(model, folders[what]),
                "state": state_bytes(model, folders[what]),
            }
            for what, model in models.items()
        }


def every_model(runs):
    """The models of M2 and M1, and the formulas fitted to the same data, by what they are
    called.
    """
    static, on_sarosi, memory, damping = (
        run(runs, *study) for study in (STATIC, BACKBONE, MEMORY, DAMPING)
    )
    models = {
        "mapmore, M2's static model": read_model(static / "model.h5"),
        "mapmore on Sárosi's formula": read_model(on_sarosi / "model.h5"),
        "mapmore with memory (M1's inner reversals)": read_model(memory / "model.h5"),
    }
    for name in ("sarosi", "polynomial_2", "polynomial_5"):
        models[name] = formula_model(static, name)
    for name in ("reynolds", "peternel"):
        models[f"{name} (damping)"] = formula_model(damping, name)
    return {
        what: replace(model, name=f"model {number}")
        for number, (what, model) in enumerate(models.items())
    }


def run(runs, spec, *settings):
    """The folder of a run of a shipped study, run if need be."""
    name = next(
        (one.removeprefix("name=") for one in settings if one.startswith("name=")), Path(spec).stem
    )
    changes = [word for one in settings for word in ("--set", one)]
    command = [
        sys.executable,
        "-m",
        "mapmore_cli",
        "run",
        CONFIGS / spec,
        "--runs",
        runs,
        "-q",
        *changes,
    ]
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)
    return runs / name


def formula_model(folder, name):
    """A competitor of a run as a model of its own, with the run's training ranges."""
    model, fit = (
        read_model(folder / "model.h5"),
        read_validation(folder / "validate.h5").formulas[name],
    )
    inputs = tuple(
        quantity for quantity in model.inputs if quantity.name in literature.get(name).inputs
    )
    names = {quantity.name for quantity in inputs}
    level = model.level if model.level in names else None
    ranges = tuple(
        replace(one, limits={key: ends for key, ends in one.limits.items() if key in names})
        for one in model.body.ranges
    )
    return Model(name, model.output, inputs, Formula(fit, level, ranges))


def samples(model):
    """Points around the training range; a recording for a model with memory."""
    return recording(model, POINTS) if runs_over_time(model) else points(model, POINTS)


def in_c(model, folder):
    """Calls the compiled model at every sample; the loop is C's too."""
    built, columns = compiled(model, folder, more=("-O2",)), samples(model)
    rows, out, bits = table(model, columns), np.empty(POINTS), np.empty(POINTS, dtype=np.int32)
    return lambda: built.library.verify(rows.ctypes, POINTS, out.ctypes, bits.ctypes)


def in_numpy(model, folder):
    """Nanoseconds a sample of the NumPy module: one at a time, and many at once where it can."""
    file, text = python_module(model, plain=False)
    (folder / file).write_text(text, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(f"exported_{folder.name}", folder / file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    columns = samples(model)
    given = [columns[name] for name in module.INPUTS]
    rows = np.stack(given, axis=1)[:CALLS].tolist()
    if runs_over_time(model):
        state = module.State()
        calls = {"one": lambda: [module.step(state, *row) for row in rows]}
    else:
        calls = {
            "one": lambda: [module.evaluate(*row) for row in rows],
            "many": lambda: module.evaluate(*given),
        }
    took = in_turn(calls, ROUNDS, min)
    return {
        "numpy_one": took["one"] / CALLS * 1e9,
        "numpy_many": took["many"] / POINTS * 1e9 if "many" in took else None,
    }


def code_bytes(model, folder):
    """Instructions and constants of the model's object file."""
    name = c_source(model).name
    found = subprocess.run(
        ["size", f"{name}.o"], cwd=folder, check=True, capture_output=True, text=True
    ).stdout
    return int(found.splitlines()[1].split()[0])


def state_bytes(model, folder):
    """What a caller keeps for the model."""
    if not runs_over_time(model):
        return 0
    name = c_source(model).name
    text = (
        f'#include "{name}.h"\n#include <stdio.h>\nint main(void) {{ printf("%d", '
        f"(int)sizeof({name}_state)); return 0; }}\n"
    )
    (folder / "state.c").write_text(text, encoding="utf-8")
    subprocess.run(["gcc", "state.c", "-o", "state"], cwd=folder, check=True)
    return int(
        subprocess.run(["./state"], cwd=folder, check=True, capture_output=True, text=True).stdout
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as runs_folder:
        print(*exported_lines(exported(runs_folder)), sep="\n")
