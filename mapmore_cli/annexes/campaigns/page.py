"""Campaigns: which runs they stand for, and the page over all of them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import SpecError, UsageError, told
from mapmore_cli.domain.scores import RUN_PAGE
from mapmore_cli.reporting.table import Table, to_csv
from mapmore_cli.spec.campaign import Campaign, Entry, is_campaign, load_campaign
from mapmore_cli.spec.experiment import Competitor
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.atomic import refusals_told, write_text
from mapmore_cli.storage.run_folder import refuse_foreign
from mapmore_cli.storage.run_record import CAMPAIGN_RECORD

if TYPE_CHECKING:
    from mapmore_cli.annexes.campaigns.batch import Finished
    from mapmore_cli.reporting.campaign import CampaignScores


@dataclass(frozen=True)
class Expanded:
    """A campaign with the numbers of its runs among all jobs, and their names for messages.

    A run is called by its own name, else by that of its spec, with its folder where another is
    called alike.
    """

    campaign: Campaign
    jobs: tuple[int, ...]
    names: tuple[str, ...]


def expanded(
    configs: Sequence[Path], overrides: Sequence[str]
) -> tuple[list[Expanded], list[Entry]]:
    """Every campaign among the files, and every run to do: a spec stands for itself. `overrides`
    come last.
    """
    campaigns: list[Expanded] = []
    entries: list[Entry] = []
    for config in configs:
        if not is_campaign(config):
            entries.append(Entry(config, tuple(overrides)))
            continue
        campaign, runs = load_campaign(config)
        bases = [str(run.base or campaign.base) for run in campaign.runs]
        short = [run.name or PurePosixPath(run.base or "").stem for run in campaign.runs]
        uses = Counter(short)
        names = tuple(
            name if uses[name] == 1 else base for name, base in zip(short, bases, strict=True)
        )
        campaigns.append(
            Expanded(campaign, tuple(range(len(entries), len(entries) + len(runs))), names)
        )
        entries += [Entry(entry.config, (*entry.overrides, *overrides), config) for entry in runs]
    return campaigns, entries


def run_names(entries: Sequence[Entry], campaigns: Sequence[Expanded]) -> list[str]:
    """Return the name of every run; where its spec is wrong, which its own run will say, what it is
    called in messages.

    Raises UsageError where two of the runs, their variations and the campaigns have one name, which
    would be the same folder.
    """
    called = {
        number: name
        for campaign in campaigns
        for number, name in zip(campaign.jobs, campaign.names, strict=True)
    }
    names: list[str] = []
    owners: dict[str, str] = {}

    def claim(folder: str, owner: str) -> None:
        alike = folder.lower()  # one folder, where capitals do not count in names of files
        if alike in owners:
            raise UsageError(
                f"{owners[alike]} and {owner} have the same name, '{folder}'",
                "give each a `name` of its own",
            )
        owners[alike] = owner

    for one in campaigns:
        claim(one.campaign.campaign, f"the campaign '{one.campaign.campaign}'")
    for number, entry in enumerate(entries):
        try:
            spec = load(entry.config, entry.overrides).spec
        except SpecError:
            short = called.get(number, entry.config.stem)
            names.append(str(entry.config) if short in names else short)
            continue
        claim(spec.name, str(entry.config))
        for rival in spec.validation.against:
            if isinstance(rival, Competitor) and rival.set is not None:
                claim(f"{spec.name}.{rival.label}", f"{entry.config} as '{rival.label}'")
        names.append(spec.name)
    return names


def write_page(
    campaign: Campaign, results: Mapping[str, Finished | BaseException], runs: Path
) -> tuple[Path, tuple[Table, ...]]:
    """Write `RUNS/CAMPAIGN/index.html` with its figures and tables; `results` are those of its runs
    by name, in their order.

    Returns the path of the page, and the tables on it.
    """
    from mapmore_cli.reporting.campaign import campaign_tables
    from mapmore_cli.reporting.figures.commands import campaign_figures
    from mapmore_cli.reporting.figures.drawing import render_figure
    from mapmore_cli.reporting.report import render_campaign

    scores = scores_of(results, campaign)
    tables = campaign_tables(scores)
    figures = [render_figure(drawing) for drawing in campaign_figures(scores)]
    failed = {n: told(one) for n, one in results.items() if isinstance(one, BaseException)}
    pages = {
        name: f"../{one.name}/{RUN_PAGE}"
        for name, one in results.items()
        if not isinstance(one, BaseException)
    }
    title = campaign.title or campaign.campaign
    folder = runs / campaign.campaign
    texts = {
        CAMPAIGN_RECORD: json.dumps({"creator": "mapmore", "campaign": campaign.campaign}) + "\n",
        **{f"tables/{table.name}.csv": to_csv(table) for table in tables},
        **{f"{figure.name}.svg": figure.svg for figure in figures},
        "index.html": render_campaign(title, tables, figures, pages, failed),
    }
    with refusals_told(folder):
        refuse_foreign(folder, CAMPAIGN_RECORD)
        (folder / "tables").mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            write_text(folder / name, text)
    return folder / "index.html", tables


def scores_of(
    results: Mapping[str, Finished | BaseException], campaign: Campaign | None = None
) -> CampaignScores:
    """Return what tables of several runs are made of: their results by name, of a campaign one for
    each of its runs.
    """
    from mapmore_cli.reporting.campaign import CampaignScores

    finished = {name: run for name, run in results.items() if not isinstance(run, BaseException)}
    runs = finished.values()
    scores = CampaignScores(
        {run.name: run.table.scores for run in runs},
        units={run.name: unit for run in runs for unit in run.table.units.values()},
        published={run.name: run.published for run in runs if run.published is not None},
        failed=tuple(name for name in results if name not in finished),
    )
    if campaign is None:
        return scores
    groups = dict(zip(results, (variant.group for variant in campaign.runs), strict=True))
    return replace(
        scores,
        relative_to=campaign.relative_to,
        best_of=campaign.best_of,
        groups={run.name: group for name, run in finished.items() if (group := groups[name])},
    )
