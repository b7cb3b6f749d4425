"""Write the tables of docs/intervals.md: `python docs/interval_tables.py RUNS`.

The measured recordings must be there (docs/data.md). The simulated table takes some minutes, most of them for the fits without one curve.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from pages import CONFIGS, DOCS, write_tables

from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.models import Model
from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.fitting.kinds.choices import model_choices
from mapmore_cli.fitting.left_out import refitted, residuals
from mapmore_cli.modelling.kinds import forecast, outside_range
from mapmore_cli.modelling.validation.intervals import half_widths_of
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.rig.load_cycle import turning_strain
from mapmore_cli.spec.loader import load
from mapmore_cli.spec.simulated_experiments import LoadCycles
from mapmore_cli.spec.simulation import SimulationSpec
from mapmore_cli.storage.artefacts import read_dataset, read_model
from mapmore_cli.study.simulation.rig_parts import KPA, hysteresis_of, load_cycle_of, muscle_of

LEVEL = 0.95
SEEDS = range(100, 120)
CURVES = (3, 4, 5, 7)
NEW, SAMPLES = 8, 60
"""New curves of each seed, and samples of a curve."""

SCATTER, NOISE, REGULATION = 0.1, 0.5, 0.0025
"""Of muscles: standard deviation of the logarithm of their parameters. Of the rig: N, and a fraction of the pressure."""


@dataclass(frozen=True)
class Muscle:
    """A simulated muscle: its static study, the range of pressures (kPa), and what differs from specimen to specimen."""

    config: str
    low: float
    high: float
    differs: tuple[str, ...]


MUSCLES = {
    "mckibben": Muscle("m2/dmsp-20-88-static", 80, 350, ("braid_angle", "wall", "c10", "threshold", "crimp_force", "taper")),
    "peano": Muscle("m2/peano-static", 80, 500, ("end_loss", "stiffness", "bending", "threshold")),
}
MODELS: Mapping[str, tuple[str, ...]] = {
    "pieces (M2)": (),
    "sarosi": ("model={type: literature, name: sarosi}",),
}


@dataclass(frozen=True)
class Coverage:
    """Samples of held-out curves within the training range: how many, how many lie in their interval, its half width, the squared error."""

    samples: int
    inside: int
    half: float
    squares: float


def coverage(model: Model, dataset: Dataset, level: float = LEVEL) -> Coverage:
    """What becomes of the held-out samples of a dataset."""
    found = [_errors(model, curve, dataset.target, level) for curve in dataset.curves]
    errors, half = (np.concatenate([each[i] for each in found]) for i in range(2))
    given = np.isfinite(half)
    errors, half = errors[given], half[given]
    if not len(half):
        return Coverage(0, 0, math.nan, 0.0)
    return Coverage(len(errors), int(np.sum(np.abs(errors) <= half)), float(np.median(half)), float(np.sum(errors**2)))


def _errors(model: Model, curve: Curve, target: str, level: float) -> tuple[Array, Array]:
    said = forecast(model, curve)
    rows: BoolArray = curve.held_out & said.ready & ~outside_range(model, curve.columns)
    errors: Array = np.where(np.isfinite(said.values), curve.columns[target] - said.values, np.inf)
    return errors[rows], half_widths_of(model, curve.columns, level)[rows]


def pooled(found: Sequence[Coverage]) -> tuple[float, float, float, float]:
    """Return the share inside in per cent, the median half width of those that have one, the RMSE, and their ratio."""
    count = sum(one.samples for one in found)
    inside = 100 * sum(one.inside for one in found) / count
    half, rmse = float(np.nanmedian([one.half for one in found])), math.sqrt(sum(one.squares for one in found) / count)
    return inside, half, rmse, half / rmse


# Simulated muscles --------------------------------------------------------------------------------------------------------------------


def specimen(kind: str, curves: int, seed: int) -> Dataset:
    """Static curves of one specimen at `curves` pressures that train and `NEW` random ones between them that are held out."""
    muscle, rng = MUSCLES[kind], np.random.default_rng([seed, curves])
    given: dict[str, Any] = yaml.safe_load((DOCS.parent / "datasets" / kind / "load_cycles.yaml").read_text(encoding="utf-8"))
    for name in muscle.differs:
        given["muscle"][name] *= float(np.exp(SCATTER * rng.standard_normal()))
    spec = SimulationSpec.model_validate(given)
    assert isinstance(spec.experiment, LoadCycles)
    pull, friction, (cycle, _) = muscle_of(spec.muscle), hysteresis_of(spec.hysteresis), load_cycle_of(spec.experiment)
    train, new = np.linspace(muscle.low, muscle.high, curves), rng.uniform(muscle.low, muscle.high, NEW)

    def curve(pressure: float, held_out: bool) -> Curve:
        strain = np.linspace(0.0, turning_strain(pull, friction, cycle, KPA * pressure), SAMPLES)
        actual = KPA * pressure * (1 + REGULATION * rng.standard_normal())
        force = pull.force(actual, strain) + NOISE * rng.standard_normal(SAMPLES)
        columns = {"pressure": np.full(SAMPLES, pressure), "strain": strain, "force": force}
        return Curve(f"pressure={pressure:g}", pressure, columns, np.full(SAMPLES, held_out), (f"{pressure:g}",))

    every = [curve(pressure, pressure in new) for pressure in sorted([*train.tolist(), *new.tolist()])]
    quantities = {name: Quantity(name, unit) for name, unit in (("pressure", "kPa"), ("strain", "1"), ("force", "N"))}
    return Dataset("force", "pressure", quantities, (), tuple(every))


def covered(kind: str, model: str, curves: int, seed: int) -> Coverage:
    """Coverage of one specimen's new curves."""
    choices, dataset = model_choices(load(CONFIGS / f"{MUSCLES[kind].config}.yaml", MODELS[model]).spec), specimen(kind, curves, seed)
    fitted = refitted(choices, dataset)
    left_out = residuals(choices, dataset, {}, lambda _what, _done, _total: None, fitted)
    return coverage(replace(fitted, left_out=left_out), dataset)


def simulated_row(kind: str, model: str, curves: int) -> tuple[Cell, ...]:
    """One row of the simulated table."""
    return (f"{kind}, {model}, {curves} curves", *pooled([covered(kind, model, curves, seed) for seed in SEEDS]))


COLUMNS = (Column("inside", "%", ".1f"), Column("±", "N", ".3g"), Column("RMSE", "N", ".3g"), Column("± over RMSE", "", ".1f"))


def simulated() -> Table:
    """Coverage of new curves of simulated muscles."""
    rows = tuple(simulated_row(kind, model, curves) for kind in MUSCLES for model in MODELS for curves in CURVES)
    title = f"New curves of {len(SEEDS)} specimens of each simulated muscle: samples inside of their 95 % interval"
    return Table("simulated", title, (Column("muscle, model, training curves"), *COLUMNS), rows)


# Measured sets ------------------------------------------------------------------------------------------------------------------------

MEASURED = (
    *(f"festo/festo_10mm_{length}cm_{split}" for length in (10, 20, 30) for split in ("pressure", "repeat", "strain")),
    "pgm/pgm_force",
    "bellows/bellows_raw",
    "bellows/bellows_strain",
    "coiled/coiled_steps",
    "coiled/coiled_loops",
    "muscle-like/antagonist-pam",
)


def measured_row(config: str, runs: Path) -> tuple[Cell, ...]:
    """One row of the measured table: a shipped study as it is, asked for intervals."""
    loaded = load(CONFIGS / f"{config}.yaml", (f"name={Path(config).name}.intervals", "validate.intervals=true"))
    folder = bring_up_to_date(loaded, runs, "fuse").run_dir
    model, dataset = read_model(folder / "model.h5"), read_dataset(folder / "ingest.h5")
    assert model.left_out is not None
    found = coverage(model, dataset)
    return (Path(config).name, f"{model.left_out.curves} {model.left_out.kind}", found.samples, *pooled([found]), model.output.unit)


def measured(runs: Path) -> Table:
    """Coverage of the held-out samples of every measured set."""
    rows = tuple(measured_row(config, runs) for config in MEASURED)
    numbers = [replace(column, unit=column.unit.replace("N", "")) for column in COLUMNS]
    heads = (Column("study"), Column("training data"), Column("held out"), *numbers, Column("unit"))
    return Table("measured", "Held-out samples of the measured sets inside of their 95 % interval", heads, rows)


def tables(runs: Path) -> Mapping[str, Callable[[], Table]]:
    """Every table of the page."""
    return {"simulated": simulated, "measured": lambda: measured(runs)}


if __name__ == "__main__":
    write_tables(DOCS / "intervals.md", tables(Path(sys.argv[1])))
