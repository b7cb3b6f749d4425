"""W: five static models."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import muscle_tables
from muscle_tables import BAR
from pages import printed, scores

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling import literature
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.storage.artefacts import read_dataset, read_validation
from paper.drawing import Panel, lines
from paper.result import AGREES, Claim, Result, Shown, claimed, claims_table, order, word

NEAR = 0.001
"""How far a parameter may come out from one that the points were made with."""
REBUILT = 0.006
"""How far W's index may be off on points rebuilt from printed parameters of five digits."""


def models(_runs: Path) -> Result:
    """The five models on W's own points, rebuilt from its eq 12."""
    table = muscle_tables.rebuilt_table()
    said, again = (table.headings.index(name) for name in ("printed R", "R of the printed parameters"))
    near = [abs(float(row[said]) - float(row[again])) <= REBUILT for row in table.rows]  # type: ignore[arg-type]
    columns = (*table.columns, Column(f"R within {REBUILT:g}"))
    shown = Table(
        table.name, table.title, columns, tuple((*row, word(fits)) for row, fits in zip(table.rows, near, strict=True)), table.notes
    )
    inert = muscle_tables.inert_table()
    eq_8, eq_9 = inert.rows
    claims = [
        Claim("R of eq 8 is .9267", f"{eq_8[5]:.4f} with a_k inert", abs(float(eq_8[5]) - 0.9267) < NEAR),  # type: ignore[arg-type]
        Claim("R² of eq 9 is .9267, which is R .9627", f"R {eq_9[5]:.4f} with a_k inert", abs(float(eq_9[5]) - 0.9627) < NEAR),  # type: ignore[arg-type]
        Claim(
            "the force of eq 3",
            f"{muscle_tables.size_of_eq_3():.1f} times too small as printed",
            abs(muscle_tables.size_of_eq_3() - 1) < 0.5,
        ),
    ]
    starts, parts = from_starts()
    return Result(
        "w-models",
        "W",
        "section IV, equations 3, 4, 8, 9 and 12",
        "Five static models on the printed muscle",
        (shown, inert, claims_table(claims, "claims"), starts),
        [*(("R", fits) for fits in near), *claimed(claims), *parts],
    )


def from_starts() -> tuple[Table, list[tuple[str, bool]]]:
    """Equation 12 from the printed starting values, on the points that its printed result stands for."""
    columns, force = muscle_tables.rebuilt_points()
    fit = literature.get("sarosi").starting_from("published").fit(columns, force, "levenberg_marquardt")
    said, came = muscle_tables.printed_parameters("sarosi"), fit.parameters
    rows = []
    for row, name in zip(printed("w_starts.csv"), said, strict=True):
        unit = BAR if row["unit"].startswith("N/") else 1.0
        ours, theirs = unit * came[name], unit * said[name]
        rows.append((row["parameter"], f"{float(row['printed']):g} {row['unit']}", theirs, ours, word(abs(ours / theirs - 1) < NEAR)))
    heads = (Column("parameter"), Column("printed start"), Column("printed result", "", ".6g"), Column("ours from that start", "", ".6g"))
    note = "The starting values are for the strain in per cent; the results are for a fraction."
    table = Table("starts", "Equation 12 from its starting values", (*heads, Column("verdict")), tuple(rows), (note,))
    return table, [("a parameter from the starting values", row[-1] == AGREES) for row in rows]


def simulated(runs: Path) -> Result:
    """Figures 8 to 10, on the simulated table."""
    found = scores(runs / "wrist-static", "train")
    said = {row["model"]: float(row["r"]) for row in printed("w_models.csv")}
    rows = tuple((model, said[model], found[model].r_uncentred, found[model].r2, found[model].rmse) for model in said)
    ranks = order({model: -r for model, r in said.items()}, ">"), order({model: -found[model].r_uncentred for model in said}, ">")
    columns = (
        Column("model"),
        Column("R, printed", "", ".4f"),
        Column("R, ours", "", ".4f"),
        Column("R², ours", "", ".4f"),
        Column("RMSE, ours", "N", ".3g"),
    )
    orders = Table(
        "order",
        "From the best R down",
        tuple(map(Column, ("study", "printed", "ours", "order"))),
        (("wrist-static", *ranks, word(ranks[0] == ranks[1])),),
    )
    return Result(
        "w-figures",
        "W",
        "figures 8 to 10",
        "The same models, fitted to a simulated table of the same experiment",
        (Table("r", "Correlation about zero", columns, rows), orders),
        [("order of the models", ranks[0] == ranks[1])],
        tuple(_fits(runs, tuple(said))),
        ("wrist/wrist-static.yaml", "wrist/wrist-static-held-out.yaml"),
    )


def _fits(runs: Path, models: Sequence[str]) -> Iterator[Shown]:
    """Force over contraction at the seven pressures, as W draws it, with each model in turn."""
    dataset, found = read_dataset(runs / "wrist-static" / "ingest.h5"), read_validation(runs / "wrist-static" / "validate.h5")
    for letter, model in zip("abcde", models, strict=True):
        shown: dict[str, tuple[Array, Array]] = {}
        for curve, predicted in zip(dataset.curves, found.predictions[model], strict=True):
            pressure = f"{curve.columns['pressure'].mean() / BAR:.0f} bar"
            shown[f"{pressure}, measured"] = (curve.columns["strain"], curve.columns[dataset.target])
            shown[pressure] = (curve.columns["strain"], predicted)
        svg = lines(f"w-{model}", (Panel("Force (N)", shown),), "Contraction (–)", ordered=True)
        yield Shown(f"figures 8 and 9 ({letter})", f"{model}: dots are the table's, lines the model's, 1 to 7 bar from pale to dark.", svg)
