"""Write the tables of docs/measured-static.md from runs, which are brought up to date first: `python docs/measured_tables.py RUNS`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import geometric_mean

import numpy as np
from pages import CONFIGS, DOCS, campaign, finished, write_tables

from mapmore_cli.domain.declared import Hold
from mapmore_cli.domain.scores import OWN, Score, deciding
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import pooled
from mapmore_cli.reporting.campaign import CampaignScores, nrmse_table
from mapmore_cli.reporting.score_tables import score_table
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.campaign import Entry, load_campaign
from mapmore_cli.storage.artefacts import read_dataset, read_fit, read_model


def auto(scores: CampaignScores, runs: Path) -> Table:
    """Return the backbone that `auto` chooses from the training data of each run, and what it comes to on the held-out data."""
    entries = load_campaign(CONFIGS / "campaigns" / "measured_static.yaml")[1]
    rows: list[tuple[Cell, ...]] = []
    to_sarosi: list[float] = []
    to_best: list[float] = []
    for entry in entries:
        name = entry.config.stem
        settings = (f"name={name}-auto", "model={type: mapmore, backbone: auto}", "validate.against=[]")
        chosen = deciding(finished(Entry(entry.config, settings), runs).table.scores)[0]
        backbone = read_fit(runs / f"{name}-auto" / "fit.h5").backbone
        run = scores.pooled[name]
        best = min(run[model].rmse for model in scores.best_of)
        to_sarosi.append(chosen.rmse / run["sarosi"].rmse)
        to_best.append(chosen.rmse / best)
        rows.append((name, "none" if backbone is None else backbone.name, 100 * chosen.nrmse, to_sarosi[-1], to_best[-1]))
    means = (math.exp(sum(map(math.log, ratios)) / len(ratios)) for ratios in (to_sarosi, to_best))
    rows += [("geometric mean", None, None, *means), ("worst", None, None, max(to_sarosi), max(to_best))]
    ratios = (Column("ratio to sarosi", "", ".3g"), Column("ratio to the best formula", "", ".3g"))
    columns = (Column("run"), Column("chosen"), Column("NRMSE", "%", ".3g"), *ratios)
    return Table("auto", "`backbone: auto`, run by run", columns, tuple(rows))


PRESSURES = (50, 100, 150, 200, 250)
LEFT_OUT = "data.split={leave_one_level_out: true}"


def pgm(runs: Path) -> Table:
    """Every pressure of the gel muscle left out in turn: NRMSE by pressure, and the mean of the inner ones."""
    direct = finished(Entry(CONFIGS / "pgm" / "pgm_force.yaml", ("name=pgm_force-left-out", LEFT_OUT)), runs).table.scores
    turned = _of_strain(runs, "pgm_strain-left-out", "validate={as: force, against: [], simple: false}")
    rows = [*_by_pressure(turned, "mapmore, strain inverted"), *_by_pressure(direct)]
    return Table("pgm", "Every pressure left out in turn", _pressure_columns("model"), tuple(rows))


def _of_strain(runs: Path, name: str, validate: str) -> tuple[Score, ...]:
    return finished(Entry(CONFIGS / "pgm" / "pgm_strain.yaml", (f"name={name}", LEFT_OUT, validate)), runs).table.scores


def _by_pressure(scores: Sequence[Score], called: str | None = None) -> Iterator[tuple[Cell, ...]]:
    """Yield a row for every model: NRMSE in per cent at the inner pressures, their mean, and at the outermost ones."""
    held_out = [score for score in scores if score.split == "validate"]
    for model in dict.fromkeys(score.model for score in held_out):
        errors = {score.curve: 100 * score.nrmse for score in held_out if score.model == model}
        inner = [errors[f"pressure={pressure}"] for pressure in PRESSURES]
        yield (called or model, *inner, sum(inner) / len(inner), errors["pressure=0"], errors["pressure=300"])


def _pressure_columns(first: str) -> tuple[Column, ...]:
    heads = (*(f"{pressure} kPa" for pressure in PRESSURES), "mean", "0 kPa", "300 kPa")
    return (Column(first), *(Column(head, "%", ".3g") for head in heads))


MAPS = {
    "200 and 500 kPa": "{validate: {pressure: {between: [[190, 210], [490, 510]]}}}",
    "strain 0.035 to 0.105": "{validate: {strain: {between: [[0.035, 0.105]]}}}",
}
CUT = "{method: even, count: 2, min_samples: 12}"
SHAPES = {
    "by level": (),
    "one surface": ("segment={pressure: none}", "dictionary=[{polynomial: {of: [pressure, strain], order: 3}}]"),
    "one surface, cut": (
        "data.levels=null",
        f"segment={{pressure: {CUT}, strain: {CUT}}}",
        "dictionary=[{polynomial: {of: [pressure, strain], order: 3}}]",
    ),
}


def maps(runs: Path) -> Table:
    """Return the maker's map with `backbone: auto`: a function for each pressure, or one surface; beside the best formula in hindsight."""
    rows: list[tuple[Cell, ...]] = []
    for held_out, split in MAPS.items():
        errors: dict[str, float] = {}
        for shape, settings in SHAPES.items():
            name = f"festo_datasheet-{shape}-{held_out}".replace(" ", "-").replace(",", "")
            against = "validate.against=[sarosi_hinged, sarosi, polynomial_2, polynomial_5, kerscher]"
            overrides = (f"name={name}", f"data.split={split}", "model={type: mapmore, backbone: auto}", *settings, against)
            found = deciding(finished(Entry(CONFIGS / "festo" / "festo_datasheet.yaml", overrides), runs).table.scores)
            errors |= {shape if score.model == OWN else score.model: 100 * score.nrmse for score in found}
        published = {model: error for model, error in errors.items() if model not in (*SHAPES, "sarosi_hinged")}
        best = min(published, key=published.__getitem__)
        rows.append((held_out, *(errors[shape] for shape in SHAPES), errors["sarosi_hinged"], best, published[best]))
    columns = (Column("held out"), *(Column(shape, "%", ".3g") for shape in (*SHAPES, "sarosi_hinged")))
    return Table("maps", "A map of 58 points", (*columns, Column("best published formula"), Column("its error", "%", ".3g")), tuple(rows))


def hold(scores: CampaignScores, papers: CampaignScores, runs: Path) -> Table:
    """Held-out errors to the letter of M2 eq 9-11 over those with functions held beyond their samples: the same fits, fused anew."""
    groups = {
        "measured, the study's settings": list(scores.pooled),
        "measured, M2's settings": [f"{run}.m2_default" for run in scores.pooled],
        "M1's studies": list(papers.pooled),
    }
    rows: list[tuple[Cell, ...]] = []
    for group, names in groups.items():
        ratios = [held_out_error(runs, name, "none") / held_out_error(runs, name, "samples") for name in names]
        rows.append((group, len(names), min(ratios), geometric_mean(ratios), max(ratios)))
    columns = (Column("runs"), Column("number"), *(Column(word, "", ".3f") for word in ("least ratio", "geometric mean", "greatest")))
    return Table("hold", "Error to the letter over the error where functions are held", columns, tuple(rows))


def held_out_error(runs: Path, name: str, how: Hold) -> float:
    """NRMSE of a run's model on the held-out samples, in per cent, with its pieces joined in a given way."""
    model, dataset = read_model(runs / name / "model.h5"), read_dataset(runs / name.split(".")[0] / "ingest.h5")
    assert model.pieces is not None
    joined = replace(model, body=replace(model.pieces, fusion=replace(model.pieces.fusion, hold=how)))
    held_out = pooled([(curve, curve.held_out) for curve in dataset.curves])
    measured = held_out[dataset.target]
    error = predict(joined, held_out) - measured
    return 100 * float(np.sqrt(np.mean(error**2)) / np.abs(measured).max())


def terms(scores: CampaignScores) -> Table:
    """NRMSE of the own model by study (rows) and variant (columns)."""
    by_study: dict[str, dict[str, float]] = {}
    for name, run in scores.pooled.items():
        study, _, variant = name.rpartition("-")
        by_study.setdefault(study, {})[variant] = 100 * run[scores.own].nrmse
    words = {"1": "one term", "2": "two", "3": "three", "order2": "two of 1, x, x²"}
    rows: list[tuple[Cell, ...]] = [(study, *(variants[variant] for variant in words)) for study, variants in by_study.items()]
    columns = (Column("study"), *(Column(word, "%", ".3g") for word in words.values()))
    return Table("terms", "NRMSE of mapmore by number of terms", columns, tuple(rows))


def held_out(config: str, runs: Path) -> Table:
    """Return the scores of a shipped study on held-out data."""
    table = finished(Entry(CONFIGS / f"{config}.yaml", ()), runs).table
    return replace(score_table([score for score in table.scores if score.split == "validate"], table.units), notes=())


def tables(runs: Path) -> Mapping[str, Callable[[], Table]]:
    """Every table of the page, by its name there."""
    measured, m1 = campaign("measured_static", runs), campaign("m1", runs)
    return {
        "measured": lambda: nrmse_table(measured),
        "auto": lambda: auto(measured, runs),
        "pgm": lambda: pgm(runs),
        "maps": lambda: maps(runs),
        "hold": lambda: hold(measured, m1, runs),
        "family": lambda: held_out("festo/festo_10mm_family", runs),
        "cylinder": lambda: held_out("cylinder/printed_cylinder", runs),
        "m1": lambda: nrmse_table(m1),
        "m1-terms": lambda: terms(campaign("m1_terms", runs)),
    }


if __name__ == "__main__":
    write_tables(DOCS / "measured-static.md", tables(Path(sys.argv[1])))
