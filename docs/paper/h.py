"""H: the muscle-like model."""

from __future__ import annotations

from pathlib import Path

import muscle_figures
import muscle_tables
from pages import printed

from mapmore_cli.reporting.table import Cell, Column, Table
from paper.result import Result, Shown, same_size, word

LEAST_R2 = 0.98
"""H section III.A: "above 98%"."""
RECORDS = tuple(f"muscle-like/muscle-like-{length}cm.yaml" for length in muscle_tables.LENGTHS)


def table_1(runs: Path) -> Result:
    """Table I and figures 3 and 4."""
    table = muscle_tables.table_1(runs)
    fits: list[tuple[Cell, ...]] = []
    parts = []
    for row in table.rows:
        name, theirs, mine = str(row[0]), row[1], float(row[2])  # type: ignore[arg-type]
        if name.endswith("R²"):
            parts.append(("R²", mine >= LEAST_R2))
            fits.append((*row, None, word(mine >= LEAST_R2)))
            continue
        ratio = mine / float(theirs)  # type: ignore[arg-type]
        parts += [("sign of a parameter", ratio > 0), ("size of a parameter", same_size(mine, float(theirs)))]  # type: ignore[arg-type]
        fits.append((*row, ratio, word(ratio > 0 and same_size(ratio, 1.0))))
    columns = (*table.columns, Column("ours to printed", "", ".3g"), Column(f"sign and size, or R² of {LEAST_R2:g}"))
    shown = Table(table.name, table.title, columns, tuple(fits), table.notes)
    figures = muscle_figures.drawn(runs, ("identification", "curves"))
    of = {"identification": "figure 3", "curves": "figure 4"}
    captions = {name: (of[name], muscle_figures.CAPTIONS[name]) for name in of}
    return Result(
        "h-table-1",
        "H",
        "table I, figures 3 and 4",
        "The muscle-like model of three muscles",
        (shown,),
        parts,
        tuple(Shown(*captions[name], svg) for name, svg in figures.items()),
        RECORDS,
    )


def joint(runs: Path) -> Result:
    """Figures 5 and 6."""
    table = muscle_tables.joint_table(runs)
    said = {f"{row['experiment']}: {row['muscle']}": row for row in printed("h_verification.csv")}
    rows: list[tuple[Cell, ...]] = []
    parts = []
    for row in table.rows:
        name = str(row[0])
        printed_name = _printed_name(name)
        if printed_name not in said:
            continue
        r2 = said[printed_name]["r2"]
        wanted = float(r2) if r2 else ACCEPTABLE
        good = float(row[2]) >= wanted - 0.01  # type: ignore[arg-type]
        parts.append((f"R² of the {name.replace(': ', ' ')}", good))
        rows.append((name, r2 or "“acceptably resemble”", *row[2:], word(good)))
    columns = (Column("force"), Column("printed R²"), *table.columns[2:], Column("verdict"))
    notes = (
        f"Ours agrees where its R² is not less than the printed one by more than .01; “acceptably” is taken for an R² of {ACCEPTABLE:g}.",
    )
    names = {"joint-closed": "figure 5", "joint-driven": "figure 6"}
    figures = muscle_figures.drawn(runs, tuple(names))
    return Result(
        "h-joint",
        "H",
        "section III.B, figures 5 and 6",
        "Two muscles on a joint, by models that were identified one by one",
        (Table("joint", table.title, columns, tuple(rows), notes),),
        parts,
        tuple(Shown(names[name], muscle_figures.CAPTIONS[name], svg) for name, svg in figures.items()),
        (
            "muscle-like/muscle-like-joint-closed.yaml",
            "muscle-like/muscle-like-joint-driven.yaml",
            "muscle-like/muscle-like-joint-driven-200.yaml",
        ),
    )


def _printed_name(name: str) -> str:
    """Return the experiment and the muscle that a row of ours stands beside."""
    word, _, muscle = name.removesuffix(", never below zero").partition(": ")
    experiments = {ours: key.removesuffix("-200") for key, ours in muscle_tables.JOINTS.items()}
    return f"{experiments[word]}: {muscle}"


ACCEPTABLE = 0.8
"""R² that is taken for H's "acceptably resemble"."""
