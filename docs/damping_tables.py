"""Write the tables of docs/damping.md from runs, which are brought up to date first: `python
docs/damping_tables.py RUNS`.

Other rigs (the earlier valve, a wider tube) are simulated into folders of their own below RUNS. The
measured coiled muscle must be there for its table (docs/data.md).
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
from pages import CONFIGS, DOCS, campaign, printed, rms, run, scores, write_page

from datasets.rig.simulate import SimulationSpec, simulate
from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.loader import load, load_as

MUSCLES = {"McKibben": "dmsp-20-88", "Peano": "peano"}
FOLDERS = {"dmsp-20-88": "mckibben", "peano": "peano"}
HELD_OUT = {"dmsp-20-88": 250.0, "peano": 350.0}
PAPERS = ("mapmore", "reynolds", "peternel", "none", "sarosi_hysteresis_loss")
"""The models of M2's figures 12 and 13."""

# Scores
# --------------------------------------------------------------------------------------------------

ROWS: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "damping": {
        **{
            name: (name,)
            for name in ("none", "linear_viscous", "pressure_viscous", "reynolds", "cao")
        },
        "tondu_kinetic_friction": ("tondu_kinetic_friction",),
        "peternel, as printed / with absolute powers": ("peternel", "peternel_absolute"),
        "sarosi_hysteresis_loss, with the length / as printed": (
            "sarosi_hysteresis_loss",
            "sarosi_hysteresis_loss_printed",
        ),
        "mapmore: one term for each direction": ("mapmore",),
        "the same, from all training pressures": ("all_pressures",),
        "by direction and pressure": ("by_direction_and_pressure",),
        "by pressure alone": ("by_pressure",),
        "by nothing": ("by_nothing",),
        "by nothing, two terms from all training pressures": ("by_nothing_two_terms",),
        "with lags and operators, likewise": ("with_lags_and_operators",),
        "sarosi + reynolds, each fitted to what it is for": ("sarosi+reynolds",),
    },
    "damping-from-80": {name: (name,) for name in ("none", "reynolds", "peternel", "mapmore")},
    "dynamic": {
        "mapmore: static + damping": ("mapmore",),
        "its static model alone": ("static_alone",),
        "sarosi alone": ("sarosi_alone",),
        "sarosi + reynolds": ("sarosi+reynolds",),
        "mapmore's static model + reynolds": ("mapmore+reynolds",),
    },
    "dynamic-hysteresis": {
        "static + hysteresis + damping": ("mapmore",),
        "static + hysteresis": ("static_and_hysteresis",),
        "static + hysteresis + reynolds": ("mapmore+reynolds",),
        "sarosi + reynolds": ("sarosi+reynolds",),
        "static + damping, as above": ("without_hysteresis",),
    },
}
"""Rows of the tables of scores, and the models that they are about, by study."""


def per_cent(muscle: str, study: str, models: tuple[str, ...], runs: Path) -> str:
    """Return held-out NRMSE in per cent, with M2's in brackets where it prints one."""
    config = f"{muscle}-{study}"
    found = scores(run(f"m2/{config}", runs))
    theirs = {
        row["model"]: row["printed"] for row in printed("m2_results.csv") if row["study"] == config
    }
    return " / ".join(
        f"{100 * found[one].nrmse:.1f}" + (f" ({theirs[one]})" if one in theirs else "")
        for one in models
    )


def of_study(study: str, title: str) -> Callable[[Path], Table]:
    """Return what makes the table of a study of both muscles."""

    def table(runs: Path) -> Table:
        rows = [
            (row, *(per_cent(muscle, study, models, runs) for muscle in MUSCLES.values()))
            for row, models in ROWS[study].items()
        ]
        return Table.of(study, title, ("model", *MUSCLES), rows)

    return table


UNTRIED = {
    "as above": "damping-again",
    "second rates in the dictionary": "damping-second-rates",
    "pressure taken in the muscle": "damping-in-muscle",
    "stretches at held pressure, by pressure": "perturbation-by-pressure",
    "the same, pooled": "perturbation-pooled",
}


def untried(runs: Path) -> Table:
    """Return what M2 names and could not try."""
    found = campaign("m2_untried", runs).pooled
    models = ("mapmore", "none", "reynolds", "peternel")
    rows: list[tuple[Cell, ...]] = [
        (f"{kind}: {words}", *(100 * of[one].nrmse for one in models), of["none"].rmse)
        for kind, muscle in MUSCLES.items()
        for words, of in ((one, found[f"{muscle}-{key}"]) for one, key in UNTRIED.items())
    ]
    heads = ("study", *(f"{model} [%] .1f" for model in models), "none, RMSE [N] .2g")
    return Table.of("untried", "What M2 could not try", heads, rows)


RATES = {
    "static map, a cubic of the pressure": "static_map",
    "one map for rise, one for fall": "rise_and_fall_maps",
    "pressure and its rate, by direction (`mapmore`)": "mapmore",
    "pressure and its rate, both directions together": "rates_without_direction",
}


def rates(runs: Path) -> Table:
    """Return what rates are worth on a measured coiled muscle."""
    files = run("coiled/coiled_steps_rates", runs)
    held, train = scores(files), scores(files, "train")
    rows = [(w, 100 * held[one].nrmse, 100 * train[one].nrmse) for w, one in RATES.items()]
    heads = ("model", "validation [%] .1f", "training [%] .1f")
    return Table.of("rates", "Pressure steps of a coiled muscle", heads, rows)


# Other rigs
# --------------------------------------------------------------------------------------------------

OURS, PRINTED = "as shipped", "printed by M2"
RIGS: Mapping[str, Mapping[str, str]] = {
    "exhaust 2.5 times the supply, as before": {
        "McKibben": "experiment.reservoir.exhaust_conductance=1e-8",
        "Peano": "experiment.reservoir.exhaust_conductance=1e-8",
    },
    "tube of 8 mm for 4.5 mm": {"Peano": "experiment.rig.tube.diameter=0.008"},
}
"""What is set to another value, by name and muscle."""


@cache
def rig_root(name: str, kind: str, runs: Path) -> Path:
    """Return a folder with M2's studies and the step responses of another rig in the place of the
    shipped ones.
    """
    muscle, root = FOLDERS[MUSCLES[kind]], runs / "rigs" / f"{name} {kind}".replace(" ", "-")
    shutil.copytree(CONFIGS / "m2", root / "configs" / "m2", dirs_exist_ok=True)
    data = root / "datasets" / muscle
    shutil.copytree(DOCS.parent / "datasets" / muscle, data, dirs_exist_ok=True)
    spec = load_as(data / "step_responses.yaml", SimulationSpec, (RIGS[name][kind],)).spec
    simulate(spec, data, lambda _what, _done, _total: None, force=True)
    return root


def files_of(name: str, kind: str, study: str, runs: Path) -> RunFiles:
    """Return the results of a study of M2 on the shipped recordings, or on those of another rig."""
    config = f"{MUSCLES[kind]}-{study}"
    if name == OURS:
        return run(f"m2/{config}", runs)
    root = rig_root(name, kind, runs)
    loaded = load(root / "configs" / "m2" / f"{config}.yaml")
    return RunFiles(bring_up_to_date(loaded, root / "runs", "validate").run_dir)


def rigs(runs: Path) -> Table:
    """Return scores and terms on the shipped rig, and where one number of it is another."""
    rows: list[tuple[Cell, ...]] = []
    for kind, muscle in MUSCLES.items():
        theirs = {
            (row["study"], row["model"]): float(row["printed"]) for row in printed("m2_results.csv")
        }
        names = [OURS, *(name for name, of in RIGS.items() if kind in of)]
        for name in names:
            damping = files_of(name, kind, "damping", runs)
            held, dynamic = scores(damping), scores(files_of(name, kind, "dynamic", runs))
            errors = [100 * held[model].nrmse for model in PAPERS]
            errors += [100 * dynamic[model].nrmse for model in ("mapmore", "sarosi+reynolds")]
            share = _greatest(damping, HELD_OUT[muscle])
            pooled = RunFiles(damping.folder.with_name(f"{muscle}-damping.all_pressures"))
            row: tuple[Cell, ...] = (
                *errors,
                share,
                *_terms(damping),
                100 * held["all_pressures"].nrmse,
            )
            rows.append((f"{kind}: {name}", *row, *_terms(pooled)))
        of_damping = [theirs[f"{muscle}-damping", model] for model in PAPERS]
        of_sum = [theirs[f"{muscle}-dynamic", model] for model in ("mapmore", "sarosi+reynolds")]
        terms = _printed_terms(muscle)
        rows.append((f"{kind}: {PRINTED}", *of_damping, *of_sum, None, *terms, None, *terms))
    heads = [f"{model} [%] .1f" for model in PAPERS]
    heads += ["dynamic: mapmore [%] .1f", "dynamic: sarosi+reynolds [%] .1f"]
    heads += ["damping over force .2f", "rise", "fall", "all pressures train [%] .1f"]
    heads += ["rise, all pressures", "fall, all pressures"]
    return Table.of("rigs", "M2's studies with other valves and tubes", ("rig", *heads), rows)


def _greatest(files: RunFiles, level: float) -> float:
    """Return max|F_d| over max|F| of the held-out recording."""
    (curve,) = (one for one in files.dataset().curves if one.level == level)
    damping, force = (np.abs(curve.columns[name]).max() for name in ("damping", "force"))
    return float(damping / force)


def _terms(files: RunFiles) -> tuple[str, str]:
    pieces = files.model().pieces
    assert pieces is not None
    found = {one.id.partition("direction=")[2].partition("/")[0]: one for one in pieces.segments}
    return found["rise"].terms[0], found["fall"].terms[0]


def _printed_terms(muscle: str) -> tuple[str, str]:
    rows = {
        row["direction"]: row["term"]
        for row in printed("m2_table_5.csv")
        if row["study"] == f"{muscle}-damping"
    }
    return rows["rise"], rows["fall"]


# Why
# --------------------------------------------------------------------------------------------------


STEP_AT, STILL = 0.1, 0.09
"""s: when the supply opens, and how long after it the Peano muscle has not moved (section 6.3)."""


def transients(runs: Path) -> Table:
    """Return what each model of damping, and of the dynamic force, makes of the parts of the
    held-out recording: without its plateau, on it, and before the muscle moves.

    The plateau has a swing (standard deviation), its correlation with the measured one, and a mean
    error.
    """
    rows: list[tuple[Cell, ...]] = []
    for kind, muscle in MUSCLES.items():
        for study in ("damping", "dynamic"):
            files = files_of(OURS, kind, study, runs)
            curves, told = files.dataset().curves, files.validation().predictions
            (number,) = (i for i, one in enumerate(curves) if one.level == HELD_OUT[muscle])
            columns, on = curves[number].columns, curves[number].at_rest
            assert on is not None
            measured = columns[files.dataset().target]
            still = (columns["time"] >= STEP_AT) & (columns["time"] < STEP_AT + STILL)
            for model, found in {"measured": [measured] * len(curves), **told}.items():
                values = found[number]
                errors = (rms((values - measured)[part]) for part in (slice(None), ~on, still))
                shares = [100 * one / float(np.abs(measured).max()) for one in errors]
                steady = float(100 * (values - measured)[on].mean() / np.abs(measured).max())
                row = (*shares, float(values[on].std()), _correlation(values[on], measured[on]))
                rows.append((f"{kind} {study}: {model}", *row, steady))
    heads = [f"{one} [%] .1f" for one in ("whole recording", "without the plateau", "still")]
    heads += ["swing on the plateau [N] .2f", "correlation there .2f", "mean error there [%] .1f"]
    return Table.of("transients", "NRMSE by parts of the recording", ("model", *heads), rows)


def _correlation(x: Array, y: Array) -> float:
    return float(np.corrcoef(x, y)[0, 1]) if x.std() and y.std() else float("nan")


NEAR_ZERO, BEFORE_MOTION = 0.005, 0.3
"""Strains near zero; s of a step response in which the Peano muscle pulls and begins to move."""


def slopes(runs: Path) -> Table:
    """Return the slope of the Peano muscle's static force near zero strain, measured and by both
    models; and how far both are off in the first part of the steps, by either pressure.
    """
    static = run("m2/peano-static-from-zero", runs)
    fit, pieces = static.validation().formulas["sarosi"], static.model()
    models: dict[str, Callable[[Columns], Array]] = {
        "mapmore": lambda columns: predict(pieces, columns),
        "sarosi": lambda columns: literature.get("sarosi").predict(fit.parameters, columns),
    }
    rows: list[tuple[Cell, ...]] = []
    for curve in static.dataset().curves:
        near = curve.columns["strain"] <= NEAR_ZERO
        if curve.level not in (80.0, 200.0):
            continue
        columns = {name: x[near] for name, x in curve.columns.items()}
        forces = {"measured": columns[static.dataset().target]} | {
            m: f(columns) for m, f in models.items()
        }
        found = [_slope(columns["strain"], force) for force in forces.values()]
        rows.append((f"slope at {curve.level:g} kPa [N]", *found))
    table = np.genfromtxt(
        DOCS.parent / "datasets" / "peano" / "step_response_350.csv", delimiter=",", names=True
    )
    rise = (table["t"] >= 0.1) & (table["t"] < 0.1 + BEFORE_MOTION)
    for words, column in (("at the sensor", "P"), ("in the muscle", "Pm")):
        columns = {"pressure": table[column][rise], "strain": table["eps"][rise]}
        errors = [rms(force(columns) - table["F"][rise]) for force in models.values()]
        rows.append((f"error of the rise, pressure {words} [N]", None, *errors))
    heads = ("Peano muscle", *(f"{name} .4g" for name in ("measured", *models)))
    return Table.of("slopes", "The Peano muscle's static force near zero strain", heads, rows)


def _slope(x: Array, y: Array) -> float:
    return float(np.polyfit(x, y, 1)[0])


TABLES: Mapping[str, Callable[[Path], Table]] = {
    "damping": of_study("damping", "Damping"),
    "from80": of_study("damping-from-80", "Damping force, with the static study from 80 kPa on"),
    "dynamic": of_study("dynamic", "Dynamic force"),
    "hysteresis": of_study("dynamic-hysteresis", "Dynamic force with hysteresis"),
    "rigs": rigs,
    "transients": transients,
    "slopes": slopes,
    "untried": untried,
    "rates": rates,
}


if __name__ == "__main__":
    write_page("damping.md", TABLES)
