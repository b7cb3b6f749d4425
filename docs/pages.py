"""What the scripts beside this file have in common: shipped runs brought up to date, published tables, and tables written into a page.

A table of a page stands between `<!-- table NAME -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from mapmore_cli.domain.scores import Score
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.campaign import CampaignScores
from mapmore_cli.reporting.table import Table, to_markdown
from mapmore_cli.spec.campaign import Entry, load_campaign
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.artefacts import read_validation
from mapmore_cli.study.campaigns.batch import Finished, Job, run_one
from mapmore_cli.study.campaigns.page import scores_of

DOCS = Path(__file__).parent
CONFIGS = DOCS.parent / "configs"
PUBLISHED = DOCS.parent / "datasets" / "published"


def finished(entry: Entry, runs: Path) -> Finished:
    """A run, brought up to date with its report."""
    return run_one(Job(entry.config, runs, entry.overrides))


def campaign(name: str, runs: Path) -> CampaignScores:
    """The scores of a shipped campaign."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / f"{name}.yaml")
    return scores_of(spec, {run.name: run for run in (finished(entry, runs) for entry in entries)})


def run(config: str, runs: Path, *overrides: str) -> Path:
    """The folder of a shipped study's run, brought up to date but for its report; `config` as `wrist/wrist-static`."""
    return bring_up_to_date(load(CONFIGS / f"{config}.yaml", overrides), runs, "validate").run_dir


def scores(folder: Path, split: str) -> dict[str, Score]:
    """The pooled rows of a run, by model."""
    rows = read_validation(folder / "validate.h5").scores
    return {row.model: row for row in rows if (row.split, row.curve) == (split, "all")}


def printed(name: str) -> list[dict[str, str]]:
    """The rows of a published table."""
    with (PUBLISHED / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_tables(page: Path, found: Mapping[str, Callable[[], Table]]) -> None:
    """Replace the tables of a page by those found of their names."""

    def table(match: re.Match[str]) -> str:
        if match[2] not in found:
            return match[0]
        return f"{match[1]}\n{to_markdown(found[match[2]]())}{match[3]}"

    text = re.sub(r"(<!-- table (\S+) -->)\n.*?(<!-- end -->)", table, page.read_text(encoding="utf-8"), flags=re.DOTALL)
    page.write_text(text, encoding="utf-8")
