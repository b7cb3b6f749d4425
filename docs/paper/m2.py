"""M2: static, damping and dynamic force."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pages import printed, scores

from mapmore_cli.domain.models import SegmentFunction
from mapmore_cli.modelling.expressions import evaluate, parse
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.storage.artefacts import read_dataset, read_model, read_validation
from paper.drawing import Panel, lines
from paper.result import MUSCLES, Claim, Result, Shown, claimed, claims_table, held_out_panels, printed_beside, word


def static(runs: Path) -> Result:
    """Figures 9 and 10."""
    tables, parts = printed_beside("m2_results.csv", ["9", "10"], runs)
    figures = held_out_panels(runs, "-static", {"dmsp-20-88": "figure 9", "peano": "figure 10"})
    specs = ("m2/dmsp-20-88-static.yaml", "m2/peano-static.yaml")
    return Result("m2-static", "M2", "figures 9 and 10, section 5.1", "Static force", tables, parts, figures, specs)


SEGMENTATIONS = {
    "mapmore": "motion dependent, pressure independent",
    "by_direction_and_pressure": "motion dependent, pressure dependent",
    "by_nothing": "motion independent, pressure independent",
    "by_pressure": "motion independent, pressure dependent",
    "none": "no model",
}
"""The bars of M2's figure 11."""


def segmentation(runs: Path) -> Result:
    """Figure 11, whose bars are not printed as numbers."""
    found = {muscle: scores(runs / f"{muscle}-damping", "validate") for muscle in MUSCLES}
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (words, *(100 * found[muscle][model].nrmse for muscle in MUSCLES)) for model, words in SEGMENTATIONS.items()
    )
    columns = (Column("segments"), *(Column(f"{name}, ours", "%", ".3g") for name in MUSCLES.values()))
    four = [model for model in SEGMENTATIONS if model != "none"]
    claims = []
    for muscle, name in MUSCLES.items():
        errors = {model: 100 * found[muscle][model].nrmse for model in four}
        best = min(errors, key=errors.__getitem__)
        text = f"{name}: motion dependent and pressure independent is the best of the four"
        claims.append(Claim(text, f"{SEGMENTATIONS[best]} is ({errors[best]:.3g} %)", best == "mapmore"))
        fewer, more = errors["mapmore"], errors["by_direction_and_pressure"]
        claims.append(
            Claim(
                f"{name}: pressure dependence on top of motion dependence raises the error",
                f"from {fewer:.3g} to {more:.3g} %",
                more > fewer,
            )
        )
    return Result(
        "m2-segmentation",
        "M2",
        "figure 11, section 5.2",
        "Damping force: segments by motion and by pressure",
        (
            Table("segments", "NRMSE on held-out data (figure 11, whose bars are not printed as numbers)", columns, rows),
            claims_table(claims, "claims"),
        ),
        claimed(claims),
        specs=("m2/dmsp-20-88-damping.yaml", "m2/peano-damping.yaml"),
    )


KPA_S_IN_PA_MS = {"pressure": 1e-3, "pressure_rate": 1.0, "strain": 1.0, "strain_rate": 1e3}
"""What M2's unit (Pa, ms) of a quantity is in kPa and s: 1 Pa/ms is 1 kPa/s, 1/ms is 1000/s."""


def table_5(runs: Path) -> Result:
    """The terms of the damping models."""
    rows: list[tuple[Cell, ...]] = []
    parts = []
    for said in printed("m2_table_5.csv"):
        model = read_model(runs / said["study"] / "model.h5")
        assert model.pieces is not None
        segment = next(one for one in model.pieces.segments if said["direction"] in one.id)
        (term,), value = segment.terms, physical(segment)
        same = term == said["term"]
        parts.append(("term", same))
        rows.append((said["study"], said["direction"], said["term"], float(said["printed"]), term, value, word(same)))
    heads = ("study", "direction", "printed term", "printed", "our term", "ours", "term")
    columns = tuple(Column(head, "", ".3g") for head in heads)
    notes = ("Coefficients are in Pa and ms. The paper prints no units; no other pair gives forces of the right size.",)
    return Result(
        "m2-table-5",
        "M2",
        "table 5",
        "Damping force: the terms that were chosen",
        (Table("table_5", "Terms of mapmore", columns, tuple(rows), notes),),
        parts,
        specs=("m2/dmsp-20-88-damping.yaml", "m2/peano-damping.yaml"),
    )


def damping(runs: Path) -> Result:
    """Figures 12 and 13."""
    tables, parts = printed_beside("m2_results.csv", ["12", "13"], runs)
    figures = _over_time(runs, "damping", {"dmsp-20-88": "figure 12 (a)", "peano": "figure 13 (a)"})
    specs = ("m2/dmsp-20-88-damping.yaml", "m2/peano-damping.yaml")
    return Result("m2-damping", "M2", "figures 12 and 13, section 5.3", "Damping force", tables, parts, figures, specs)


def dynamic(runs: Path) -> Result:
    """Figures 14 and 15."""
    tables, parts = printed_beside("m2_results.csv", ["14"], runs)
    figures = _over_time(runs, "dynamic", {"dmsp-20-88": "figure 15 (a)", "peano": "figure 15 (b)"})
    claims = []
    for muscle, name in MUSCLES.items():
        found = scores(runs / f"{muscle}-dynamic", "validate")
        for dynamic, alone in (("mapmore", "static_alone"), ("sarosi+reynolds", "sarosi_alone")):
            with_it, without = 100 * found[dynamic].nrmse, 100 * found[alone].nrmse
            text = f"{name}, {dynamic}: damping improves on the static model"
            claims.append(Claim(text, f"{with_it:.3g} against {without:.3g} %", with_it < without))
    return Result(
        "m2-dynamic",
        "M2",
        "figures 14 and 15, section 5.4",
        "Static and damping force together",
        (*tables, claims_table(claims, "claims")),
        [*parts, *claimed(claims)],
        figures,
        ("m2/dmsp-20-88-dynamic.yaml", "m2/peano-dynamic.yaml"),
    )


def _over_time(runs: Path, component: str, figures: Mapping[str, str]) -> tuple[Shown, ...]:
    """The held-out recordings with the models that the paper has numbers of, and their errors."""
    return tuple(Shown(figures[muscle], *_recording(runs, f"{muscle}-{component}", name)) for muscle, name in MUSCLES.items())


def _recording(runs: Path, study: str, muscle: str) -> tuple[str, str]:
    """Caption and figure of one of them."""
    dataset, found = read_dataset(runs / study / "ingest.h5"), read_validation(runs / study / "validate.h5")
    number, curve = next((i, curve) for i, curve in enumerate(dataset.curves) if curve.held_out.any())
    time, measured = curve.columns["time"], curve.columns[dataset.target]
    models = [row["model"] for row in printed("m2_results.csv") if row["study"] == study]
    predicted = {model: found.predictions[model][number] for model in models}
    whole = Panel("Force (N)", {"measured": (time, measured), **{model: (time, values) for model, values in predicted.items()}})
    errors = Panel("Error (N)", {model: (time, values - measured) for model, values in predicted.items()})
    caption = f"{muscle}: the recording at {curve.level:g} kPa, which was held out, and the errors below."
    return caption, lines(f"m2-{study}", (whole, errors), "Time (s)")


def physical(segment: SegmentFunction) -> float:
    """The coefficient of a segment's only term in Pa and ms, from scaled ones: `y = slope_y theta prod(slope x)`."""
    slopes = zip(segment.scaling.variables, segment.scaling.slope.tolist(), strict=True)
    units = {name: np.array([slope * KPA_S_IN_PA_MS[name]]) for name, slope in slopes}
    return float(segment.scaling.y_slope * segment.theta[0] * evaluate(parse(segment.terms[0]), units)[0])
