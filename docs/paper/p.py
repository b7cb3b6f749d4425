"""P: models of motion found by a swarm."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np
from motion_tables import MODELS
from motion_tables import published as published_motion
from pages import printed

from mapmore_cli.modelling.motion.measures import last_wavelength, motion_errors
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.storage.artefacts import read_dataset, read_validation
from paper.drawing import Panel, lines
from paper.result import Claim, Result, Shown, claimed, claims_table, order, same_size, word

GRAVITY = 9.81
"""m/s2."""
VOLTS = 5.0
"""The greatest input."""
WAVEFORMS = "dmsp-20-400-waveforms"
STROKE = "approximately 10 cm total displacement"
"""P section 3.1, over the full stroke."""


def table_1(runs: Path) -> Result:
    """The parameters, used as printed, and those that the published swarm finds for the simulated muscle."""
    motions = read_validation(runs / WAVEFORMS / "validate.h5").motions
    rows: list[tuple[Cell, ...]] = []
    parts: list[tuple[str, bool]] = []
    for model in MODELS:
        said, ours = published_motion(model).sections, motions[model].model.sections
        for theirs, mine in zip(said, ours, strict=True):
            printed_row = (theirs.p1, theirs.p2, theirs.p3, theirs.radius, VOLTS * theirs.gain)
            fits = same_size(VOLTS * mine.gain, VOLTS * theirs.gain)
            parts.append(("size of the steady displacement", fits))
            rows.append((model, theirs.id, *printed_row, mine.p1, mine.p2, mine.p3, VOLTS * mine.gain, word(fits)))
    ours_named = (
        *(Column(f"{name}, ours", "", ".4g") for name in ("P1", "P2", "P3")),
        Column("ours at 5 V", "cm", ".1f"),
        Column("size at 5 V"),
    )
    columns = (
        Column("model"),
        Column("section"),
        *(Column(name, "", ".4g") for name in ("P1", "P2", "P3")),
        Column("largest pole", "", ".3f"),
        Column("steady at 5 V", "cm", ".1f"),
        *ours_named,
    )
    linear = published_motion("linear").sections[0]
    every = [section for model in MODELS for section in published_motion(model).sections]
    stable = sum(section.radius < 1 for section in every)
    claims = [
        Claim(
            f"the full stroke is {STROKE}",
            f"the printed linear row comes to {VOLTS * linear.gain:.2f} cm at 5 V",
            abs(VOLTS * linear.gain - 10) < 1,
        ),
        Claim("the models run", f"{stable} of {len(every)} printed rows are stable in discrete time", stable == len(every)),
    ]
    notes = (
        "Ours are those of the published swarm on a simulated muscle of the same type. Not P1 to P3 are compared, since rows that fit "
        "a record equally well may differ in each of them, but what they come to at 5 V.",
    )
    return Result(
        "p-table-1",
        "P",
        "table 1",
        "Parameters of the four models",
        (
            Table("table_1", "Printed parameters, and the published swarm on the simulated muscle", columns, tuple(rows), notes),
            claims_table(claims, "claims"),
        ),
        [*parts, *claimed(claims)],
        specs=("motion/dmsp-20-400-waveforms.yaml",),
    )


def table_2(runs: Path) -> Result:
    """The waveforms, which are an input: ours as they were logged."""
    curves = {curve.id.removeprefix("waveform_"): curve.columns for curve in read_dataset(runs / WAVEFORMS / "ingest.h5").curves}
    rows: list[tuple[Cell, ...]] = []
    parts: list[tuple[str, bool]] = []
    for said in printed("p_table_2.csv"):
        columns = curves[said["experiment"]]
        time, u = columns["time"], columns["input"]
        wave = u[-last_wavelength(u) :]
        seconds = len(wave) * float(time[1] - time[0])
        load = abs(round(float(columns["load"].mean()) / GRAVITY, 2))  # the sensor has noise
        ours = (np.ptp(wave), wave.min(), 1 / seconds, (time[-1] - time[0]) // seconds, load)
        theirs = [float(said[name]) for name in ("amplitude_V", "offset_V", "frequency_Hz", "wavelengths", "load_kg")]
        same = bool(np.allclose(ours, theirs, rtol=0.01, atol=0.01))
        parts.append(("waveform", same))
        pairs = [float(cell) for pair in zip(theirs, ours, strict=True) for cell in pair]
        rows.append((said["experiment"], *pairs, word(same)))
    heads = (("amplitude", "V"), ("offset", "V"), ("frequency", "Hz"), ("wavelengths", ""), ("load", "kg"))
    columns_shown = [Column(name if whose == "printed" else "ours", unit, ".3g") for name, unit in heads for whose in ("printed", "ours")]
    note = (
        "The amplitude is peak to peak, the offset the lowest value. The printed column of waveform types is shifted against the names, "
        "which count. Ours agree within 1 %."
    )
    table = Table(
        "table_2", "The seven waveforms, printed and ours", (Column("waveform"), *columns_shown, Column("verdict")), tuple(rows), (note,)
    )
    specs = ("motion/dmsp-20-400-waveforms.yaml",)
    return Result("p-table-2", "P", "table 2", "Waveforms of the validation", (table,), parts, specs=specs)


def table_3(runs: Path) -> Result:
    """Errors over one wavelength of the seven waveforms."""
    ours = {(str(row[0]), str(row[1])): row for row in waveforms(runs)}
    rows: list[tuple[Cell, ...]] = []
    orders: list[tuple[Cell, ...]] = []
    parts: list[tuple[str, bool]] = []
    for experiment, group in groupby(printed("p_table_3.csv"), key=lambda row: row["experiment"]):
        said = list(group)
        mine = {row["model"]: ours[experiment, row["model"]] for row in said}
        for row in said:
            rmse, speed, largest, fastest = (float(cell) for cell in mine[row["model"]][2:6])  # type: ignore[arg-type]
            theirs = [float(row[name]) for name in ("displacement_rmse", "max_displacement_error", "velocity_rmse", "max_velocity_error")]
            fits = same_size(largest, theirs[1])
            parts.append(("size of the largest error", fits))
            rows.append((experiment, row["model"], theirs[0], rmse, theirs[1], largest, word(fits), theirs[2], speed, theirs[3], fastest))
        ranks = [order({row["model"]: float(row["displacement_rmse"]) for row in said}), order({m: float(r[2]) for m, r in mine.items()})]  # type: ignore[arg-type]
        parts.append(("order of the models", ranks[0] == ranks[1]))
        orders.append((experiment, *ranks, word(ranks[0] == ranks[1])))
    pairs = (("RMSE", ""), ("largest error", "cm"), ("velocity RMSE", "cm/s"), ("largest velocity error", "cm/s"))
    heads = [
        Column(f"{name}, {whose}", unit if whose == "ours" or unit else "", ".3g") for name, unit in pairs for whose in ("printed", "ours")
    ]
    heads[1] = Column("RMSE, ours", "cm", ".3g")
    columns = (Column("waveform"), Column("model"), *heads[:4], Column("size"), *heads[4:])
    notes = (
        "The printed RMSE are not in cm: they exceed the largest errors beside them. They are compared by their order alone.",
        "The printed errors of velocity can hardly be in cm/s, and are not compared: an error of 2 cm at 0.25 Hz changes by 3 cm/s.",
    )
    return Result(
        "p-table-3",
        "P",
        "table 3, figures 4 to 11",
        "Errors over one wavelength of seven waveforms",
        (
            Table("table_3", "Errors over one wavelength", columns, tuple(rows), notes),
            Table("order", "From the least RMSE up", tuple(map(Column, ("waveform", "printed", "ours", "order"))), tuple(orders)),
        ),
        parts,
        tuple(_figures(runs)),
        ("motion/dmsp-20-400-waveforms.yaml",),
    )


def waveforms(runs: Path) -> tuple[tuple[Cell, ...], ...]:
    """The rows of the report's table of waveforms: waveform, model, RMSE, velocity RMSE, greatest error, greatest velocity error, ..."""
    dataset, found = read_dataset(runs / WAVEFORMS / "ingest.h5"), read_validation(runs / WAVEFORMS / "validate.h5")
    step = next(iter(found.motions.values())).model.step
    rows: list[tuple[Cell, ...]] = []
    for number, curve in enumerate(dataset.curves):
        if curve.held_out.all():
            u, measured = curve.columns["input"], curve.columns[dataset.target]
            for model, predicted in found.predictions.items():
                e = motion_errors(measured, predicted[number], u, step)
                name = curve.id.removeprefix("waveform_")
                rows.append((name, model, e.displacement_rmse, e.velocity_rmse, e.max_displacement, e.max_velocity))
    return tuple(rows)


FIGURES = {
    "full_stroke": "figures 4 and 5",
    "lower_stroke": "figure 6",
    "upper_stroke": "figure 7",
    "triangle": "figure 8",
    "square": "figure 9",
    "rapid": "figure 10",
    "weighted": "figure 11",
}


def _figures(runs: Path) -> Iterator[Shown]:
    dataset, found = read_dataset(runs / WAVEFORMS / "ingest.h5"), read_validation(runs / WAVEFORMS / "validate.h5")
    number = {curve.id.removeprefix("waveform_"): place for place, curve in enumerate(dataset.curves)}
    for name, of in FIGURES.items():
        columns = dataset.curves[number[name]].columns
        time, measured = columns["time"], columns[dataset.target]
        predicted = {model: found.predictions[model][number[name]] for model in MODELS}
        errors = Panel("Error (cm)", {model: (time, values - measured) for model, values in predicted.items()})
        whole = Panel("Displacement (cm)", {"measured": (time, measured), **{model: (time, values) for model, values in predicted.items()}})
        panels = (whole, errors) if name == "full_stroke" else (errors,)
        what = "displacement, and the errors of P's four models" if len(panels) > 1 else "errors of P's four models"
        yield Shown(of, f"{name.replace('_', ' ').capitalize()}: {what}, found by its swarm.", lines(f"p-{name}", panels, "Time (s)"))
