"""What a comparison of two models of one muscle says in numbers."""

from __future__ import annotations

from collections.abc import Sequence

from mapmore_cli.modelling.comparison import Comparison
from mapmore_cli.reporting.table import Cell, Column, Table

MOST_TERMS = 40


def changes_table(found: Comparison) -> Table:
    """Every curve that both models have: the factor between them, its weight, and the difference."""
    columns = (
        Column("curve"),
        Column("ratio", "", ".4f"),
        Column("weight", "%", ".1f"),
        Column("mean difference", found.unit, ".3g"),
        Column("RMS difference", found.unit, ".3g"),
        Column("largest difference", found.unit, ".3g"),
        Column("at"),
    )
    rows: list[tuple[Cell, ...]] = []
    for curve in found.curves:
        place = ", ".join(f"{name} {value:.4g}" for name, value in curve.place.items())
        rows.append((curve.curve, curve.ratio, 100 * curve.weight, curve.difference, curve.rms, curve.largest, place))
    rows.append(("all", found.ratio, 100.0, *[None] * 4))
    low, high = found.interval
    permuted = "" if found.p_permutation is None else f"; permutation of the curves' signs p = {found.p_permutation:.2g}"
    notes = (
        f"Ratio of all curves: 95 % interval {low:.4f} to {high:.4f} (Student's t, {len(found.curves) - 1} degrees of freedom; the unit is "
        f"the curve), p = {found.p:.2g}{permuted}. Weight: share of the sum of squares of the earlier output.",
    )
    return Table("changes", f"{found.after} against {found.before}", columns, tuple(rows), notes)


def drift_table(names: Sequence[str], results: Sequence[Comparison]) -> Table:
    """Every later model against the first."""
    columns = (Column("model"), Column("ratio", "", ".4f"), Column("from", "", ".4f"), Column("to", "", ".4f"), Column("changed"))
    rows = tuple((name, one.ratio, *one.interval, "yes" if one.changed else "no") for name, one in zip(names[1:], results, strict=True))
    return Table("drift", f"Every model against {names[0]}", columns, rows)


def terms_table(found: Comparison) -> Table:
    """The terms that came, went, or whose coefficient moved by more than twice its standard error."""
    moved = [term for term in found.terms if term.moved]
    unit = found.unit
    columns = (Column("segment"), Column("term"), Column("before", unit), Column("after", unit), Column("standard error", unit, ".2g"))
    rows = tuple((term.segment, term.term, term.before, term.after, term.error) for term in moved[:MOST_TERMS])
    more = (f"{MOST_TERMS} of {len(moved)} are shown; --json has all.",) if len(moved) > MOST_TERMS else ()
    notes = (
        f"{len(moved)} of {len(found.terms)} coefficients moved by more than twice the standard error of the difference. That error takes "
        "samples to be independent, and so is too small. Coefficients also move with the ends of their segment.",
    )
    return Table("moved_terms", "Terms and coefficients that moved", columns, rows, (*notes, *more))
