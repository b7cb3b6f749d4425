"""M1: static force and hysteresis."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from pages import scores

from mapmore_cli.reporting.table import Column, Table
from paper.result import MUSCLES, Claim, Result, claimed, claims_table, held_out_panels, printed_beside


def static(runs: Path) -> Result:
    """Figures 3 and 4."""
    tables, parts = printed_beside("m1_results.csv", ["4"], runs)
    claims = [*_claims(runs, "static")]
    return Result(
        "m1-static",
        "M1",
        "figures 3 and 4, section IV.B",
        "Static force at a pressure that was left out",
        (*tables, claims_table(claims, "claims")),
        [*parts, *claimed(claims)],
        held_out_panels(runs, "-m1-static", dict.fromkeys(MUSCLES, "figure 3")),
        ("m1/dmsp-20-88-m1-static.yaml", "m1/peano-m1-static.yaml"),
    )


def hysteresis(runs: Path) -> Result:
    """Figures 5 and 6, of which no number is printed."""
    claims = [*_claims(runs, "hysteresis")]
    return Result(
        "m1-hysteresis",
        "M1",
        "figures 5 and 6, section IV.B",
        "Hysteresis at a pressure that was left out",
        (errors(runs), claims_table(claims, "claims")),
        claimed(claims),
        held_out_panels(runs, "-m1-hysteresis", dict.fromkeys(MUSCLES, "figure 5")),
        ("m1/dmsp-20-88-m1-hysteresis.yaml", "m1/peano-m1-hysteresis.yaml"),
    )


def errors(runs: Path) -> Table:
    """RMSE of figure 6, whose bars are not printed as numbers."""
    rows = tuple(
        (f"{muscle}-m1-hysteresis", model, "no number", one.rmse)
        for muscle in MUSCLES
        for model, one in scores(runs / f"{muscle}-m1-hysteresis", "validate").items()
    )
    columns = (Column("study"), Column("model"), Column("printed", "N"), Column("ours", "N", ".4g"))
    return Table("errors", "RMSE on held-out data (figure 6)", columns, rows)


def _claims(runs: Path, component: str) -> Iterator[Claim]:
    held = {muscle: scores(runs / f"{muscle}-m1-{component}", "validate") for muscle in MUSCLES}
    train = {muscle: scores(runs / f"{muscle}-m1-{component}", "train") for muscle in MUSCLES}
    both = {m: ", ".join(f"{model} {held[m][model].rmse:.4g} N" for model in ("mapmore", "sarosi")) for m in MUSCLES}
    found = "; ".join(f"{name}: {both[m]}" for m, name in MUSCLES.items())
    if component == "static":
        below = all(held[m][model].rmse < 20 for m in MUSCLES for model in ("mapmore", "sarosi"))
        yield Claim("mapmore and sarosi are below 20 N", found, below)
    poly = ", ".join(f"{name} {train[m]['polynomial_5'].rmse:.4g} N" for m, name in MUSCLES.items())
    least = all(min(train[m], key=lambda model: train[m][model].rmse) == "polynomial_5" for m in MUSCLES)
    yield Claim(
        "the polynomial has the least training RMSE, under 1 N", poly, least and all(train[m]["polynomial_5"].rmse <= 1 for m in MUSCLES)
    )
    far = all(held[m]["polynomial_5"].rmse > held[m]["mapmore"].rmse for m in MUSCLES)
    ours = ", ".join(f"{name} {held[m]['polynomial_5'].rmse:.4g} against {held[m]['mapmore'].rmse:.4g} N" for m, name in MUSCLES.items())
    yield Claim("and a greater error than mapmore on data that were left out", ours, far)
    smaller = all(held["peano"][model].rmse < held["dmsp-20-88"][model].rmse for model in ("mapmore", "sarosi"))
    yield Claim("RMSE of mapmore and sarosi are less for the Peano muscle", found, smaller)
