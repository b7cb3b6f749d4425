"""Write the tables of what the papers leave to others, into docs/muscle-like.md (H), wrist.md (W)
and export.md (both models as one unit).

`python docs/outlook_tables.py RUNS`. All of it is simulated but for a regulator, whose records must
be there (docs/data.md).
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from actuator_joint import chained, turned
from muscle_tables import joint_forces, muscle_like
from pages import DOCS, r2, rms, run, scores, write_page
from scipy.optimize import minimize_scalar
from wrist_loop import Force, ModelMuscles, RigMuscles, Wrist, followed, lag_of

import mapmore_cli
from datasets.rig.air import Air, ClosedMuscle, Regulator
from datasets.rig.antagonists import Antagonists, Joint
from datasets.rig.muscle import Rubber
from datasets.rig.simulate import KPA, SimulationSpec
from datasets.rig.static_muscles import McKibben
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.tendon.model import muscle_columns, solve
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.study.loader import load_as

DATASETS = DOCS.parent / "datasets"


# H
# --------------------------------------------------------------------------------------------------

TENDON, AT_ZERO = 10_000.0, 10.0
"""Of datasets/muscle-like/tendon.yaml: N/m, and the N that the tendon carries where the length is
zero.
"""

Predict = Callable[[Columns], Array]
"""Force of a muscle, N, `(n,)`."""


def tendon_found(study: str, runs: Path, identified: Callable[[float], Predict]) -> float:
    """Return the stiffness (N/m) with the least error on a study's training samples; `identified`
    is the muscle that goes with one.
    """
    curves = run(f"muscle-like/{study}", runs).dataset().curves

    def error(power: float) -> float:
        muscle = identified(10.0**power)
        found = [
            (solve(muscle, one.columns, 10.0**power, AT_ZERO) - one.columns["force"])[one.training]
            for one in curves
        ]
        return float(np.sum(np.concatenate(found) ** 2))

    return float(
        10.0
        ** minimize_scalar(error, bounds=(3.3, 5.0), method="bounded", options={"xatol": 1e-3}).x
    )


def muscle_behind(study: str, runs: Path, stiffness: float) -> Predict:
    """Return H's model, fitted to the muscle's own length and velocity, which follow from the
    measured force and a tendon's stiffness.
    """
    curves = run(f"muscle-like/{study}", runs).dataset().curves
    own = [muscle_columns(one.columns, one.columns["force"], stiffness, AT_ZERO) for one in curves]
    columns = {
        name: np.concatenate([x[name][one.training] for x, one in zip(own, curves, strict=True)])
        for name in own[0]
    }
    formula = literature.get("muscle_like")
    fit = formula.fit(columns, columns["force"])
    return lambda given: formula.predict(fit.parameters, given)


def held_out(
    study: str, runs: Path, predicted: Predict, shortest: float = -np.inf
) -> tuple[int, float, float]:
    """Return samples, RMSE (N) and R² of predictions of a study's records, where they are held out
    and not shorter than `shortest`.
    """
    curves = run(f"muscle-like/{study}", runs).dataset().curves
    rows = [curve.held_out & (curve.columns["length"] >= shortest) for curve in curves]
    found = np.concatenate(
        [predicted(curve.columns)[own] for curve, own in zip(curves, rows, strict=True)]
    )
    force = np.concatenate(
        [curve.columns["force"][own] for curve, own in zip(curves, rows, strict=True)]
    )
    return len(force), rms(found - force), r2(force, found)


def outlook(runs: Path) -> Table:
    """Return how H's model does at controlled valves, behind a tendon, and on a joint whose motion
    does not repeat.
    """
    closed, valves, tendon = "muscle-like-16cm", "muscle-like-valves", "muscle-like-tendon"
    before = muscle_like(closed, runs)
    (record,) = run(f"muscle-like/{valves}", runs).dataset().curves
    common = float(record.columns["length"].min())
    alone, both = (
        tendon_found(tendon, runs, one)
        for one in (lambda _stiffness: before, partial(muscle_behind, tendon, runs))
    )
    known, found, together = (
        partial(solve, muscle, stiffness=stiffness, at_zero=AT_ZERO)
        for muscle, stiffness in (
            (before, TENDON),
            (before, alone),
            (muscle_behind(tendon, runs, both), both),
        )
    )
    there = muscle_like(valves, runs)
    rows: list[tuple[Cell, ...]] = [
        ("closed valves: identified there", *held_out(closed, runs, before)),
        ("closed valves: identified at controlled valves", *held_out(closed, runs, there)),
        (
            "closed valves, common lengths: identified there",
            *held_out(closed, runs, before, common),
        ),
        (
            "closed valves, common lengths: identified at controlled valves",
            *held_out(closed, runs, there, common),
        ),
        ("controlled valves: identified at closed valves", *held_out(valves, runs, before)),
        ("controlled valves: identified there", *held_out(valves, runs, there)),
        ("behind a tendon: the muscle alone", *held_out(tendon, runs, before)),
        ("behind a tendon: muscle and known tendon", *held_out(tendon, runs, known)),
        ("behind a tendon: muscle, and a tendon found there", *held_out(tendon, runs, found)),
        ("behind a tendon: both identified there", *held_out(tendon, runs, together)),
        (
            "behind a tendon: identified there, as a muscle",
            *held_out(tendon, runs, muscle_like(tendon, runs)),
        ),
    ]
    for muscle, _, measured, predicted in joint_forces(runs, "random"):
        rows.append(
            (
                f"joint, random: {muscle}",
                len(measured),
                rms(predicted - measured),
                r2(measured, predicted),
            )
        )
    joint = scores(run("muscle-like/muscle-like-joint-random", runs))
    for model, words in (
        ("mapmore", "difference of both"),
        ("identified_here", "the same, identified from its first half"),
    ):
        rows.append((f"joint, random: {words}", joint[model].n, joint[model].rmse, joint[model].r2))
    heads = ("record: model", "samples", "RMSE [N] .3g", "R² .4f")
    notes = (
        f"Stiffness of the tendon: {TENDON / 1e3:.0f} N/mm; found {alone / 1e3:.1f}, with the "
        f"muscle {both / 1e3:.1f}.",
    )
    return Table.of(
        "outlook",
        "The model of H in cases that H leaves to later work (simulated)",
        heads,
        rows,
        *notes,
    )


# Both models as one unit
# --------------------------------------------------------------------------------------------------

STEP = 0.01
"""Of the record and of the units, s."""


@cache
def random_joint() -> tuple[Joint, Columns]:
    """Return the joint of datasets/muscle-like/joint_random.yaml, and its record."""
    spec = load_as(DATASETS / "muscle-like" / "joint_random.yaml", SimulationSpec).spec
    table = np.genfromtxt(DATASETS / "muscle-like" / "joint_random.csv", delimiter=",", names=True)
    assert table.dtype.names
    assert isinstance(spec.muscle, McKibben)
    assert isinstance(spec.experiment, Antagonists)
    return Joint(spec.muscle, spec.hysteresis, spec.experiment), {
        name: table[name] for name in table.dtype.names
    }


def actuators(runs: Path, samples: int | None = None) -> Table:
    """Return how the joint moves that two exported actuators turn: beside both models one after the
    other, and beside the rig.
    """
    joint, record = random_joint()
    names = (("16cm-formula", "joint-valve-flexor"), ("22cm-formula", "joint-valve-extensor"))
    forces, pressures = (
        [run(f"muscle-like/muscle-like-{pair[part]}", runs).model() for pair in names]
        for part in (0, 1)
    )
    pairs = list(zip(forces, pressures, strict=True))
    record = {name: column[:samples] for name, column in record.items()}
    found = turned(joint, pairs, [record["U_1"], record["U_2"]], STEP)
    rows: list[tuple[Cell, ...]] = []
    later = slice(len(found["angle"]) // 2, None)

    def beside(truth: Array, one: Array) -> tuple[float, float]:
        return rms((one - truth)[later]), r2(truth[later], one[later])

    for which, muscle in ((1, "flexor"), (2, "extensor")):
        force, pair = found[f"force_{which}"], pairs[which - 1]
        apart = float(
            np.max(np.abs(force - chained(pair, found, which, STEP))) / np.median(np.abs(force))
        )
        rows.append((f"{muscle}'s force [N]", apart, *beside(record[f"F_{which}"], force)))
    angle, length = np.degrees(found["angle"]), 1e-3 * record["l_1"]
    true = np.degrees((float(joint.elongation(0, np.asarray(0.0))) - length) / joint.setup.radius)
    rows.append(("angle [deg]", None, *beside(true, angle)))
    heads = (
        "of the joint",
        "relative difference from `predict` .1e",
        "RMSE against the rig .3g",
        "R² .4f",
    )
    return Table.of(
        "actuators",
        "A joint that is turned by two exported actuators, second half of the recording",
        heads,
        rows,
    )


RECORDS = {"staircase": "repeating_take1_20s", "sweep": "sweep_take1_15s"}
SENSORS = {"MPR": "mpr_sensor_kPa", "VEAB": "veab_sensor_kPa"}


def regulators(_runs: Path) -> Table:
    """Return how well a lag is the pressure behind a measured regulator without a muscle; the
    second half of each record is held out.
    """
    folder = (
        Path(os.environ.get("MAPMORE_DATA") or DOCS.parents[1] / "shared" / "data")
        / "regulator_only"
    )
    known = {"time": {"unit": "s"}, "command": {"unit": "kPa"}, "pressure": {"unit": "kPa"}}
    settings: dict[str, Any] = {
        "dictionary": [{"slow": {"of": ["command"]}}],
        "resample": "10 ms",
        "split": {"validate": {"last": 0.5}},
    }
    rows: list[tuple[Cell, ...]] = []
    for record, file in RECORDS.items():
        table = np.genfromtxt(folder / f"{file}.csv", delimiter=",", names=True)
        for sensor, column in SENSORS.items():
            frame = {"time": table["t_s"], "command": table["cmd_kPa"], "pressure": table[column]}
            columns = {name: {"column": name, **unit} for name, unit in known.items()}
            found = mapmore_cli.fit(
                frame,
                columns=columns,
                target={"column": "pressure"},
                validate={"simple": False},
                **settings,
            )
            error = [
                100 * found.scores.of_model(split=split)["nrmse"] for split in ("train", "validate")
            ]
            rows.append((f"{record}, {sensor} sensor", found.equations[0].text, *error))
    heads = ("record", "pressure [kPa]", "training NRMSE [%] .3g", "held-out NRMSE [%] .3g")
    return Table.of("regulators", "A lag as a model of a measured regulator", heads, rows)


# W
# --------------------------------------------------------------------------------------------------

WRIST = Wrist(
    length=0.23, radius=0.015, inertia=0.01, damping=0.05, middle=0.06, pressure=400.0,
        highest=700.0, reach=1.0,
    period=0.01, step=0.001, kp=100.0, ki=500.0,
)  # fmt: skip
REGULATOR = Regulator(
    slope=1.0,
    offset=0.0,
    lag=0.02,
    band=50 * KPA,
    supply=800 * KPA,
    supply_conductance=1e-8,
    exhaust_conductance=1e-8,
    critical_ratio=0.3,
)
AIR, RUBBER = Air(1.4, 0.5, 2e-5), Rubber(80.0, 0.02)
SECONDS, SETTLED = 6.0, 2.0
"""How long the course is, and what is left out of the errors at its beginning."""

MODELS = (
    "chou_hannaford",
    "tondu_lopez_fixed_area",
    "tondu_lopez_corrected_fixed_area",
    "kerscher",
    "sarosi",
    "mapmore",
)


def course(seconds: float) -> Array:
    """Return angles to follow, rad: sines of 20 degrees at 0.5 Hz and 6 degrees at 1.1 Hz, which
    grow over the first second.
    """
    time = np.arange(0.0, seconds, WRIST.period)
    growing = np.clip(time, 0.0, 1.0) ** 2 * (3 - 2 * np.clip(time, 0.0, 1.0))
    return np.asarray(
        np.radians(
            growing * (20 * np.sin(2 * np.pi * 0.5 * time) + 6 * np.sin(2 * np.pi * 1.1 * time))
        )
    )


def force_of(name: str, runs: Path) -> Force:
    """Return the force of a model of `configs/wrist/wrist-static.yaml`."""
    files = run("wrist/wrist-static", runs)
    if name == "mapmore":
        model = files.model()
        return lambda pressure, strain: predict(model, {"pressure": pressure, "strain": strain})
    fit, formula = files.validation().formulas[name], literature.get(name)
    return lambda pressure, strain: formula.predict(
        fit.parameters, {"pressure": pressure, "strain": strain}
    )


def rig_muscles(friction: float = 1.0) -> RigMuscles:
    """Return the muscles of datasets/wrist, full of air, behind regulators; with so much of their
    friction.
    """
    spec = load_as(DATASETS / "wrist" / "contraction_table.yaml", SimulationSpec).spec
    assert isinstance(spec.muscle, McKibben)
    found = replace(
        spec.hysteresis,
        base=friction * spec.hysteresis.base,
        per_pressure=friction * spec.hysteresis.per_pressure,
    )
    return RigMuscles(ClosedMuscle(spec.muscle, found, RUBBER, AIR), REGULATOR, WRIST)


@cache
def lag() -> float:
    """Return the time constant of the regulator, s, from a loop that knows no model."""
    reference = course(2.0)
    found = followed(WRIST, rig_muscles(), reference, np.zeros(len(reference)))
    return lag_of(found["asked"], found["pressure"], WRIST.period)


def _loop(name: str | None, runs: Path, gains: float) -> tuple[Wrist, Force | None, Array, Array]:
    """Return the loop, a model's force, the course, and what the model feeds forward."""
    wrist, reference = replace(WRIST, kp=gains * WRIST.kp, ki=gains * WRIST.ki), course(SECONDS)
    force = None if name is None else force_of(name, runs)
    return (
        wrist,
        force,
        reference,
        np.zeros(len(reference)) if force is None else wrist.feed(force, reference),
    )


def _error(one: Array, other: Array) -> float:
    """RMSE of an angle, degrees, after the beginning."""
    return float(np.degrees(rms((one - other)[round(SETTLED / WRIST.period) :])))


def foretold(name: str, runs: Path, gains: float = 1.0) -> float:
    """RMSE of the angle in the simulation by a model that is also fed forward, degrees."""
    wrist, force, reference, feed = _loop(name, runs, gains)
    assert force is not None
    return _error(
        followed(wrist, ModelMuscles(force, lag(), wrist), reference, feed)["angle"], reference
    )


def frictionless(name: str, runs: Path, gains: float = 1.0) -> float:
    """RMSE of the angle in the rig without friction, degrees."""
    wrist, _, reference, feed = _loop(name, runs, gains)
    return _error(followed(wrist, rig_muscles(0.0), reference, feed)["angle"], reference)


def loops(name: str | None, runs: Path, gains: float = 1.0) -> tuple[float | None, ...]:
    """RMSE of the angle in the rig, in the simulation by the model that is fed forward, and between
    both, degrees.
    """
    wrist, force, reference, feed = _loop(name, runs, gains)
    true = followed(wrist, rig_muscles(), reference, feed)["angle"]
    if force is None:
        return _error(true, reference), None, None
    told = followed(wrist, ModelMuscles(force, lag(), wrist), reference, feed)["angle"]
    return _error(true, reference), _error(told, reference), _error(true, told)


def wrist_loop(runs: Path) -> Table:
    """Return errors of the loop on the rig, and what simulations by the fitted models foretell."""
    rows: list[tuple[Cell, ...]] = [
        (name or "nothing", *loops(name, runs), *loops(name, runs, gains=2.0)[:2])
        for name in (*MODELS, None)
    ]
    rows.append(
        (
            "sarosi, on a rig without friction",
            frictionless("sarosi", runs),
            None,
            None,
            frictionless("sarosi", runs, 2.0),
            None,
        )
    )
    heads = (
        "rig: RMSE",
        "foretold: RMSE",
        "difference of rig and foretold",
        "rig at twice the gains: RMSE",
        "foretold at twice the gains: RMSE",
    )
    columns = ("feedforward by", *(f"{head} [deg] .3g" for head in heads))
    notes = (f"Lag of the regulator by least squares: {1e3 * lag():.0f} ms.",)
    return Table.of(
        "wrist-loop", "W's muscles on a wrist in a closed loop (simulated)", columns, rows, *notes
    )


if __name__ == "__main__":
    write_page("muscle-like.md", {"outlook": outlook})
    write_page("export.md", {"actuators": actuators, "regulators": regulators})
    write_page("wrist.md", {"wrist-loop": wrist_loop})
