"""Write the tables of docs/motion.md: `python docs/motion_tables.py RUNS`. Runs are brought up to date first.

The table of coiled muscles needs the measured recordings (docs/data.md); the others need nothing but the repository.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from pages import CONFIGS, DOCS, campaign, finished, printed, run, scores, write_tables

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.models import CARRIED, HARD, ZERO, Motion, MotionSection
from mapmore_cli.modelling.memory.records import Record
from mapmore_cli.modelling.motion.fitting import continued, fit_motion
from mapmore_cli.modelling.motion.problem import Bounds, MotionRecipe
from mapmore_cli.modelling.motion.simulation import motion_errors, simulate
from mapmore_cli.reporting.campaign import nrmse_table
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.campaign import Entry
from mapmore_cli.storage.artefacts import read_dataset, read_fit, read_validation

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
    "swarm, polished": {"solver": "swarm", "polish": True},
    "swarm_projected": {"solver": "swarm_projected"},
    "swarm_projected, polished": {"solver": "swarm_projected", "polish": True},
    "differential_evolution": {"solver": "differential_evolution"},
    "differential_evolution, 60 generations": {"solver": "differential_evolution", "iterations": 60},
}


def recipe(**settings: Any) -> MotionRecipe:
    """Return the settings of a fit, of the simulated muscle."""
    return MotionRecipe(input="input", output="displacement", step=STEP, **settings)


def published(model: str) -> Motion:
    """One of P's models, used directly."""
    rows = [row for row in printed("p_table_1.csv") if row["model"] == model]
    sections = tuple(
        MotionSection(
            row["printed_section"],
            max(int(row["section"]), 1),
            row["direction"],
            float(row["p1"]),
            float(row["p2"]),
            np.array([float(row["p3"])]),
        )
        for row in rows
    )
    boundaries = BOUNDARIES if len(rows) >= len(BOUNDARIES) else ()
    return Motion("input", "displacement", STEP, HARD, boundaries, rows[0]["direction"] != "all", 0.0, ("input",), sections, (0.0, 5.0))


def poles() -> Table:
    """Poles and gains of the published rows."""
    columns = (
        Column("model"),
        Column("sections"),
        Column("largest pole", "", ".3f"),
        Column("least steady output at 5 V", "cm", ".2f"),
        Column("greatest", "cm", ".2f"),
        Column("greatest jump at a boundary", "cm", ".2f"),
        Column("the same on a slow ramp, hard", "cm", ".2f"),
        Column("shared state", "cm", ".3f"),
    )
    rows = []
    for name in MODELS:
        model = published(name)
        gains = [5 * section.gain for section in model.sections]
        ways = 2 if model.directed else 1
        lines = [model.sections[way::ways] for way in range(ways)]
        steps = [abs(at * (b.gain - a.gain)) for line in lines for at, (a, b) in zip(model.boundaries, pairwise(line), strict=True)]
        ramps = (None, None) if not model.boundaries else (ramp(model), ramp(continued(model)))
        rows.append((name, len(gains), max(s.radius for s in model.sections), min(gains), max(gains), max(steps, default=None), *ramps))
    return Table("poles", "The published parameters in discrete time", columns, tuple(rows))


def ramp(model: Motion) -> float:
    """Largest change from sample to sample while the input rises, and then falls, by 0.05 V/s; without the first second."""
    up = np.arange(0.0, 5.0, 0.05 * STEP)
    runs = [simulate(model, {"input": u}) for u in (up, up[::-1])]
    return max(float(np.abs(np.diff(run))[round(1 / STEP) :].max()) for run in runs)


def solvers() -> Table:
    """Every solver on noisy data of P's linear row, from ten seeds."""
    row = next(row for row in printed("p_table_1.csv") if row["model"] == "linear")
    n = 4000
    u = 2.5 - 2.5 * np.cos(2 * np.pi * 0.25 * STEP * np.arange(n))
    clean = simulate(published("linear"), {"input": u})
    y = clean + NOISE * np.random.default_rng(1).standard_normal(n)
    record = Record({"input": u, "displacement": y}, np.ones(n, dtype=np.bool_))
    found = {name: [fit_motion([record], recipe(seed=seed, **settings)).searches[0] for seed in SEEDS] for name, settings in TRIALS.items()}
    least = found["least_squares"][0].rmse
    columns = (
        Column("solver"),
        Column("least RMSE, of that of least squares", "", ".3f"),
        Column("median", "", ".3f"),
        Column("greatest", "", ".3f"),
        Column("seeds within 1 %"),
        Column("simulations"),
    )
    rows = []
    for name, searches in found.items():
        ratios = [search.rmse / least for search in searches]
        within = f"{sum(ratio <= 1.01 for ratio in ratios)} of {len(ratios)}"
        rows.append((name, min(ratios), median(ratios), max(ratios), within, int(median(s.evaluations for s in searches))))
    assert float(row["p1"]) == published("linear").sections[0].p1
    return Table("solvers", "Solvers on data that the published linear row made, with noise", columns, tuple(rows))


BOUNDS = (0.5, 1.0, 2.0, 4.0, 1000.0)
"""s; the second is a quarter of the wavelength that a section of P is found on, which is the default."""
EVERY = 5
"""One sample in so many of the simulated waveforms, as the study has it."""


def log(path: Path) -> Record:
    """Return a recording of the simulated muscle: input (V) and displacement (cm)."""
    rows = np.loadtxt(path, delimiter=",", skiprows=1)[::EVERY]
    return Record({"input": rows[:, 1], "displacement": rows[:, 3] / 10}, np.ones(len(rows), dtype=np.bool_))


def slowest() -> Table:
    """P's linear and piecewise model by least squares, with the longest time constant that a section may have."""
    folder = DOCS.parent / "datasets" / "waveforms"
    held_out = [log(path) for path in sorted(folder.glob("waveform_*.csv"))]
    rows: list[tuple[Cell, ...]] = []
    for bound in BOUNDS:
        errors = []
        for pattern, settings in (("reference_full.csv", {}), ("reference_section_*.csv", {"sections": BOUNDARIES})):
            made = recipe(slowest=bound, **settings)
            model = fit_motion([log(path) for path in sorted(folder.glob(pattern))], made).model
            wrong = [simulate(model, one.columns) - one.columns["displacement"] for one in held_out]
            errors.append(float(np.sqrt(np.mean(np.concatenate(wrong) ** 2))))
        rows.append((f"{bound:g} s", *errors))
    columns = (Column("slowest"), Column("linear", "cm", ".3f"), Column("piecewise", "cm", ".3f"))
    return Table("slowest", "RMSE over all seven waveforms, by the bound on the time constants", columns, tuple(rows))


def waveforms(runs: Path) -> Table:
    """RMSE over the last wavelength of every waveform, by model, with the greatest error."""
    run = finished(Entry(CONFIGS / "motion" / "dmsp-20-400-waveforms.yaml", ()), runs).run_dir
    dataset, found = read_dataset(run / "ingest.h5"), read_validation(run / "validate.h5").predictions
    rows: list[tuple[Cell, ...]] = []
    for number, curve in enumerate(dataset.curves):
        if not curve.held_out.all():
            continue
        measured, u = curve.columns["displacement"], curve.columns["input"]
        errors = [motion_errors(measured, found[model][number], u, STEP) for model in found]
        rows.append((curve.id.removeprefix("waveform_"), *(error.displacement_rmse for error in errors)))
        rows.append((f"{curve.id.removeprefix('waveform_')}, largest", *(error.max_displacement for error in errors)))
    columns = (Column("waveform"), *(Column(model, "cm", ".2f") for model in found))
    return Table("waveforms", "Errors over one wavelength", columns, tuple(rows))


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
    "piecewise_inflate_deflate": ("reference_section_*.csv", {"sections": BOUNDARIES, "direction": True}),
}
READING_SEEDS = range(1, 21)


@cache
def errors_by_seed(reading: str, seeds: Sequence[int] = READING_SEEDS) -> Mapping[str, Array]:
    """Return the displacement RMSE (cm) of P's four models, found by its swarm, on every waveform, (seeds, models)."""
    folder = DOCS.parent / "datasets" / "waveforms"
    waves = {path.stem.removeprefix("waveform_"): log(path).columns for path in sorted(folder.glob("waveform_*.csv"))}
    found: dict[str, list[list[float]]] = {wave: [] for wave in waves}
    for seed in seeds:
        models = []
        for pattern, settings in KINDS.values():
            made = recipe(solver="swarm", seed=seed, **settings, **READINGS[reading])
            models.append(fit_motion([log(path) for path in sorted(folder.glob(pattern))], made).model)
        for wave, columns in waves.items():
            y, u = columns["displacement"], columns["input"]
            found[wave].append([motion_errors(y, simulate(model, columns), u, STEP).displacement_rmse for model in models])
    return {wave: np.array(errors) for wave, errors in found.items()}


def printed_errors() -> Mapping[str, list[float]]:
    """Return the printed RMSE of table 3 by waveform, in the order of the models."""
    rows = printed("p_table_3.csv")
    waves = dict.fromkeys(row["experiment"] for row in rows)
    cells = {(row["experiment"], row["model"]): float(row["displacement_rmse"]) for row in rows}
    return {wave: [cells[wave, model] for model in MODELS] for wave in waves}


def agreement(errors: Mapping[str, Array]) -> float:
    """Return Kendall's tau between the ranks of the models, ours (models,) and printed, averaged over the waveforms."""
    from scipy.stats import kendalltau

    return float(np.mean([kendalltau(errors[wave], said).statistic for wave, said in printed_errors().items()]))


def readings() -> Table:
    """Compare both readings with table 3, over seeds."""
    rows: list[tuple[Cell, ...]] = []
    for name in READINGS:
        errors = errors_by_seed(name)
        medians = {wave: np.median(each, axis=0) for wave, each in errors.items()}
        each_seed = [agreement({wave: each[k] for wave, each in errors.items()}) for k in range(len(READING_SEEDS))]
        winners = sum(int(np.argmin(medians[wave])) == int(np.argmin(said)) for wave, said in printed_errors().items())
        first = [sum(int(np.argmin(each[k])) == 0 for each in errors.values()) for k in range(len(READING_SEEDS))]
        rows.append(
            (
                name,
                agreement(medians),
                float(np.mean(each_seed)),
                float(np.std(each_seed)),
                f"{winners} of 7",
                f"{min(first)} to {max(first)} of 7",
            )
        )
    columns = (
        Column("reading"),
        Column("tau of the medians", "", ".2f"),
        Column("tau of a seed, mean", "", ".2f"),
        Column("tau of a seed, deviation", "", ".2f"),
        Column("best model as printed"),
        Column("linear is best"),
    )
    return Table("readings", "Two readings of P's text beside its table 3, 20 seeds", columns, tuple(rows))


def sections(runs: Path) -> Table:
    """Errors against the number of sections."""
    scores = campaign("motion_sections", runs)
    rows: list[tuple[Cell, ...]] = []
    for name, own in scores.pooled.items():
        fits = {model: read_fit(runs / folder / "fit.h5").motion for model, folder in (("hard", name), ("shared", f"{name}.shared_state"))}
        hard = fits["hard"]
        assert hard is not None
        simulations = sum(search.evaluations for search in hard.searches)
        seconds = [fit_seconds(runs / folder) for folder in (name, f"{name}.shared_state")]
        errors = (own["mapmore"].rmse, own["shared_state"].rmse)
        rows.append((name, len(hard.model.sections), *errors, simulations, *seconds))
    columns = (
        Column("run"),
        Column("sections, rise and fall"),
        Column("RMSE, hard", "cm", ".3f"),
        Column("RMSE, shared state", "cm", ".3f"),
        Column("simulations"),
        Column("fit, hard", "s", ".1f"),
        Column("fit, shared state", "s", ".1f"),
    )
    return Table("sections", "How many sections?", columns, tuple(rows))


def loads(runs: Path) -> Table:
    """Errors under loads that were not seen, with and without the load."""
    folder = run("motion/dmsp-20-400-loads", runs)
    trained, new = scores(folder, "train"), scores(folder, "validate")
    rows = tuple((name, trained[name].rmse, new[name].rmse) for name in new)
    columns = (Column("model"), Column("RMSE, loads that train", "cm", ".3f"), Column("loads between", "cm", ".3f"))
    return Table("loads", "One sine under five loads, of which two are held out", columns, rows)


def fit_seconds(run: Path) -> float:
    """Return what the fit took on the machine that made this page."""
    return float(json.loads((run / "run.json").read_text(encoding="utf-8"))["stages"]["fit"]["seconds"])


def tables(runs: Path) -> Mapping[str, Callable[[], Table]]:
    """Every table of the page, by its name there."""
    return {
        "poles": poles,
        "solvers": solvers,
        "slowest": slowest,
        "waveforms": lambda: waveforms(runs),
        "readings": readings,
        "sections": lambda: sections(runs),
        "loads": lambda: loads(runs),
        "coiled_motion": lambda: nrmse_table(campaign("coiled_motion", runs)),
    }


if __name__ == "__main__":
    write_tables(DOCS / "motion.md", tables(Path(sys.argv[1])))
