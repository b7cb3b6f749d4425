"""Write the tables of docs/measured-static.md from runs, which are brought up to date first:
`python docs/measured_tables.py RUNS`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import geometric_mean

import numpy as np
from pages import CONFIGS, campaign, of_campaign, rms, run, scores, write_page

from mapmore_cli.domain.scores import OWN, Score
from mapmore_cli.modelling.kinds import predict
from mapmore_cli.modelling.literature.backbone import pooled
from mapmore_cli.reporting.score_tables import score_table
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.campaign import load_campaign


def auto(runs: Path) -> Table:
    """Return the backbone that `auto` chooses from the training data of each run, and what it comes
    to on the held-out data.
    """
    measured = campaign("measured_static", runs)
    rows: list[tuple[Cell, ...]] = []
    ratios: list[tuple[float, float]] = []
    for entry in load_campaign(CONFIGS / "campaigns" / "measured_static.yaml")[1]:
        name = entry.config.stem
        settings = (
            f"name={name}-auto",
            "model={type: mapmore, backbone: auto}",
            "validate.against=[]",
        )
        files = run(f"{entry.config.parent.name}/{name}", runs, *settings)
        chosen, backbone, beside = scores(files)[OWN], files.fit().backbone, measured.pooled[name]
        ratios.append(
            (
                chosen.rmse / beside["sarosi"].rmse,
                chosen.rmse / min(beside[model].rmse for model in measured.best_of),
            )
        )
        rows.append(
            (name, "none" if backbone is None else backbone.name, 100 * chosen.nrmse, *ratios[-1])
        )
    by_rival = list(zip(*ratios, strict=True))
    rows.append(("geometric mean", None, None, *map(geometric_mean, by_rival)))
    rows.append(("worst", None, None, *map(max, by_rival)))
    columns = (
        "run",
        "chosen",
        "NRMSE [%] .3g",
        "ratio to sarosi .3g",
        "ratio to the best formula .3g",
    )
    return Table.of("auto", "`backbone: auto`, run by run", columns, rows)


PRESSURES = (50, 100, 150, 200, 250)
LEFT_OUT = "data.split={leave_one_level_out: true}"


def pgm(runs: Path) -> Table:
    """Every pressure of the gel muscle left out in turn: NRMSE by pressure, and the mean of the
    inner ones.
    """
    direct = run("pgm/pgm_force", runs, "name=pgm_force-left-out", LEFT_OUT)
    inverted = "validate={as: force, against: [], simple: false}"
    turned = run("pgm/pgm_strain", runs, "name=pgm_strain-left-out", LEFT_OUT, inverted)
    rows = [
        *_by_pressure(turned.validation().scores, "mapmore, strain inverted"),
        *_by_pressure(direct.validation().scores),
    ]
    heads = (
        f"{head} [%] .3g"
        for head in (*(f"{pressure} kPa" for pressure in PRESSURES), "mean", "0 kPa", "300 kPa")
    )
    return Table.of(
        "pgm", "NRMSE at each pressure, which was left out in turn", ("model", *heads), rows
    )


def _by_pressure(scores: Sequence[Score], called: str | None = None) -> Iterator[tuple[Cell, ...]]:
    """Yield a row for every model: NRMSE in per cent at the inner pressures, their mean, and at the
    outermost ones.
    """
    held_out = [score for score in scores if score.split == "validate"]
    for model in dict.fromkeys(score.model for score in held_out):
        errors = {score.curve: 100 * score.nrmse for score in held_out if score.model == model}
        inner = [errors[f"pressure={pressure}"] for pressure in PRESSURES]
        yield (
            called or model,
            *inner,
            sum(inner) / len(inner),
            errors["pressure=0"],
            errors["pressure=300"],
        )


MAPS = {
    "200 and 500 kPa": "{validate: {pressure: {between: [[190, 210], [490, 510]]}}}",
    "strain 0.035 to 0.105": "{validate: {strain: {between: [[0.035, 0.105]]}}}",
}
CUT = "{method: even, count: 2, min_samples: 12}"
SHAPES = {
    "by level": (),
    "one surface": (
        "segment={pressure: none}",
        "dictionary=[{polynomial: {of: [pressure, strain], order: 3}}]",
    ),
    "one surface, cut": (
        "data.levels=null",
        f"segment={{pressure: {CUT}, strain: {CUT}}}",
        "dictionary=[{polynomial: {of: [pressure, strain], order: 3}}]",
    ),
}


def maps(runs: Path) -> Table:
    """Return the maker's map with `backbone: auto`: a function for each pressure, or one surface;
    beside the best formula in hindsight.
    """
    rows: list[tuple[Cell, ...]] = []
    for held_out, split in MAPS.items():
        errors: dict[str, float] = {}
        for shape, settings in SHAPES.items():
            name = f"festo_datasheet-{shape}-{held_out}".replace(" ", "-").replace(",", "")
            against = (
                "validate.against=[sarosi_hinged, sarosi, polynomial_2, polynomial_5, kerscher]"
            )
            overrides = (
                f"name={name}",
                f"data.split={split}",
                "model={type: mapmore, backbone: auto}",
                *settings,
                against,
            )
            found = scores(run("festo/festo_datasheet", runs, *overrides))
            errors |= {
                shape if model == OWN else model: 100 * score.nrmse
                for model, score in found.items()
            }
        published = {
            model: error
            for model, error in errors.items()
            if model not in (*SHAPES, "sarosi_hinged")
        }
        best = min(published, key=published.__getitem__)
        rows.append(
            (
                held_out,
                *(errors[shape] for shape in SHAPES),
                errors["sarosi_hinged"],
                best,
                published[best],
            )
        )
    columns = ("held out", *(f"{shape} [%] .3g" for shape in (*SHAPES, "sarosi_hinged")))
    return Table.of(
        "maps",
        "A map of 58 points",
        (*columns, "best published formula", "its error [%] .3g"),
        rows,
    )


def hold(runs: Path) -> Table:
    """Held-out errors to the letter of M2 eq 9-11 over those with functions held beyond their
    samples: the same fits, fused anew.
    """
    studies = list(campaign("measured_static", runs).pooled)
    groups = {
        "measured, the study's settings": studies,
        "measured, M2's settings": [f"{name}.m2_default" for name in studies],
        "M1's studies": list(campaign("m1", runs).pooled),
    }
    rows: list[tuple[Cell, ...]] = []
    for group, names in groups.items():
        ratios = [
            held_out_error(runs, name, "none") / held_out_error(runs, name, "samples")
            for name in names
        ]
        rows.append((group, len(names), min(ratios), geometric_mean(ratios), max(ratios)))
    columns = (
        "runs",
        "number",
        *(f"{word} .3f" for word in ("least ratio", "geometric mean", "greatest")),
    )
    return Table.of(
        "hold", "Error with `hold: none` divided by the error with `hold: samples`", columns, rows
    )


def held_out_error(runs: Path, name: str, how: str) -> float:
    """NRMSE of a run's model on the held-out samples, in per cent, with its pieces joined in a
    given way.
    """
    model, dataset = RunFiles(runs / name).model(), RunFiles(runs / name.split(".")[0]).dataset()
    assert model.pieces is not None
    joined = replace(model, body=model.pieces.joined(hold=how))
    held_out = pooled([(curve, curve.held_out) for curve in dataset.curves])
    measured = held_out[dataset.target]
    return 100 * rms(predict(joined, held_out) - measured) / float(np.abs(measured).max())


def terms(runs: Path) -> Table:
    """NRMSE of the own model by study (rows) and variant (columns)."""
    by_study: dict[str, dict[str, float]] = {}
    for name, found in campaign("m1_terms", runs).pooled.items():
        study, _, variant = name.rpartition("-")
        by_study.setdefault(study, {})[variant] = 100 * found[OWN].nrmse
    words = {"1": "one term", "2": "two", "3": "three", "order2": "two of 1, x, x²"}
    rows: list[tuple[Cell, ...]] = [
        (study, *(variants[variant] for variant in words)) for study, variants in by_study.items()
    ]
    columns = ("study", *(f"{word} [%] .3g" for word in words.values()))
    return Table.of("terms", "NRMSE of mapmore by number of terms", columns, rows)


FESTO = ("10cm", "20cm", "30cm")
GROUPS = {
    "Festo 10 mm, a strain of four": [f"festo_10mm_{one}_strain" for one in FESTO],
    "Festo 10 mm, bands of pressure": [f"festo_10mm_{one}_pressure" for one in FESTO],
    "Festo 10 mm, third repeat": [f"festo_10mm_{one}_repeat" for one in FESTO],
    "four bellows, three strains of ten": ["bellows_strain"],
    "Festo 20 mm, every third pressure": ["festo_datasheet"],
}
"""The measured cases by what is held out."""


def backbone(runs: Path) -> Table:
    """Return what the pieces add to the backbone, case by case: NRMSE of `mapmore`, of its backbone
    alone, of `sarosi_hinged` alone, and of pieces without a backbone.
    """
    found = campaign("measured_static", runs).pooled
    rows: list[tuple[Cell, ...]] = []
    for group, names in GROUPS.items():
        used = {name: _backbone_of(runs, name) for name in names}
        with_pieces, alone, hinged, bare = (
            100 * geometric_mean(found[name][of[name]].nrmse for name in names)
            for of in (
                dict.fromkeys(names, OWN),
                used,
                dict.fromkeys(names, "sarosi_hinged"),
                dict.fromkeys(names, "bare"),
            )
        )
        words = ", ".join(dict.fromkeys(used.values()))
        rows.append((group, words, with_pieces, alone, with_pieces / alone, hinged, bare))
    heads = ("held out", "backbone", "with pieces [%] .3g", "backbone alone [%] .3g")
    more = ("ratio .2f", "sarosi_hinged alone [%] .3g", "pieces alone [%] .3g")
    return Table.of(
        "backbone", "Errors of the backbone with segments and alone", (*heads, *more), rows
    )


def _backbone_of(runs: Path, name: str) -> str:
    fit = RunFiles(runs / name).fit().backbone
    assert fit is not None
    return fit.name


def held_out(config: str, runs: Path) -> Table:
    """Return the scores of a shipped study on held-out data."""
    found = run(config, runs).validation()
    return replace(
        score_table([score for score in found.scores if score.split == "validate"], found.units),
        notes=(),
    )


if __name__ == "__main__":
    tables = {
        "backbone": backbone,
        "auto": auto,
        "pgm": pgm,
        "maps": maps,
        "hold": hold,
        "m1-terms": terms,
    }
    campaigns = {"measured": of_campaign("measured_static"), "m1": of_campaign("m1")}
    studies = {
        "family": partial(held_out, "festo/festo_10mm_family"),
        "cylinder": partial(held_out, "cylinder/printed_cylinder"),
    }
    write_page("measured-static.md", {**campaigns, **tables, **studies})
