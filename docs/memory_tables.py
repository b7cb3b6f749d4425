"""Write the tables of docs/memory.md from runs, which are brought up to date first: `python
docs/memory_tables.py RUNS [TABLE ...]`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median

from error_parts import PARTS, error_parts
from pages import CONFIGS, of_campaign, own, run, scores, write_page

from mapmore_cli.annexes.campaigns.tables import CampaignScores, nrmse_table
from mapmore_cli.domain.fits import MemoryFit
from mapmore_cli.reporting.table import Cell, Table
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.campaign import Variant, load_campaign
from mapmore_cli.study.loader import load

REVERSALS = ("dmsp-20-88-inner-reversals", "peano-inner-reversals")
IDENTIFICATION = ("data_for_testing", "buck", "motor_generator", "motor_generator_published")
PEER = {
    "data_for_testing": (0.0, 0.0),
    "buck": (0.500036, 0.107629),
    "motor_generator": (0.132845, 0.064975),
}
"""RRSE of as many terms of sysidentpy 0.9.0, in free run and one step ahead."""
PUBLISHED = {"motor_generator_published": 177.66}
"""RMSE over the whole record in free run, in a published example of sysidentpy (another algorithm,
seven terms).
"""


def memory_of(files: RunFiles) -> MemoryFit:
    """Return the fit of a run's model with memory."""
    found = files.fit().memory
    assert found is not None
    return found


def uncut(runs: Path) -> Table:
    """Return the records of which a part is left out, beside the same with all of it."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / "coiled.yaml")
    rows = []
    for variant, entry in zip(spec.runs, entries, strict=True):
        (given,) = variant.set.get("data.files", [""])
        if not isinstance(given, dict):
            continue
        # else samples that a competitor does not predict are left out as well
        alone = (
            *entry.overrides,
            "validate.against=[]",
        )
        cut, whole = (
            (*alone, f"name={variant.name}-cut"),
            (*alone, "data.files.0.keep=[]", f"name={variant.name}-uncut"),
        )
        errors = [
            100 * own(run(f"coiled/{entry.config.stem}", runs, *overrides)).nrmse
            for overrides in (cut, whole)
        ]
        ((_, quantity), (condition, limits)) = given["keep"][0].items()
        said = " and ".join(limits) if isinstance(limits, list) else limits
        rows.append((variant.name, f"{quantity} {condition} {said}", *errors))
    columns = ("run", "kept", "cut [%] .3g", "uncut [%] .3g")
    return Table.of(
        "uncut",
        "NRMSE of mapmore with and without the parts that were cut out",
        columns,
        rows,
    )


DRIFT = {"slow": {"of": ["pressure"], "tau": ["10 s", "30 s", "100 s"]}}
EXTRA: Mapping[str, Sequence[object]] = {
    "shipped": (),
    "drift": (
        {
            "products": {
                "of": ["pressure", DRIFT],
                "order": 2,
                "with": ["pressure"],
                "constant": False,
            }
        },
    ),
    "creep": ({"creep": {"of": ["pressure"]}},),
    "free run": ({"slow": {"of": ["pressure"]}},),
}
"""What is added to the dictionary of the coiled muscles: states slower than the cycles, logarithmic
creep, and a slow state whose time constant, like the numbers of the creep, is found together with
all coefficients in free run."""


def coiled(runs: Path, kind: str = "shipped") -> Iterator[tuple[Variant, RunFiles]]:
    """Yield the records of coiled muscles, by themselves, with a dictionary of that kind."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / "coiled.yaml")
    for variant, entry in zip(spec.runs, entries, strict=True):
        shipped = load(entry.config).spec.model_dump(
            mode="json", by_alias=True, exclude_unset=True
        )["dictionary"]
        added = (f"dictionary={json.dumps([*shipped, *EXTRA[kind]])}",) if EXTRA[kind] else ()
        settings = (
            *entry.overrides,
            "validate.against=[]",
            *added,
            f"name={variant.name}-{kind.replace(' ', '-')}",
        )
        yield variant, run(f"coiled/{entry.config.stem}", runs, *settings)


def coiled_models(runs: Path) -> Table:
    """Held-out errors of all records, with states that drift and creep."""
    errors = {
        kind: {str(one.name): 100 * own(files).nrmse for one, files in coiled(runs, kind)}
        for kind in EXTRA
    }
    groups = {str(one.name): str(one.group) for one, _ in coiled(runs)}
    rows: list[tuple[Cell, ...]] = [
        (name, *(errors[kind][name] for kind in EXTRA)) for name in groups
    ]
    for group in dict.fromkeys(groups.values()):
        for word, pooled in (("median", median), ("worst", max)):
            rows.append(
                (
                    f"{group}: {word}",
                    *(
                        pooled([of[name] for name in groups if groups[name] == group])
                        for of in errors.values()
                    ),
                )
            )
    columns = ("run", *(f"{kind} [%] .3g" for kind in EXTRA))
    return Table.of(
        "coiled_models",
        "NRMSE of coiled muscles with slower states, one model for each recording",
        columns,
        rows,
    )


def coiled_parts(runs: Path) -> Table:
    """Return what the held-out errors of the shipped setting consist of, in per cent of the
    range.
    """
    rows: list[tuple[Cell, ...]] = []
    for one, files in coiled(runs):
        score, dataset, said = (
            own(files),
            files.dataset(),
            files.validation().predictions["mapmore"],
        )
        *_, held = error_parts(dataset.curves, said, dataset.target, "pressure", dataset.logs)
        parts = {part: 100 * size * score.nrmse / score.rmse for part, size in held.rms.items()}
        rows.append(
            (
                str(one.name),
                len(held.offsets),
                math.hypot(*parts.values()),
                *parts.values(),
                held.limit,
            )
        )
    columns = ("run", "cycles", *(f"{name} [%] .3g" for name in ("NRMSE", *PARTS)), "limited by")
    most = sum(row[-1] in ("drift", "change") for row in rows)
    told = f"Drift or change is the largest part in {most} of {len(rows)} records."
    return Table.of(
        "coiled_parts", "What the held-out errors of coiled muscles consist of", columns, rows, told
    )


def reversals(runs: Path) -> Table:
    """Inner reversals of both simulated muscles."""
    found = {name: run(f"m1/{name}", runs).validation().scores for name in REVERSALS}
    return nrmse_table(CampaignScores(found, relative_to="static"))


def identification(runs: Path) -> Table:
    """Return the published identification records: free run, one step ahead, and what others
    found.
    """
    rows = []
    for name in IDENTIFICATION:
        files = run(f"identification/{name}", runs)
        held, theirs, published = own(files), PEER.get(name, (None, None)), PUBLISHED.get(name)
        over_all = whole_rmse(files) if published is not None else None
        terms = len(memory_of(files).model.terms)
        rows.append(
            (name, terms, held.rrse, theirs[0], held.rrse_one_step, theirs[1], over_all, published)
        )
    columns = (
        *(
            "record",
            "terms",
            "RRSE, free run .5f",
            "peer's .5f",
            "RRSE, one step .5f",
            "peer's one step .5f",
        ),
        *("RMSE, free run, whole record .5g", "published RMSE .5g"),
    )
    return Table.of("identification", "Identification records", columns, rows)


TANKS = {
    "linear": (
        "dictionary=[{lags: {of: [y, u], steps: [1, 2]}}]",
        *(
            "fit.criterion=one_step",
            "fit.scaling=none",
            "fit.margin=0.15",
            "fit.ridge=0",
        ),
    ),
    "one step ahead": ("fit.criterion=one_step",),
    "coefficients in free run": (),
    "not held at 10 V": ("fit.margin=1",),
}
"""Variations of the study of the tanks: which errors decide, and whether states are held at the
ends of their training range.
"""


def tanks(runs: Path) -> Table:
    """Return the cascaded tanks: what the free run as criterion is worth, on the last quarter of
    the record, which it was not fitted to.
    """
    rows = []
    for number, (name, changes) in enumerate(TANKS.items()):
        named = () if not changes else (f"name=cascaded_tanks_{number}",)
        files = run("identification/cascaded_tanks", runs, *changes, *named)
        memory = memory_of(files)
        assert memory.held_out is not None
        rows.append(
            (name, len(memory.model.terms), float(memory.held_out.min()), own(files, "train").rmse)
        )
    columns = (
        "model",
        "terms",
        "RMSE, last quarter, held out [V] .3f",
        "RMSE, whole record, fitted [V] .3f",
    )
    return Table.of("tanks", "Cascaded tanks in free run", columns, rows)


def tanks_terms(runs: Path) -> Table:
    """Return the model of the cascaded tanks."""
    model = memory_of(run("identification/cascaded_tanks", runs)).model
    rows = zip(model.terms, model.theta.tolist(), model.theta_error.tolist(), strict=True)
    columns = ("term", "coefficient .4g", "standard error .2g")
    return Table.of(
        "tanks_terms", "Cascaded tanks: terms of states that are scaled to [0, 1]", columns, rows
    )


SHORT = ("data.split.validate={last: 0.95}", "name=bouc_wen_short")
"""The Bouc-Wen study trained on the first 2048 samples, which is quick enough for the tests."""


def bouc_wen(runs: Path) -> Table:
    """Return the hysteretic oscillator with and without stops of the output that is fed back;
    trained on much, and on little.
    """
    much, little = (
        scores(run("identification/bouc_wen", runs, *settings)) for settings in ((), SHORT)
    )
    rows = (
        (
            name,
            one.rrse,
            one.rrse_one_step,
            1e5 * one.rmse,
            little[name].rrse if name in little else None,
        )
        for name, one in much.items()
    )
    columns = (
        *("model", "RRSE, free run .4f", "RRSE, one step .4f", "RMSE, free run [1e-5] .3f"),
        "RRSE, free run, trained on 2048 samples .4f",
    )
    return Table.of("bouc_wen", "Bouc-Wen oscillator: held-out samples", columns, rows)


def whole_rmse(files: RunFiles) -> float:
    """RMSE over training and held-out samples together."""
    parts = [own(files, split) for split in ("train", "validate")]
    return math.sqrt(sum(part.n * part.rmse**2 for part in parts) / sum(part.n for part in parts))


if __name__ == "__main__":
    campaigns = {name: of_campaign(name) for name in ("coiled", "coiled_other_load")}
    tables = (
        coiled_models,
        coiled_parts,
        uncut,
        reversals,
        identification,
        tanks,
        tanks_terms,
        bouc_wen,
    )
    write_page("memory.md", campaigns | {table.__name__: table for table in tables})
