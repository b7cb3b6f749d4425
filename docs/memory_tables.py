"""Write the tables of docs/memory.md from runs, which are brought up to date first: `python docs/memory_tables.py RUNS`.

The measured recordings must be there (docs/data.md).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from measured_tables import CONFIGS, DOCS, campaign, finished, write_tables

from mapmore_cli.domain.memory import MemoryFit
from mapmore_cli.domain.scores import Score
from mapmore_cli.reporting.campaign import CampaignScores, nrmse_table
from mapmore_cli.reporting.memory_tables import substitutes_table
from mapmore_cli.reporting.tables import Column, Table
from mapmore_cli.spec.campaign import Entry, load_campaign
from mapmore_cli.stages.campaigns.batch import Finished
from mapmore_cli.storage.artefacts import read_fit

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
    return next(score for score in run.validation.scores if (score.model, score.split, score.curve) == ("mapmore", split, "all"))


def uncut(runs: Path) -> Table:
    """The records of which a part is left out, beside the same with all of it."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / "coiled.yaml")
    rows = []
    for variant, entry in zip(spec.runs, entries, strict=True):
        (given,) = variant.set.get("data.files", [""])
        if not isinstance(given, dict):
            continue
        whole = (*entry.overrides, "data.files.0.keep=[]", "validate.against=[]", f"name={variant.name}-uncut")
        errors = [100 * own(finished(each, runs)).nrmse for each in (entry, Entry(entry.config, whole))]
        ((_, quantity), (condition, limits)) = given["keep"][0].items()
        said = " and ".join(limits) if isinstance(limits, list) else limits
        rows.append((variant.name, f"{quantity} {condition} {said}", *errors))
    columns = (Column("run"), Column("kept"), Column("cut", "%", ".3g"), Column("uncut", "%", ".3g"))
    return Table("uncut", "NRMSE of mapmore with and without what was not measured soundly", columns, tuple(rows))


def reversals(runs: Path) -> Table:
    """Inner reversals of both simulated muscles."""
    found = {name: study("m1", name, runs).validation.scores for name in REVERSALS}
    return nrmse_table(CampaignScores(found, relative_to="static"))


def chosen(runs: Path) -> Table:
    """The terms of one record and what else would have served."""
    memory: MemoryFit | None = read_fit(study("coiled", "coiled_steps", runs).run_dir / "fit.h5").memory
    assert memory is not None
    return substitutes_table(memory)


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


def whole_rmse(run: Finished) -> float:
    """RMSE over training and held-out samples together."""
    parts = [own(run, split) for split in ("train", "validate")]
    return math.sqrt(sum(part.n * part.rmse**2 for part in parts) / sum(part.n for part in parts))


def tables(runs: Path) -> Mapping[str, Callable[[], Table]]:
    """Every table of the page, by its name there."""
    return {
        "coiled": lambda: nrmse_table(campaign("coiled", runs)),
        "uncut": lambda: uncut(runs),
        "chosen": lambda: chosen(runs),
        "coiled_loads": lambda: nrmse_table(campaign("coiled_loads", runs)),
        "reversals": lambda: reversals(runs),
        "identification": lambda: identification(runs),
    }


if __name__ == "__main__":
    write_tables(DOCS / "memory.md", tables(Path(sys.argv[1])))
