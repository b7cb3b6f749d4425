"""Write the tables of docs/intervals.md: `python docs/interval_tables.py RUNS`.

The measured recordings must be there (docs/data.md). The simulated table takes some minutes, most
of them for the fits without one curve.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from interval_coverage import bent_table, coverage_table, spread_table
from pages import DOCS, rms, run, shipped, write_page
from planning_tables import FESTO, LEVELS, quiet, trained_on

from datasets.rig.load_cycle import LoadCycles, turning_strain
from datasets.rig.simulate import KPA, SimulationSpec
from mapmore_cli.domain.arrays import Array, BoolArray
from mapmore_cli.domain.models import LeftOut, Model
from mapmore_cli.domain.recording import Curve, Dataset, Quantity
from mapmore_cli.fitting.kinds import refit
from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices
from mapmore_cli.fitting.left_out import residuals
from mapmore_cli.modelling.forecast import forecast
from mapmore_cli.modelling.kinds import outside_range
from mapmore_cli.modelling.validation.intervals import (
    ASTRAY,
    FEW,
    NORMAL,
    between_levels,
    half_widths,
    half_widths_of,
)
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles

LEVEL = 0.95
SEEDS = range(100, 120)
CURVES = (3, 4, 5, 7)
NEW, SAMPLES = 8, 60
"""New curves of each seed, and samples of a curve."""

SCATTER, NOISE, REGULATION = 0.1, 0.5, 0.0025
"""Of muscles: standard deviation of the logarithm of their parameters. Of the rig: N, and a
fraction of the pressure.
"""


@dataclass(frozen=True)
class Muscle:
    """A simulated muscle: its static study, the range of pressures (kPa), and what differs from
    specimen to specimen.
    """

    config: str
    low: float
    high: float
    differs: tuple[str, ...]


MUSCLES = {
    "mckibben": Muscle(
        "m2/dmsp-20-88-static",
        80,
        350,
        ("braid_angle", "wall", "c10", "threshold", "crimp_force", "taper"),
    ),
    "peano": Muscle("m2/peano-static", 80, 500, ("end_loss", "stiffness", "bending", "threshold")),
}
MODELS: Mapping[str, tuple[str, ...]] = {
    "pieces (M2)": (),
    "sarosi": ("model={type: literature, name: sarosi}",),
}


@dataclass(frozen=True)
class Coverage:
    """Samples of held-out curves within the training range: how many, how many lie in their
    interval, its half width, the squared error.
    """

    samples: int
    inside: int
    half: float
    squares: float


def coverage(model: Model, dataset: Dataset, level: float = LEVEL) -> Coverage:
    """Return what becomes of the held-out samples of a dataset."""
    found = [_errors(model, curve, dataset.target, level) for curve in dataset.curves]
    errors, half = (np.concatenate([each[i] for each in found]) for i in range(2))
    given = np.isfinite(half)
    errors, half = errors[given], half[given]
    if not len(half):
        return Coverage(0, 0, math.nan, 0.0)
    return Coverage(
        len(errors),
        int(np.sum(np.abs(errors) <= half)),
        float(np.median(half)),
        float(np.sum(errors**2)),
    )


def _errors(model: Model, curve: Curve, target: str, level: float) -> tuple[Array, Array]:
    said = forecast(model, curve)
    rows: BoolArray = curve.held_out & said.ready & ~outside_range(model, curve.columns)
    errors: Array = np.where(np.isfinite(said.values), curve.columns[target] - said.values, np.inf)
    return errors[rows], half_widths_of(model, curve.columns, level)[rows]


def pooled(found: Sequence[Coverage]) -> tuple[float, float, float, float]:
    """Return the share inside in per cent, the median half width of those that have one, the RMSE,
    and their ratio.
    """
    count = sum(one.samples for one in found)
    inside = 100 * sum(one.inside for one in found) / count
    half, rmse = (
        float(np.nanmedian([one.half for one in found])),
        math.sqrt(sum(one.squares for one in found) / count),
    )
    return inside, half, rmse, half / rmse


# Simulated muscles
# --------------------------------------------------------------------------------------------------


def specimen(kind: str, curves: int, seed: int) -> Dataset:
    """Return static curves of one specimen at `curves` pressures that train and `NEW` random ones
    between them that are held out.
    """
    muscle, rng = MUSCLES[kind], np.random.default_rng([seed, curves])
    given: dict[str, Any] = yaml.safe_load(
        (DOCS.parent / "datasets" / kind / "load_cycles.yaml").read_text(encoding="utf-8")
    )
    for name in muscle.differs:
        given["muscle"][name] *= float(np.exp(SCATTER * rng.standard_normal()))
    spec = SimulationSpec.model_validate(given)
    assert isinstance(spec.experiment, LoadCycles)
    pull, friction, cycle = spec.muscle, spec.hysteresis, spec.experiment
    train, new = (
        np.linspace(muscle.low, muscle.high, curves),
        rng.uniform(muscle.low, muscle.high, NEW),
    )

    def curve(pressure: float, held_out: bool) -> Curve:
        strain = np.linspace(0.0, turning_strain(pull, friction, cycle, KPA * pressure), SAMPLES)
        actual = KPA * pressure * (1 + REGULATION * rng.standard_normal())
        force = pull.force(actual, strain) + NOISE * rng.standard_normal(SAMPLES)
        columns = {"pressure": np.full(SAMPLES, pressure), "strain": strain, "force": force}
        return Curve(
            f"pressure={pressure:g}",
            pressure,
            columns,
            np.full(SAMPLES, held_out),
            (f"{pressure:g}",),
        )

    every = [
        curve(pressure, pressure in new) for pressure in sorted([*train.tolist(), *new.tolist()])
    ]
    quantities = {
        name: Quantity(name, unit)
        for name, unit in (("pressure", "kPa"), ("strain", "1"), ("force", "N"))
    }
    return Dataset("force", "pressure", quantities, (), tuple(every))


def made(choices: ModelChoices, dataset: Dataset) -> Model:
    """Return a model of the training curves, with what intervals are made of."""
    fitted = refit(choices, dataset)
    return replace(fitted, left_out=residuals(choices, dataset, {}, quiet, fitted))


@cache
def simulated_model(kind: str, model: str, curves: int, seed: int) -> tuple[Model, Dataset]:
    """One specimen and its model."""
    dataset = specimen(kind, curves, seed)
    return made(model_choices(shipped(MUSCLES[kind].config, *MODELS[model]).spec), dataset), dataset


def simulated_row(kind: str, model: str, curves: int) -> tuple[Cell, ...]:
    """One row of the simulated table."""
    return (
        f"{kind}, {model}, {curves} curves",
        *pooled([coverage(*simulated_model(kind, model, curves, seed)) for seed in SEEDS]),
    )


COLUMNS = ("inside [%] .1f", "± [N] .3g", "RMSE [N] .3g", "± over RMSE .1f")


def simulated(_runs: Path) -> Table:
    """Coverage of new curves of simulated muscles."""
    rows = (
        simulated_row(kind, model, curves)
        for kind in MUSCLES
        for model in MODELS
        for curves in CURVES[1:]  # three curves have no intervals
    )
    title = (
        f"Share of the samples of new curves inside their 95 % interval, for {len(SEEDS)} "
        "specimens of each simulated muscle"
    )
    return Table.of("simulated", title, ("muscle, model, training curves", *COLUMNS), rows)


# Measured sets
# --------------------------------------------------------------------------------------------------

MEASURED = (
    *(
        f"festo/festo_10mm_{length}cm_{split}"
        for length in (10, 20, 30)
        for split in ("pressure", "repeat", "strain")
    ),
    "pgm/pgm_force",
    "bellows/bellows_raw",
    "bellows/bellows_strain",
    "coiled/coiled_steps",
    "coiled/coiled_loops",
    "muscle-like/antagonist-pam",
)


def with_intervals(config: str, runs: Path) -> RunFiles:
    """Return the results of a shipped study as it is, asked for intervals."""
    name = f"name={Path(config).name}.intervals"
    return run(config, runs, name, "validate.intervals=true", until="fuse")


def measured_row(config: str, runs: Path) -> tuple[Cell, ...]:
    """One row of the measured table."""
    files = with_intervals(config, runs)
    model = files.model()
    assert model.left_out is not None
    found = coverage(model, files.dataset())
    return (
        Path(config).name,
        f"{model.left_out.curves} {model.left_out.kind}",
        found.samples,
        *pooled([found]),
        model.output.unit,
    )


def measured(runs: Path) -> Table:
    """Coverage of the held-out samples of every measured set."""
    heads = (
        "study",
        "training data",
        "held out",
        *(column.replace(" [N]", "") for column in COLUMNS),
        "unit",
    )
    rows = (measured_row(config, runs) for config in MEASURED)
    return Table.of(
        "measured",
        "Share of held-out samples of measured data inside their 95 % interval",
        heads,
        rows,
    )


BANDS = ((200, 260), (400, 460))
"""Pressures (kPa) that the studies of bands hold out of every curve."""


def band_rows(cm: int, runs: Path) -> Iterator[tuple[Cell, ...]]:
    """Yield the rows of the muscle of that length."""
    study = f"festo/festo_10mm_{cm}cm"
    held, repeat = (with_intervals(f"{study}_{word}", runs) for word in ("pressure", "repeat"))
    whole = rms(errors_within(repeat, (-math.inf, math.inf))[0])
    for band in BANDS:
        errors, half = errors_within(held, band)
        again, _ = errors_within(repeat, band)
        width = float(np.median(half))
        inside = [100 * float(np.mean(np.abs(one) <= width)) for one in (errors, again)]
        name = f"{cm} cm, {band[0]} to {band[1]} kPa"
        yield name, width, inside[0], rms(errors), inside[1], rms(again), whole


def bands(runs: Path) -> Table:
    """Return for each held-out band of pressure what lies inside, beside a later repetition of the
    same curves, whose model has measured that band.
    """
    rows = [row for cm in (10, 20, 30) for row in band_rows(cm, runs)]
    columns = (
        "muscle, band",
        "± [N] .3g",
        "inside, held out [%] .1f",
        "RMSE, held out [N] .3g",
        "inside the same ±, measured [%] .1f",
        "RMSE, measured [N] .3g",
        "RMSE, whole curves [N] .3g",
    )
    title = "Errors in two bands of pressure that are held out, and if they are measured"
    return Table.of("bands", title, columns, rows)


def errors_within(files: RunFiles, band: tuple[float, float]) -> tuple[Array, Array]:
    """Return the errors of a run's held-out samples in a band of pressure, and their half
    widths.
    """
    dataset, found = files.dataset(), []
    for curve in dataset.curves:
        pressure = curve.columns["pressure"]
        rows = curve.held_out & (band[0] <= pressure) & (pressure <= band[1])
        part = replace(curve, held_out=rows)
        found.append(_errors(files.model(), part, dataset.target, LEVEL))
    errors, half = map(np.concatenate, zip(*found, strict=True))
    return errors, half


# Leave one family out
# --------------------------------------------------------------------------------------------------

STRAINS = {
    f"Festo {cm} cm, strains": (f"festo/festo_10mm_{cm}cm_strain", FESTO[:1]) for cm in (10, 20, 30)
}
SETS = {**LEVELS, **STRAINS}
FAMILY = {"datasheet": "Festo"}
"""Of sets whose first word is none: the datasheet is of the same make."""

SUBSETS, WIDEST = 8, 1.5
"""Choices of the training levels of a set, and their widest gap over that of equal distances, at
most.
"""

HUGE = 1e9
"""With this c_K, 1.96 s_w never counts."""

AIMED = 0.97
"""The quantile that the constants are of: a little more than the interval's, since a new family is
not like the others.
"""


@dataclass(frozen=True)
class Case:
    """A model of few levels of a set, with its errors at the others, as shares of the largest
    force.
    """

    name: str
    family: str
    left_out: LeftOut
    at: Array
    errors: Array

    def inside(self, scale: Mapping[int, float]) -> tuple[float, float]:
        """Return the per cent of the samples inside of their interval by these c_K, and the median
        half width over the RMSE.
        """
        if self.left_out.curves < 7:
            half = between_levels(self.left_out, self.at, LEVEL, scale) / self.left_out.largest
        else:
            half = half_widths(self.left_out, self.at, LEVEL) / self.left_out.largest
        return 100 * float(np.mean(self.errors <= half)), float(np.median(half)) / rms(self.errors)


def case(name: str, model: Model, dataset: Dataset) -> Case:
    """Return the held-out curves of a dataset as a case."""
    assert model.left_out is not None
    assert dataset.level is not None
    first, errors, at = name.split()[0].rstrip(","), [], []
    for curve in dataset.curves:
        said = forecast(model, curve)
        rows = curve.held_out & said.ready & ~outside_range(model, curve.columns)
        errors.append(
            np.abs(curve.columns[dataset.target] - said.values)[rows] / model.left_out.largest
        )
        at.append(curve.columns[dataset.level][rows])
    return Case(
        name, FAMILY.get(first, first), model.left_out, np.concatenate(at), np.concatenate(errors)
    )


@cache
def cases(runs: Path) -> tuple[Case, ...]:
    """Models of 3, 4, 5 and 7 levels of every set: pieces and one formula, by levels whose gaps are
    not too unlike.
    """
    found = [
        case(kind, *simulated_model(kind, model, curves, seed))
        for kind in MUSCLES
        for model in MODELS
        for curves in CURVES
        for seed in SEEDS
    ]
    for name, (config, overrides) in SETS.items():
        dataset = measured_levels(name, runs)
        every = sorted({curve.level for curve in dataset.curves if curve.level is not None})
        kept = tuple(one for one in overrides if one.startswith(("data.", "segment")))
        for chosen in (overrides, (*MODELS["sarosi"], *kept))[: 1 if "bellows" in name else 2]:
            choices = model_choices(shipped(config, *chosen).spec)
            parts = [trained_on(dataset, at) for curves in CURVES for at in subsets(every, curves)]
            found += [case(name, made(choices, part), part) for part in parts]
    return tuple(one for one in found if len(one.errors))


def measured_levels(name: str, runs: Path) -> Dataset:
    """All curves of a measured set."""
    config, overrides = SETS[name]
    called = f"name=levels-{name.replace(', ', '-').replace(' ', '-')}"
    return run(config, runs, called, "data.split={}", *overrides, until="ingest").dataset()


def subsets(every: Sequence[float], count: int) -> list[tuple[float, ...]]:
    """Return some choices of so many levels, the outer ones among them, that leave a level out."""
    equal = WIDEST * (every[-1] - every[0]) / (count - 1) * (1 + 1e-9)
    inner = combinations(every[1:-1], count - 2) if len(every) > count else ()
    found = [
        at for at in ((every[0], *one, every[-1]) for one in inner) if max(np.diff(at)) <= equal
    ]
    if len(found) <= SUBSETS:
        return found
    return [
        found[i] for i in np.random.default_rng(count).choice(len(found), SUBSETS, replace=False)
    ]


def calibrated(known: Sequence[Case]) -> dict[int, float]:
    """Return c_K: the quantile `AIMED` of the errors over the rule's widths; families count alike,
    then sets, models, samples.
    """
    return {
        count: round(_scale([one for one in known if one.left_out.curves == count]), 2)
        for count in FEW
    }


def _scale(known: Sequence[Case]) -> float:
    of_set, of_family = (
        Counter(one.name for one in known),
        Counter(family for _, family in {(one.name, one.family) for one in known}),
    )
    weights = [
        np.full(len(one.at), 1 / len(one.at) / of_set[one.name] / of_family[one.family])
        for one in known
    ]
    ratios = []
    for one in known:
        units = between_levels(one.left_out, one.at, LEVEL, dict.fromkeys(FEW, HUGE)) / (
            HUGE * one.left_out.largest
        )
        ratios.append(
            np.where(
                one.errors * one.left_out.largest <= NORMAL * one.left_out.residual,
                0.0,
                one.errors / units,
            )
        )
    joined, weight = np.concatenate(ratios), np.concatenate(weights)
    order = np.argsort(joined, kind="stable")
    return float(joined[order][np.searchsorted(np.cumsum(weight[order]), AIMED * weight.sum())])


@cache
def scales(runs: Path) -> Mapping[str, Mapping[int, float]]:
    """c_K of all families but one, by that one; the last is of all."""
    known = [
        one for one in cases(runs) if one.left_out.astray <= ASTRAY and one.left_out.curves < 7
    ]
    families = dict.fromkeys(one.family for one in known)
    return {
        **{
            family: calibrated([one for one in known if one.family != family])
            for family in families
        },
        "none": calibrated(known),
    }


def constants(runs: Path) -> Table:
    """Return c_K by the family that was left out, and those of the program."""
    known = {**scales(runs), "in the program": FEW}
    rows: list[tuple[Cell, ...]] = [(family, *found.values()) for family, found in known.items()]
    heads = ("left out", *(f"{count} levels .2f" for count in FEW))
    return Table.of(
        "constants",
        "Constant c for each number of levels, without one family in the calibration",
        heads,
        rows,
    )


def families(runs: Path) -> Table:
    """Coverage of each set by constants of the other families."""
    rows: list[tuple[Cell, ...]] = []
    for name, curves in ((name, curves) for name in (*MUSCLES, *SETS) for curves in CURVES):
        every = [one for one in cases(runs) if (one.name, one.left_out.curves) == (name, curves)]
        given = [one for one in every if one.left_out.astray <= ASTRAY]
        if given:
            inside, width = np.array([one.inside(scales(runs)[one.family]) for one in given]).T
            rows.append(
                (
                    name,
                    curves,
                    len(every),
                    len(every) - len(given),
                    float(inside.mean()),
                    float(np.median(width)),
                )
            )
    heads = ("set", "levels", "models", "refused", COLUMNS[0], COLUMNS[-1])
    return Table.of(
        "families",
        "Levels that were not measured, with constants from the other families",
        heads,
        rows,
    )


if __name__ == "__main__":
    write_page(
        "intervals.md",
        {
            "coverage": lambda _runs: coverage_table(),
            "spread": lambda _runs: spread_table(),
            "bent": lambda _runs: bent_table(),
            "simulated": simulated,
            "measured": measured,
            "bands": bands,
            "families": families,
            "constants": constants,
        },
    )
