"""Write the tables of docs/memory.md from runs, which are brought up to date first: `python docs/memory_tables.py RUNS [TABLE ...]`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from pages import CONFIGS, DOCS, campaign, finished, write_tables

from mapmore_cli.domain.scores import Score
from mapmore_cli.reporting.campaign import CampaignScores, nrmse_table
from mapmore_cli.reporting.table import Column, Table
from mapmore_cli.spec.campaign import Entry, load_campaign
from mapmore_cli.storage.artefacts import read_fit
from mapmore_cli.study.campaigns.batch import Finished

REVERSALS = ("dmsp-20-88-inner-reversals", "peano-inner-reversals")
IDENTIFICATION = ("data_for_testing", "buck", "motor_generator", "motor_generator_published")
PEER = {"data_for_testing": (0.0, 0.0), "buck": (0.500036, 0.107629), "motor_generator": (0.132845, 0.064975)}
"""RRSE of as many terms of sysidentpy 0.9.0, in free run and one step ahead."""
PUBLISHED = {"motor_generator_published": 177.66}
"""RMSE over the whole record in free run, in a published example of sysidentpy (another algorithm, seven terms)."""


def study(folder: str, name: str, runs: Path) -> Finished:
    """A shipped study, brought up to date."""
    return finished(Entry(CONFIGS / folder / f"{name}.yaml", ()), runs)


def own(run: Finished, split: str = "validate") -> Score:
    """The pooled scores of the run's own model."""
    return next(score for score in run.table.scores if (score.model, score.split, score.curve) == ("mapmore", split, "all"))


def uncut(runs: Path) -> Table:
    """The records of which a part is left out, beside the same with all of it."""
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


def reversals(runs: Path) -> Table:
    """Inner reversals of both simulated muscles."""
    found = {name: study("m1", name, runs).table.scores for name in REVERSALS}
    return nrmse_table(CampaignScores(found, relative_to="static"))


def identification(runs: Path) -> Table:
    """The published identification records: free run, one step ahead, and what others found."""
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
    """The cascaded tanks: what the free run as criterion is worth, on the last quarter of the record, which it was not fitted to."""
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
    """The model of the cascaded tanks."""
    memory = read_fit(study("identification", "cascaded_tanks", runs).run_dir / "fit.h5").memory
    assert memory is not None
    rows = tuple(zip(memory.model.terms, memory.model.theta.tolist(), memory.model.theta_error.tolist(), strict=True))
    columns = (Column("term"), Column("coefficient", "", ".4g"), Column("standard error", "", ".2g"))
    return Table("tanks_terms", "Cascaded tanks: terms of states that are scaled to [0, 1]", columns, rows)


SHORT = ("data.split.validate={last: 0.95}", "name=bouc_wen_short")
"""The Bouc-Wen study trained on the first 2048 samples, which is quick enough for the tests."""


def bouc_wen(runs: Path) -> Table:
    """The hysteretic oscillator with and without stops of the output that is fed back; trained on much, and on little."""
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
