"""Write the tables of docs/wrist.md and docs/muscle-like.md from runs, which are brought up to date
first.

`python docs/muscle_tables.py RUNS`. The measured muscles must be there for their tables
(docs/data.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
from pages import printed, r2, rms, run, scores, write_page
from scipy.optimize import brentq, least_squares

from mapmore_cli.domain.arrays import Array, Columns
from mapmore_cli.domain.compared import Compared, Normaliser, SampleBlock
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.literature.linear import half_width
from mapmore_cli.reporting.table import Cell, Table

Predict = Callable[[Mapping[str, float], Columns], Array]

INITIAL = (200, 300, 400, 500, 600)
BAR, GRAVITY = 100.0, 9.81
WRIST = {"diameter": 0.010}
REST_LENGTH = 0.23

# W
# --------------------------------------------------------------------------------------------------


def rebuilt_points() -> tuple[Columns, Array]:
    """W's 91 points, from its eq 12: the strains at 1 to 7 bar under 0 to 30 kg, in kPa and N."""
    a, b, c, d, e, f = (
        float(row["printed"]) for row in printed("w_models.csv") if row["model"] == "sarosi"
    )

    def force(p: float, strain: float) -> float:
        return float((a * p + b) * np.exp(c * strain) + d * p * strain + e * p + f)

    points = [(p, GRAVITY * kg) for p in range(1, 8) for kg in np.arange(0.0, 30.1, 2.5)]
    strains = [
        brentq(lambda x, p=p, w=w: force(p, x) - w, -0.5, 0.5, xtol=1e-14) for p, w in points
    ]
    return {
        "pressure": BAR * np.array([float(p) for p, _ in points]),
        "strain": np.array(strains),
    }, np.array([w for _, w in points])


def printed_parameters(model: str) -> dict[str, float]:
    """W's printed numbers as the parameters of a formula, in kPa, N, m and rad."""
    rows = {
        row["parameter"]: float(row["printed"])
        for row in printed("w_models.csv")
        if row["model"] == model
    }
    area = 250.0 * math.pi * WRIST["diameter"] ** 2
    if model == "chou_hannaford":
        scale = 1e3 / (4 * math.pi * rows["n"] ** 2)
        return {"c1": 3 * REST_LENGTH**2 * scale, "c2": rows["b"] ** 2 * scale}
    if model == "sarosi":
        units = {"a": BAR, "b": 1.0, "c": 1.0, "d": BAR, "e": BAR, "f": 1.0}
        return {f"a{i}": rows[name] / unit for i, (name, unit) in enumerate(units.items(), 1)}
    found = {**rows, "theta": math.radians(rows["theta"])}
    if model == "kerscher":
        return {**found, "a_e": area * rows["a_e"], "b_e": area * rows["b_e"]}
    return {**WRIST, **found}


def rebuilt_table(_runs: Path) -> Table:
    """R of the printed parameters and of converged fits on the rebuilt points."""
    columns, force = rebuilt_points()
    rows: list[tuple[Cell, ...]] = []
    for model in dict.fromkeys(row["model"] for row in printed("w_models.csv")):
        said = next(row for row in printed("w_models.csv") if row["model"] == model)
        formula = literature.get(model).of_muscle(WRIST)
        as_printed = formula.predict(printed_parameters(model), columns)
        fit = formula.fit(columns, force)
        ours = formula.predict(fit.parameters, columns)
        rmse = (round(rms(y - force), 6) for y in (as_printed, ours))
        pearson = float(np.corrcoef(as_printed, force)[0, 1])
        found = (
            correlation(force, as_printed),
            pearson,
            correlation(force, ours),
        )
        rows.append(
            (model, said["equation"], float(said["r"]), *found, *rmse, fit.status.replace("_", " "))
        )
    heads = (
        f"{head} .4f"
        for head in ("printed R", "R of the printed parameters", "Pearson's", "R, converged")
    )
    columns_ = ("model", "eq", *heads, "RMSE, printed [N] .3g", "RMSE, converged [N] .3g", "status")
    title = "W's models on points computed from its equation 12"
    return Table.of("rebuilt", title, columns_, rows, "R is about zero (uncentred), as W's is.")


def correlation(measured: Array, predicted: Array) -> float:
    """W's index, about zero."""
    samples = SampleBlock(measured, measured, *[predicted] * 4)
    return Compared(lambda: [samples], Normaliser("", 1.0)).correlation


def inert_table(_runs: Path) -> Table:
    """Test how W's eq 8 and 9 were fitted: with `exp(-P)` of a pressure in kPa or Pa, a_k has no
    effect and keeps its start, 3.55.
    """
    columns, force = rebuilt_points()
    rows: list[tuple[Cell, ...]] = []
    for model, equation in (("tondu_lopez_corrected_fixed_area", "8"), ("kerscher", "9")):
        said = next(row for row in printed("w_models.csv") if row["model"] == model)
        theirs = {**printed_parameters(model), "a_k": 0.0}
        predict = literature.get(model).of_muscle(WRIST).predict
        as_printed = correlation(force, predict(theirs, columns))
        best = None
        if equation == "8":  # eq 9 with a_k inert has no minimum: its fit runs to a flat braid

            def errors(
                x: Array, predict: Predict = predict, theirs: dict[str, float] = theirs
            ) -> Array:
                return predict({**theirs, "theta": x[0], "b_k": x[1]}, columns) - force

            found = least_squares(errors, [theirs["theta"], theirs["b_k"]], x_scale=[0.1, 1.0])
            best = (
                f"theta {math.degrees(found.x[0]):.2f} deg, b_k {found.x[1]:.3f}, R "
                f"{correlation(force, found.fun + force):.4f}"
            )
        words = ", ".join(
            f"{row['parameter']} {row['printed']}"
            for row in printed("w_models.csv")
            if row["model"] == model
        )
        rows.append(
            (
                equation,
                words,
                float(said["r"]),
                float(said["r2"]),
                math.sqrt(float(said["r2"])),
                as_printed,
                best,
            )
        )
    heads = (
        "eq",
        "printed",
        "printed R .4f",
        "printed R² .4f",
        "its root .4f",
        "R of the printed parameters, a_k inert .4f",
        "least squares, a_k inert",
    )
    return Table.of(
        "inert", "Equations 8 and 9 of W if a_k has no effect, on the computed points", heads, rows
    )


def size_of_eq_3() -> float:
    """Return the factor by which the printed force of eq 3 is best multiplied, by least squares on
    the rebuilt points.
    """
    columns, force = rebuilt_points()
    theirs = literature.get("chou_hannaford").predict(printed_parameters("chou_hannaford"), columns)
    return float(theirs @ force / (theirs @ theirs))


def score_rows(config: str, split: str, title: str, name: str) -> Callable[[Path], Table]:
    """Return what makes the table of a run's scores with the correlation about zero."""

    def table(runs: Path) -> Table:
        found = scores(run(config, runs), split)
        rows = (
            (m, s.n, s.r_uncentred, s.r2, s.rmse, 100 * s.nrmse, s.max_abs_error)
            for m, s in found.items()
        )
        columns = (
            "model",
            "samples",
            "R, uncentred .4f",
            "R² .4f",
            "RMSE [N] .3g",
            "NRMSE [%] .3g",
            "max error [N] .3g",
        )
        return Table.of(name, title, columns, rows)

    return table


WRIST_TABLES: Mapping[str, Callable[[Path], Table]] = {
    "rebuilt": rebuilt_table,
    "inert": inert_table,
    "simulated": score_rows(
        "wrist/wrist-static",
        "train",
        "The simulated table, scored as W does: on the points of the fit",
        "simulated",
    ),
    "held-out": score_rows(
        "wrist/wrist-static-held-out", "validate", "2, 4 and 6 bar held out", "held-out"
    ),
}
"""Every table of docs/wrist.md."""


# H
# --------------------------------------------------------------------------------------------------


def table_1(runs: Path) -> Table:
    """Return printed parameters beside those of the simulated muscles."""
    rows: list[tuple[Cell, ...]] = []
    for said in printed("h_table_1.csv"):
        length = said["muscle"].removesuffix(" cm")
        files = run(f"muscle-like/muscle-like-{length}cm", runs)
        fit, row = files.validation().formulas["muscle_like"], scores(files)["muscle_like"]
        for name, value in fit.parameters.items():
            reach = half_width(fit.errors[name], fit.samples - fit.rank)
            rows.append((f"{said['muscle']}: {name}", float(said[name]), value, reach))
        rows.append(
            (
                f"{said['muscle']}: R²",
                float(said["r2"]) if said["r2"] else "above .98",
                row.r2,
                None,
            )
        )
    columns = ("parameter", "H, table I .6g", "simulated muscle .4g", "± 95 % .2g")
    note = (
        "The simulated muscles are not those of H. Therefore only the signs and the sizes of the "
        "parameters can be compared."
    )
    return Table.of("table-1", "The muscle-like model of three muscles", columns, rows, note)


SPLITS = {
    "25 % at random, as published": (
        "name=muscle-like-16cm.random",
        "data.split={validate: {fraction: 0.25, seed: 1}}",
    ),
    "blocks of 8 s": (),
}


def splits_table(runs: Path) -> Table:
    """Return the same models under H's split and under two that do not leak."""
    config, rows = "muscle-like/muscle-like-16cm", list[tuple[Cell, ...]]()
    models = ("mapmore", "muscle_like", "hill", "polynomial_3")
    for label, overrides in SPLITS.items():
        found = scores(run(config, runs, *overrides))
        rows.append(
            (
                label,
                found["mapmore"].n,
                *(found[m].rmse for m in models),
                *(found[m].r2 for m in models),
            )
        )
    folds = [
        scores(
            run(
                config,
                runs,
                f"name=muscle-like-16cm.without-{p}",
                f"data.split={{validate: {{initial: [{p}]}}}}",
            )
        )
        for p in INITIAL
    ]
    count = sum(fold["mapmore"].n for fold in folds)
    pooled = (
        math.sqrt(sum(fold[m].n * fold[m].rmse ** 2 for fold in folds) / count) for m in models
    )
    rows.append(
        (
            "each initial pressure in turn",
            count,
            *pooled,
            *(min(fold[m].r2 for fold in folds) for m in models),
        )
    )
    columns = (
        "held out",
        "samples",
        *(f"{m}, RMSE [N] .3g" for m in models),
        *(f"{m}, R² .4f" for m in models),
    )
    note = "In the last row, R² is that of the worst fold."
    return Table.of("splits", "Three splits of the 16 cm muscle's record", columns, rows, note)


def muscle_like(study: str, runs: Path) -> Callable[[Columns], Array]:
    """Return H's model as a study of `configs/muscle-like` fitted it: force of a muscle, N,
    `(n,)`.
    """
    fit = run(f"muscle-like/{study}", runs).validation().formulas["muscle_like"]
    return lambda columns: literature.get("muscle_like").predict(fit.parameters, columns)


def joint_forces(runs: Path, experiment: str) -> Iterator[tuple[str, Array, Array, Array]]:
    """Muscle, time (s), measured force and that of its model (N), each (n,): the models were
    identified one by one at closed valves.
    """
    columns = run(f"muscle-like/muscle-like-joint-{experiment}", runs).dataset().curves[0].columns
    for number, muscle, length in ((2, "extensor", "22"), (1, "flexor", "16")):
        inputs = {
            "pressure": columns[f"p{number}"],
            "length": columns[f"l{number}"],
            "velocity": columns[f"v{number}"],
        }
        yield (
            muscle,
            columns["time"],
            columns[muscle],
            muscle_like(f"muscle-like-{length}cm", runs)(inputs),
        )


JOINTS = {
    "closed": "closed",
    "driven": "driven, 50 to 500 kPa",
    "driven-200": "driven, 200 to 500 kPa",
}
"""The studies of the joint, and their names on the page."""


def joint_table(runs: Path) -> Table:
    """Compare each muscle's own force, and their difference, with models that were identified at
    closed valves.
    """
    rows: list[tuple[Cell, ...]] = []
    said = {(row["experiment"], row["muscle"]): row["r2"] for row in printed("h_verification.csv")}
    for experiment, word in JOINTS.items():
        for muscle, _, force, predicted in joint_forces(runs, experiment):
            here = said[experiment.removesuffix("-200"), muscle] or "not printed"
            shown = {"": predicted} | (
                {", never below zero": np.maximum(predicted, 0.0)} if experiment == "driven" else {}
            )
            rows += [
                (f"{word}: {muscle}{how}", here, r2(force, one), rms(one - force))
                for how, one in shown.items()
            ]
        found = scores(run(f"muscle-like/muscle-like-joint-{experiment}", runs))
        words = {
            "mapmore": "difference of both",
            "identified_here": "the same, identified from the first half of this record",
        }
        for model, name in words.items():
            rows.append((f"{word}: {name}", None, found[model].r2, found[model].rmse))
    heads = ("force", "H, R²", "R² .4f", "RMSE [N] .3g")
    return Table.of(
        "joint",
        "Muscle-like models on the joint, identified at closed valves by default",
        heads,
        rows,
    )


def one_run(config: str, name: str, title: str, unit: str) -> Callable[[Path], Table]:
    """Return what makes the table of held-out and training scores of a run."""

    def table(runs: Path) -> Table:
        files = run(f"muscle-like/{config}", runs)
        train = scores(files, "train")
        rows = (
            (m, s.n, s.rmse, 100 * s.nrmse, s.r2, 100 * train[m].nrmse)
            for m, s in scores(files).items()
        )
        columns = (
            "model",
            "samples",
            f"RMSE [{unit}] .3g",
            "NRMSE [%] .3g",
            "R² .4f",
            "training NRMSE [%] .3g",
        )
        return Table.of(name, title, columns, rows)

    return table


CLOSED = "Pressure at closed valves, 300 and 500 kPa held out"
MUSCLE_LIKE_TABLES: Mapping[str, Callable[[Path], Table]] = {
    "table-1": table_1,
    "splits": splits_table,
    "joint": joint_table,
    "closed-valves": one_run("muscle-like-closed-valves", "closed-valves", CLOSED, "kPa"),
    "antagonist": one_run(
        "antagonist-pam", "antagonist", "The measured pair, blocks of 3 s held out", "N"
    ),
}
"""Every table of docs/muscle-like.md."""


if __name__ == "__main__":
    write_page("wrist.md", WRIST_TABLES)
    write_page("muscle-like.md", MUSCLE_LIKE_TABLES)
