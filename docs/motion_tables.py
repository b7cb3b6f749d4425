"""Write the tables of docs/motion.md: `python docs/motion_tables.py RUNS`. Runs are brought up to
date first.

The table of coiled muscles needs the measured recordings (docs/data.md); the others need nothing
but the repository.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from pages import DOCS, campaign, of_campaign, printed, rms, run, scores, write_page

from mapmore_cli.annexes.motion.body import (
    BUMPLESS,
    CARRIED,
    HARD,
    ZERO,
    Motion,
    MotionFit,
    MotionSection,
)
from mapmore_cli.annexes.motion.fitting import fit_motion
from mapmore_cli.annexes.motion.problem import Bounds, MotionRecipe
from mapmore_cli.annexes.motion.simulation import motion_errors, simulate
from mapmore_cli.annexes.motion.solvers import ITERATIONS
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles

BOUNDARIES = (1.05, 2.35, 3.15, 3.95, 4.75)
STEP = 0.05
"""s; P does not print it."""
NOISE = 0.05
"""cm."""
SEEDS = range(10)
MODELS = ("linear", "inflate_deflate", "piecewise", "piecewise_inflate_deflate")
TRIALS: Mapping[str, dict[str, object]] = {
    "least_squares": {},
    "swarm": {"solver": "swarm"},
}


def recipe(**settings: Any) -> MotionRecipe:
    """Return the settings of a fit, of the simulated muscle."""
    return MotionRecipe(input="input", output="displacement", step=STEP, **settings)


def continued(motion: Motion) -> Motion:
    """Return a model with hard switching as one that shares its state: constants are added so that
    its sections meet.

    Published sections have steady outputs that disagree at the boundaries; the first stays as it
    is. Rise and fall are joined each for itself.
    """
    lines = 2 if motion.directed else 1
    sections = [replace(one, weights=np.array([one.p3, 0.0])) for one in motion.sections]
    for number, section in enumerate(sections[lines:], start=lines):
        before, edge = sections[number - lines], motion.boundaries[number // lines - 1]
        steady = (before.weights @ np.array([edge, 1.0])) / (1.0 - before.p1 - before.p2)
        constant = steady * (1.0 - section.p1 - section.p2) - section.p3 * edge
        sections[number] = replace(section, weights=np.array([section.p3, constant]))
    return replace(motion, switching=BUMPLESS, drives=(motion.input, "1"), sections=tuple(sections))


def published(model: str) -> Motion:
    """One of P's models, used directly."""
    rows = [row for row in printed("p_table_1.csv") if row["model"] == model]
    parameters = [[float(row[name]) for name in ("p1", "p2", "p3")] for row in rows]
    sections = tuple(
        MotionSection(
            row["printed_section"],
            max(int(row["section"]), 1),
            row["direction"],
            p1,
            p2,
            np.array([p3]),
        )
        for row, (p1, p2, p3) in zip(rows, parameters, strict=True)
    )
    boundaries = BOUNDARIES if len(rows) >= len(BOUNDARIES) else ()
    return Motion(
        "input",
        "displacement",
        STEP,
        HARD,
        boundaries,
        rows[0]["direction"] != "all",
        0.0,
        ("input",),
        sections,
        (0.0, 5.0),
    )


def poles(_runs: Path) -> Table:
    """Poles and gains of the published rows."""
    columns = (
        *(
            "model",
            "sections",
            "largest pole .3f",
            "least steady output at 5 V [cm] .2f",
            "greatest [cm] .2f",
        ),
        *(
            "greatest jump at a boundary [cm] .2f",
            "the same on a slow ramp, hard [cm] .2f",
            "shared state [cm] .3f",
        ),
    )
    rows = []
    for name in MODELS:
        model = published(name)
        gains = [5 * section.gain for section in model.sections]
        ways = 2 if model.directed else 1
        lines = [model.sections[way::ways] for way in range(ways)]
        steps = [
            abs(at * (b.gain - a.gain))
            for line in lines
            for at, (a, b) in zip(model.boundaries, pairwise(line), strict=True)
        ]
        ramps = (None, None) if not model.boundaries else (ramp(model), ramp(continued(model)))
        rows.append(
            (
                name,
                len(gains),
                max(s.radius for s in model.sections),
                min(gains),
                max(gains),
                max(steps, default=None),
                *ramps,
            )
        )
    return Table.of("poles", "The published parameters in discrete time", columns, rows)


def ramp(model: Motion) -> float:
    """Largest change from sample to sample while the input rises, and then falls, by 0.05 V/s;
    without the first second.
    """
    up = np.arange(0.0, 5.0, 0.05 * STEP)
    runs = [simulate(model, {"input": u}) for u in (up, up[::-1])]
    return max(float(np.abs(np.diff(run))[round(1 / STEP) :].max()) for run in runs)


def solvers(_runs: Path) -> Table:
    """Every solver on noisy data of P's linear row, from ten seeds."""
    row = next(row for row in printed("p_table_1.csv") if row["model"] == "linear")
    n = 4000
    u = 2.5 - 2.5 * np.cos(2 * np.pi * 0.25 * STEP * np.arange(n))
    clean = simulate(published("linear"), {"input": u})
    y = clean + NOISE * np.random.default_rng(1).standard_normal(n)
    record = Record({"input": u, "displacement": y}, np.ones(n, dtype=np.bool_))
    found = {
        name: [fit_motion([record], recipe(seed=seed, **settings)).searches[0] for seed in SEEDS]
        for name, settings in TRIALS.items()
    }
    least = found["least_squares"][0].rmse
    columns = (
        "solver",
        "smallest ratio .3f",
        "median .3f",
        "largest ratio .3f",
        "seeds within 1 %",
        "simulations",
    )
    rows = []
    for name, searches in found.items():
        ratios = [search.rmse / least for search in searches]
        within = f"{sum(ratio <= 1.01 for ratio in ratios)} of {len(ratios)}"
        rows.append(
            (
                name,
                min(ratios),
                median(ratios),
                max(ratios),
                within,
                int(median(s.evaluations for s in searches)),
            )
        )
    assert float(row["p1"]) == published("linear").sections[0].p1
    return Table.of(
        "solvers",
        "RMSE divided by that of least squares, on noisy data from the published linear model",
        columns,
        rows,
    )


BOUNDS = (0.5, 1.0, 2.0, 4.0, 1000.0)
"""s; the second is a quarter of the wavelength that a section of P is found on, which is the
default.
"""
EVERY = 5
"""One sample in so many of the simulated waveforms, as the study has it."""


def log(path: Path) -> Record:
    """Return a recording of the simulated muscle: input (V) and displacement (cm)."""
    rows = np.loadtxt(path, delimiter=",", skiprows=1)[::EVERY]
    return Record(
        {"input": rows[:, 1], "displacement": rows[:, 3] / 10}, np.ones(len(rows), dtype=np.bool_)
    )


def slowest(_runs: Path) -> Table:
    """P's linear and piecewise model by least squares, with the longest time constant that a
    section may have.
    """
    folder = DOCS.parent / "datasets" / "waveforms"
    held_out = [log(path) for path in sorted(folder.glob("waveform_*.csv"))]
    rows: list[tuple[Cell, ...]] = []
    for bound in BOUNDS:
        errors = []
        for pattern, settings in (
            ("reference_full.csv", {}),
            ("reference_section_*.csv", {"sections": BOUNDARIES}),
        ):
            made = recipe(slowest=bound, **settings)
            model = fit_motion([log(path) for path in sorted(folder.glob(pattern))], made).model
            wrong = [simulate(model, one.columns) - one.columns["displacement"] for one in held_out]
            errors.append(rms(np.concatenate(wrong)))
        rows.append((f"{bound:g} s", *errors))
    columns = ("slowest", "linear [cm] .3f", "piecewise [cm] .3f")
    return Table.of(
        "slowest",
        "RMSE over all seven waveforms, for each limit of the time constants",
        columns,
        rows,
    )


def waveforms(runs: Path) -> Table:
    """RMSE over the last wavelength of every waveform, by model, with the greatest error."""
    files = run("motion/dmsp-20-400-waveforms", runs)
    dataset, found = files.dataset(), files.validation().predictions
    rows: list[tuple[Cell, ...]] = []
    for number, curve in enumerate(dataset.curves):
        if not curve.held_out.all():
            continue
        errors = [
            motion_errors(curve.columns["displacement"], one[number], curve.columns["input"], STEP)
            for one in found.values()
        ]
        rows.append(
            (curve.id.removeprefix("waveform_"), *(error.displacement_rmse for error in errors))
        )
        rows.append(
            (
                f"{curve.id.removeprefix('waveform_')}, largest",
                *(error.max_displacement for error in errors),
            )
        )
    columns = ("waveform", *(f"{model} [cm] .2f" for model in found))
    return Table.of("waveforms", "Errors over one wavelength", columns, rows)


READINGS: Mapping[str, dict[str, object]] = {
    "at rest, hard": {},
    "from zero, carried": {
        "start": ZERO,
        "mask": "displacement",
        "switching": CARRIED,
        "begin": Bounds((0.0, 1.0), (0.0, 1.0), (0.0, 3.0)),
    },
}
"""Two readings of P's text; the settings of every model."""
KINDS: Mapping[str, tuple[str, dict[str, object]]] = {
    "linear": ("reference_full.csv", {}),
    "inflate_deflate": ("reference_full.csv", {"direction": True}),
    "piecewise": ("reference_section_*.csv", {"sections": BOUNDARIES}),
    "piecewise_inflate_deflate": (
        "reference_section_*.csv",
        {"sections": BOUNDARIES, "direction": True},
    ),
}
READING_SEEDS = range(1, 21)
MEDIAN_SEEDS = range(1, 13)
FOLDER = DOCS.parent / "datasets" / "waveforms"


@cache
def references(pattern: str, noise: float) -> tuple[Record, ...]:
    """Return the recordings that a model is fitted to, with so much more noise (cm)."""
    records = [log(path) for path in sorted(FOLDER.glob(pattern))]
    rng = np.random.default_rng(1)
    return tuple(
        replace(
            one,
            columns={
                **one.columns,
                "displacement": one.columns["displacement"]
                + noise * rng.standard_normal(len(one.training)),
            },
        )
        for one in records
    )


@cache
def validation_waves() -> Mapping[str, Columns]:
    """Return the seven waveforms by name."""
    return {
        path.stem.removeprefix("waveform_"): log(path).columns
        for path in sorted(FOLDER.glob("waveform_*.csv"))
    }


@cache
def models_of(reading: str, seed: int, noise: float = 0.0) -> Mapping[str, MotionFit]:
    """Return P's four models, found by its swarm."""
    return {
        kind: fit_motion(
            references(pattern, noise),
            recipe(solver="swarm", seed=seed, **settings, **READINGS[reading]),
        )
        for kind, (pattern, settings) in KINDS.items()
    }


def errors_by_seed(reading: str, seeds: Sequence[int] = READING_SEEDS) -> Mapping[str, Array]:
    """Return the displacement RMSE (cm) of P's four models, found by its swarm, on every waveform,
    (seeds, models).
    """
    return {
        wave: np.array([[errors[0] for errors in of_seed[wave]] for of_seed in measured])
        for measured in [[errors_of(reading, seed) for seed in seeds]]
        for wave in validation_waves()
    }


@cache
def errors_of(reading: str, seed: int, noise: float = 0.0) -> Mapping[str, list[list[float]]]:
    """Return what is measured of every waveform and model: RMSE (cm), greatest error (cm), RMSE
    times the root of the samples, greatest error of the velocity (cm/s), and the peaks of model and
    muscle (cm), all over the last wavelength.
    """
    found: dict[str, list[list[float]]] = {}
    for wave, columns in validation_waves().items():
        y, u = columns["displacement"], columns["input"]
        found[wave] = []
        for fit in models_of(reading, seed, noise).values():
            values = simulate(fit.model, columns)
            errors = motion_errors(y, values, u, STEP)
            rmse, tail = errors.displacement_rmse, slice(-errors.samples, None)
            numbers = (rmse, errors.max_displacement, rmse * errors.samples**0.5)
            peaks = (float(values[tail].max()), float(y[tail].max()))
            found[wave].append([*numbers, errors.max_velocity, *peaks])
    return found


def seeds(_runs: Path) -> Table:
    """Medians of P's four models over the seeds of its swarm, by reading and waveform."""
    rows: list[tuple[Cell, ...]] = []
    for reading in READINGS:
        of_seeds = [errors_of(reading, seed) for seed in MEDIAN_SEEDS]
        for wave in validation_waves():
            for number, model in enumerate(MODELS):
                every = np.array([found[wave][number] for found in of_seeds])
                rows.append((reading, wave, model, *np.median(every, axis=0).tolist()))
    columns = (
        *("reading", "waveform", "model", "RMSE [cm] .4f", "max error [cm] .4f"),
        *("RMSE times root of samples .4f", "max velocity error [cm/s] .4f"),
        *("peak [cm] .4f", "measured peak [cm] .4f"),
    )
    title = f"P's four models on seven waveforms, medians over {len(MEDIAN_SEEDS)} seeds"
    return Table.of("seeds", title, columns, rows)


def parameters(_runs: Path) -> Table:
    """Medians of the parameters of P's four models over the seeds of its swarm, by section."""
    rows: list[tuple[Cell, ...]] = []
    for kind in MODELS:
        found = [models_of("at rest, hard", seed)[kind].model.sections for seed in MEDIAN_SEEDS]
        for of_seeds in zip(*found, strict=True):
            each = [(one.p1, one.p2, float(one.weights[0])) for one in of_seeds]
            steady = [5 * p3 / (1 - p1 - p2) for p1, p2, p3 in each]
            numbers = [*np.median(each, axis=0).tolist(), float(np.median(steady))]
            radius = float(np.median([one.radius for one in of_seeds]))
            rows.append((kind, of_seeds[0].id, *numbers, radius, ITERATIONS))
    columns = (
        *("model", "section", "P1 .4f", "P2 .4f", "P3 .4f", "steady output at 5 V [cm] .3f"),
        *("largest pole .4f", "iterations"),
    )
    title = f"Parameters of P's four models, medians over {len(MEDIAN_SEEDS)} seeds"
    return Table.of("parameters", title, columns, rows)


NOISES = (0.0, 0.5)


def noise(_runs: Path) -> Table:
    """Medians over the seeds of the swarm, by what is added to the recordings that train."""
    rows: list[tuple[Cell, ...]] = []
    for number, model in enumerate(MODELS):
        means = []
        for level in NOISES:
            found = [errors_of("from zero, carried", seed, level) for seed in MEDIAN_SEEDS]
            every = [[each[wave][number][0] for wave in each] for each in found]
            means.append(float(np.mean(np.median(every, axis=0))))
        rows.append((model, *means, means[1] / means[0]))
    columns = ("model", *(f"RMSE, {one:g} cm more noise [cm] .4f" for one in NOISES), "ratio .3f")
    return Table.of("noise", "Training with ten times the noise of the sensor", columns, rows)


def costs(_runs: Path) -> Table:
    """Seconds of the processor that a fit takes, and the mean error on the waveforms: the swarm
    (medians over seeds) and a network of two layers of 32 on the input of the last 32 samples.
    """
    from sklearn.neural_network import MLPRegressor
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    rows: list[tuple[Cell, ...]] = []
    found = [errors_of("from zero, carried", seed) for seed in MEDIAN_SEEDS]
    for number, (model, (pattern, settings)) in enumerate(KINDS.items()):
        made = recipe(solver="swarm", seed=1, **settings, **READINGS["from zero, carried"])
        records = references(pattern, 0.0)
        start = process_time()
        fit = fit_motion(records, made)
        seconds = process_time() - start
        parts = len(fit.searches)
        error = np.mean(np.median([[e[w][number][0] for w in e] for e in found], axis=0))
        rows.append(
            (model, seconds, parts, seconds / parts, seconds / parts / ITERATIONS, float(error))
        )
    records = references("reference_*.csv", 0.0)
    inputs = np.concatenate([delayed(one.columns["input"]) for one in records])
    target = np.concatenate([one.columns["displacement"] for one in records])
    start = process_time()
    network = make_pipeline(
        StandardScaler(),
        MLPRegressor(hidden_layer_sizes=(32, 32), max_iter=2000, tol=1e-6, random_state=1),
    ).fit(inputs, target)
    seconds = process_time() - start
    errors = []
    for columns in validation_waves().values():
        values = network.predict(delayed(columns["input"]))
        errors.append(motion_errors(columns["displacement"], values, columns["input"], STEP)[0])
    rows.append(("network", seconds, 1, seconds, None, float(np.mean(errors))))
    heads = (
        *("model", "seconds .3g", "solutions", "seconds a solution .3g"),
        *("seconds an iteration .3g", "RMSE [cm] .4f"),
    )
    return Table.of(
        "costs", "Computing time of each model on the computer of this page", heads, rows
    )


def delayed(u: Array) -> Array:
    """Return the input of this and of the 32 samples before, (n, 33)."""
    return np.lib.stride_tricks.sliding_window_view(np.concatenate([np.full(32, u[0]), u]), 33)


def printed_errors() -> Mapping[str, list[float]]:
    """Return the printed RMSE of table 3 by waveform, in the order of the models."""
    rows = printed("p_table_3.csv")
    waves = dict.fromkeys(row["experiment"] for row in rows)
    cells = {(row["experiment"], row["model"]): float(row["displacement_rmse"]) for row in rows}
    return {wave: [cells[wave, model] for model in MODELS] for wave in waves}


def agreement(errors: Mapping[str, Array]) -> float:
    """Return Kendall's tau between the ranks of the models, ours (models,) and printed, averaged
    over the waveforms.
    """
    from scipy.stats import kendalltau

    return float(
        np.mean(
            [kendalltau(errors[wave], said).statistic for wave, said in printed_errors().items()]
        )
    )


def readings(_runs: Path) -> Table:
    """Compare both readings with table 3, over seeds."""
    rows: list[tuple[Cell, ...]] = []
    for name in READINGS:
        errors = errors_by_seed(name)
        medians = {wave: np.median(each, axis=0) for wave, each in errors.items()}
        each_seed = [
            agreement({wave: each[k] for wave, each in errors.items()})
            for k in range(len(READING_SEEDS))
        ]
        winners = sum(
            int(np.argmin(medians[wave])) == int(np.argmin(said))
            for wave, said in printed_errors().items()
        )
        first = [
            sum(int(np.argmin(each[k])) == 0 for each in errors.values())
            for k in range(len(READING_SEEDS))
        ]
        words = (f"{winners} of 7", f"{min(first)} to {max(first)} of 7")
        rows.append(
            (name, agreement(medians), float(np.mean(each_seed)), float(np.std(each_seed)), *words)
        )
    columns = (
        *(
            "reading",
            "tau of the medians .2f",
            "tau of a seed, mean .2f",
            "tau of a seed, deviation .2f",
        ),
        *("best model as printed", "linear is best"),
    )
    return Table.of(
        "readings", "Two readings of P's text compared with its table 3, 20 seeds", columns, rows
    )


def sections(runs: Path) -> Table:
    """Errors against the number of sections."""
    scores = campaign("motion_sections", runs)
    rows: list[tuple[Cell, ...]] = []
    for name, own in scores.pooled.items():
        hard = RunFiles(runs / name).fit().body
        assert isinstance(hard, MotionFit)
        simulations = sum(search.evaluations for search in hard.searches)
        seconds = [fit_seconds(runs / folder) for folder in (name, f"{name}.shared_state")]
        errors = (own["mapmore"].rmse, own["shared_state"].rmse)
        rows.append((name, len(hard.model.sections), *errors, simulations, *seconds))
    columns = (
        "run",
        "sections, rise and fall",
        "RMSE, hard [cm] .3f",
        "RMSE, shared state [cm] .3f",
        "simulations",
        "fit, hard [s] .1f",
        "fit, shared state [s] .1f",
    )
    return Table.of("sections", "How many sections?", columns, rows)


def loads(runs: Path) -> Table:
    """Errors under loads that were not seen, with and without the load."""
    files = run("motion/dmsp-20-400-loads", runs)
    trained, new = scores(files, "train"), scores(files)
    rows = ((name, trained[name].rmse, new[name].rmse) for name in new)
    columns = ("model", "RMSE, loads that train [cm] .3f", "loads between [cm] .3f")
    return Table.of("loads", "One sine under five loads, of which two are held out", columns, rows)


def fit_seconds(run: Path) -> float:
    """Return what the fit took on the machine that made this page."""
    return float(
        json.loads((run / "run.json").read_text(encoding="utf-8"))["stages"]["fit"]["seconds"]
    )


if __name__ == "__main__":
    tables = (
        poles,
        solvers,
        slowest,
        waveforms,
        readings,
        seeds,
        parameters,
        noise,
        costs,
        sections,
        loads,
    )
    write_page(
        "motion.md",
        {
            **{table.__name__: table for table in tables},
            "coiled_motion": of_campaign("coiled_motion"),
        },
    )
