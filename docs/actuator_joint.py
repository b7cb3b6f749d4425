"""Two exported actuators turn a joint, for the page on exports: each is a unit from the input of a
valve to the force of a muscle.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave

from datasets.rig.antagonists import SIGNS, Joint
from mapmore_cli.annexes.exporting.exports import exported
from mapmore_cli.annexes.sums.joint import actuator
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.models import Model
from mapmore_cli.modelling.kinds import predict

Pair = tuple[Model, Model]
"""A model of the force and one of the pressure."""


@contextmanager
def unit_of(pair: Pair) -> Iterator[tuple[FMU2Slave, dict[str, int]]]:
    """Yield the unit of an actuator as FMPy runs it, and the value references of its variables."""
    with TemporaryDirectory() as folder:
        ((name, data),) = exported(actuator(*pair), "fmu").items()
        (Path(folder) / name).write_bytes(data)
        place = fmpy.extract(str(Path(folder) / name), folder)
        about = fmpy.read_model_description(place)
        model = about.coSimulation.modelIdentifier
        unit = FMU2Slave(
            guid=about.guid, unzipDirectory=place, modelIdentifier=model, instanceName=model
        )
        unit.instantiate()
        unit.setupExperiment(startTime=0.0)
        unit.enterInitializationMode()
        unit.exitInitializationMode()
        yield unit, {one.name: one.valueReference for one in about.modelVariables}
        unit.terminate()
        unit.freeInstance()


def turned(joint: Joint, pairs: Sequence[Pair], inputs: Sequence[Array], step: float) -> Columns:
    """Return what two actuators do to a joint that is at rest at the angle zero, while their valves
    are told `inputs` (V), `(n,)` each.

    `J a'' = r (F_1 - F_2) - d a'`, from sample to sample: the rate by the forces at the angle
    before, then the angle by the rate. A rope does not push. Columns: `angle` (rad) and, for each
    muscle, what it is told and answers, as `input_1`, `length_1` (m), `force_1` (N).
    """
    n, setup = len(inputs[0]), joint.setup
    names = ("input", "length", "velocity", "force")
    found = {
        name: np.zeros(n)
        for name in ("angle", *(f"{name}_{which}" for which in (1, 2) for name in names))
    }
    angle = rate = 0.0
    with unit_of(pairs[0]) as first, unit_of(pairs[1]) as second:
        for k in range(n):
            found["angle"][k] = angle
            for which, (unit, places) in enumerate((first, second)):
                length = float(joint.elongation(which, np.asarray(angle)))
                told = {
                    "input": float(inputs[which][k]),
                    "length": length,
                    "velocity": SIGNS[which] * setup.radius * rate,
                }
                unit.setReal([places[name] for name in told], list(told.values()))
                unit.doStep(k * step, step)
                told["force"] = unit.getReal([places["force"]])[0]
                for name, value in told.items():
                    found[f"{name}_{which + 1}"][k] = value
            pulls = [max(found[f"force_{which}"][k], 0.0) for which in (1, 2)]
            rate += (
                step / setup.inertia * (setup.radius * (pulls[0] - pulls[1]) - setup.damping * rate)
            )
            angle += step * rate
    return found


def chained(pair: Pair, found: Columns, which: int, step: float) -> Array:
    """Return the force by `predict` of the pressure and `predict` of the force, along what an
    actuator was told, `(n,)`.
    """
    columns = {name: found[f"{name}_{which}"] for name in ("input", "length", "velocity")}
    columns["time"] = step * np.arange(len(columns["input"]), dtype=np.float64)
    force, pressure = pair
    return predict(force, {**columns, pressure.output.name: predict(pressure, columns)})
