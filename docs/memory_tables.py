"""Write the tables of docs/memory.md from runs, which are brought up to date first: `python docs/memory_tables.py RUNS [TABLE ...]`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median

from pages import CONFIGS, DOCS, campaign, finished, write_tables

from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.validation.repeatability import PARTS, error_parts
from mapmore_cli.reporting.campaign import CampaignScores, nrmse_table
from mapmore_cli.reporting.table import Cell, Column, Table
from mapmore_cli.spec.campaign import Entry, Variant, load_campaign
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.artefacts import read_fit
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.campaigns.batch import Finished

REVERSALS = ("dmsp-20-88-inner-reversals", "peano-inner-reversals")
IDENTIFICATION = ("data_for_testing", "buck", "motor_generator", "motor_generator_published")
PEER = {"data_for_testing": (0.0, 0.0), "buck": (0.500036, 0.107629), "motor_generator": (0.132845, 0.064975)}
"""RRSE of as many terms of sysidentpy 0.9.0, in free run and one step ahead."""
PUBLISHED = {"motor_generator_published": 177.66}
"""RMSE over the whole record in free run, in a published example of sysidentpy (another algorithm, seven terms)."""


def study(folder: str, name: str, runs: Path) -> Finished:
    """Return a shipped study, brought up to date."""
    return finished(Entry(CONFIGS / folder / f"{name}.yaml", ()), runs)


def own(run: Finished, split: str = "validate") -> Score:
    """Return the pooled scores of the run's own model."""
    return next(score for score in run.table.scores if (score.model, score.split, score.curve) == ("mapmore", split, "all"))


def uncut(runs: Path) -> Table:
    """Return the records of which a part is left out, beside the same with all of it."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / "coiled.yaml")
    rows = []
    for variant, entry in zip(spec.runs, entries, strict=True):
        (given,) = variant.set.get("data.files", [""])
        if not isinstance(given, dict):
            continue
        alone = (*entry.overrides, "validate.against=[]")  # else samples that a competitor does not predict are left out as well
        cut, whole = (*alone, f"name={variant.name}-cut"), (*alone, "data.files.0.keep=[]", f"name={variant.name}-uncut")
        errors = [100 * own(finished(Entry(entry.config, overrides), runs)).nrmse for overrides in (cut, whole)]
        ((_, quantity), (condition, limits)) = given["keep"][0].items()
        said = " and ".join(limits) if isinstance(limits, list) else limits
        rows.append((variant.name, f"{quantity} {condition} {said}", *errors))
    columns = (Column("run"), Column("kept"), Column("cut", "%", ".3g"), Column("uncut", "%", ".3g"))
    return Table("uncut", "NRMSE of mapmore with and without what was not measured soundly", columns, tuple(rows))


EXTRA: Mapping[str, Sequence[object]] = {
    "shipped": (),
    "drift": (
        {
            "products": {
                "of": ["pressure", {"slow": {"of": ["pressure"], "tau": ["10 s", "30 s", "100 s"]}}],
                "order": 2,
                "with": ["pressure"],
                "constant": False,
            }
        },
    ),
    "creep": ({"creep": {"of": ["pressure"]}},),
    "free run": ({"slow": {"of": ["pressure"]}},),
}
"""What is added to the dictionary of the coiled muscles: states slower than the cycles, logarithmic creep, and a slow state whose time
constant, like the numbers of the creep, is found together with all coefficients in free run."""


def coiled(runs: Path, group: str = "", kind: str = "shipped") -> Iterator[tuple[Variant, Finished]]:
    """Yield the records of coiled muscles, by themselves, with a dictionary of that kind."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / "coiled.yaml")
    for variant, entry in zip(spec.runs, entries, strict=True):
        shipped = load(entry.config).spec.model_dump(mode="json", by_alias=True, exclude_unset=True)["dictionary"]
        added = (f"dictionary={json.dumps([*shipped, *EXTRA[kind]])}",) if EXTRA[kind] else ()
        name = f"name={variant.name}-{kind.replace(' ', '-')}"
        if str(variant.group).startswith(group):
            yield variant, finished(Entry(entry.config, (*entry.overrides, "validate.against=[]", *added, name)), runs)


def coiled_models(runs: Path) -> Table:
    """Held-out errors of all records, with states that drift and creep."""
    errors = {kind: {str(one.name): 100 * own(run).nrmse for one, run in coiled(runs, kind=kind)} for kind in EXTRA}
    groups = {str(one.name): str(one.group) for one, _ in coiled(runs)}
    rows: list[tuple[Cell, ...]] = [(name, *(errors[kind][name] for kind in EXTRA)) for name in groups]
    for group in dict.fromkeys(groups.values()):
        for word, pooled in (("median", median), ("worst", max)):
            rows.append((f"{group}: {word}", *(pooled([of[name] for name in groups if groups[name] == group]) for of in errors.values())))
    columns = (Column("run"), *(Column(kind, "%", ".3g") for kind in EXTRA))
    return Table("coiled_models", "NRMSE of coiled muscles with slower states, each record by itself", columns, tuple(rows))


def coiled_parts(runs: Path) -> Table:
    """Return what the held-out errors of the shipped setting consist of, in per cent of the range."""
    rows: list[tuple[Cell, ...]] = []
    for one, run in coiled(runs):
        files, score = RunFiles(run.run_dir), own(run)
        dataset, said = files.dataset(), files.validation().predictions["mapmore"]
        *_, held = error_parts(dataset.curves, said, dataset.target, "pressure", dataset.logs)
        parts = {part: 100 * size * score.nrmse / score.rmse for part, size in held.rms.items()}
        rows.append((str(one.name), len(held.offsets), math.hypot(*parts.values()), *parts.values(), held.limit))
    columns = (Column("run"), Column("cycles"), *(Column(name, "%", ".3g") for name in ("NRMSE", *PARTS)), Column("limited by"))
    most = sum(row[-1] in ("drift", "change") for row in rows)
    told = f"Drift or change is the largest part in {most} of {len(rows)} records."
    return Table("coiled_parts", "What the held-out errors of coiled muscles consist of", columns, tuple(rows), (told,))


def reversals(runs: Path) -> Table:
    """Inner reversals of both simulated muscles."""
    found = {name: study("m1", name, runs).table.scores for name in REVERSALS}
    return nrmse_table(CampaignScores(found, relative_to="static"))


def identification(runs: Path) -> Table:
    """Return the published identification records: free run, one step ahead, and what others found."""
    rows = []
    for name in IDENTIFICATION:
        run = study("identification", name, runs)
        memory = read_fit(run.run_dir / "fit.h5").memory
        assert memory is not None
        held = own(run)
        theirs = PEER.get(name, (None, None))
        published = PUBLISHED.get(name)
        over_all = whole_rmse(run) if published is not None else None
        rows.append((name, len(memory.model.terms), held.rrse, theirs[0], held.rrse_one_step, theirs[1], over_all, published))
    columns = (
        Column("record"),
        Column("terms"),
        Column("RRSE, free run", "", ".5f"),
        Column("peer's", "", ".5f"),
        Column("RRSE, one step", "", ".5f"),
        Column("peer's one step", "", ".5f"),
        Column("RMSE, free run, whole record", "", ".5g"),
        Column("published RMSE", "", ".5g"),
    )
    return Table("identification", "Identification records", columns, tuple(rows))


TANKS = {
    "linear": (
        "dictionary=[{lags: {of: [y, u], steps: [1, 2]}}]",
        "fit.select=one_step",
        "fit.criterion=one_step",
        "fit.scaling=none",
        "fit.margin=0.15",
        "fit.ridge=0",
    ),
    "one step ahead": ("fit.select=one_step", "fit.criterion=one_step"),
    "coefficients in free run": ("fit.select=one_step",),
    "not held at 10 V": ("fit.margin=1",),
    "coefficients and terms in free run": (),
}
"""Variations of the study of the tanks: which errors decide, and whether states are held at the ends of their training range."""


def tanks(runs: Path) -> Table:
    """Return the cascaded tanks: what the free run as criterion is worth, on the last quarter of the record, which it was not fitted to."""
    rows = []
    for number, (name, changes) in enumerate(TANKS.items()):
        named = () if not changes else (f"name=cascaded_tanks_{number}",)
        run = finished(Entry(CONFIGS / "identification" / "cascaded_tanks.yaml", (*changes, *named)), runs)
        memory = read_fit(run.run_dir / "fit.h5").memory
        assert memory is not None
        assert memory.held_out is not None
        rows.append((name, len(memory.model.terms), float(memory.held_out.min()), own(run, "train").rmse))
    columns = (
        Column("decided by"),
        Column("terms"),
        Column("RMSE, last quarter, held out", "V", ".3f"),
        Column("RMSE, whole record, fitted", "V", ".3f"),
    )
    return Table("tanks", "Cascaded tanks in free run", columns, tuple(rows))


def tanks_terms(runs: Path) -> Table:
    """Return the model of the cascaded tanks."""
    memory = read_fit(study("identification", "cascaded_tanks", runs).run_dir / "fit.h5").memory
    assert memory is not None
    rows = tuple(zip(memory.model.terms, memory.model.theta.tolist(), memory.model.theta_error.tolist(), strict=True))
    columns = (Column("term"), Column("coefficient", "", ".4g"), Column("standard error", "", ".2g"))
    return Table("tanks_terms", "Cascaded tanks: terms of states that are scaled to [0, 1]", columns, rows)


SHORT = ("data.split.validate={last: 0.95}", "name=bouc_wen_short")
"""The Bouc-Wen study trained on the first 2048 samples, which is quick enough for the tests."""


def bouc_wen(runs: Path) -> Table:
    """Return the hysteretic oscillator with and without stops of the output that is fed back; trained on much, and on little."""
    config = CONFIGS / "identification" / "bouc_wen.yaml"
    scores = {False: finished(Entry(config, ()), runs).table.scores, True: finished(Entry(config, SHORT), runs).table.scores}
    held = {short: {one.model: one for one in found if (one.split, one.curve) == ("validate", "all")} for short, found in scores.items()}
    rows = [
        (name, one.rrse, one.rrse_one_step, 1e5 * one.rmse, held[True][name].rrse if name in held[True] else None)
        for name, one in held[False].items()
    ]
    columns = (
        Column("model"),
        Column("RRSE, free run", "", ".4f"),
        Column("RRSE, one step", "", ".4f"),
        Column("RMSE, free run", "1e-5", ".3f"),
        Column("RRSE, free run, trained on 2048 samples", "", ".4f"),
    )
    return Table("bouc_wen", "Bouc-Wen oscillator: held-out samples", columns, tuple(rows))


def whole_rmse(run: Finished) -> float:
    """RMSE over training and held-out samples together."""
    parts = [own(run, split) for split in ("train", "validate")]
    return math.sqrt(sum(part.n * part.rmse**2 for part in parts) / sum(part.n for part in parts))


def tables(runs: Path) -> Mapping[str, Callable[[], Table]]:
    """Every table of the page, by its name there."""
    return {
        "coiled": lambda: nrmse_table(campaign("coiled", runs)),
        "coiled_models": lambda: coiled_models(runs),
        "coiled_parts": lambda: coiled_parts(runs),
        "uncut": lambda: uncut(runs),
        "coiled_loads": lambda: nrmse_table(campaign("coiled_loads", runs)),
        "reversals": lambda: reversals(runs),
        "identification": lambda: identification(runs),
        "tanks": lambda: tanks(runs),
        "tanks_terms": lambda: tanks_terms(runs),
        "bouc_wen": lambda: bouc_wen(runs),
    }


if __name__ == "__main__":
    found = tables(Path(sys.argv[1]))
    write_tables(DOCS / "memory.md", {name: found[name] for name in sys.argv[2:] or found})
