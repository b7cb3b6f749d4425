"""Campaigns on the command line: which runs they stand for, and the page over all of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mapmore_cli.cli.exits import message
from mapmore_cli.cli.views.view import View

if TYPE_CHECKING:
    from mapmore_cli.reporting.campaign import CampaignScores
    from mapmore_cli.spec.campaign import Campaign, Entry
    from mapmore_cli.stages.campaigns.batch import Finished


@dataclass(frozen=True)
class Expanded:
    """A campaign with the numbers of its runs among all jobs, and their names for messages."""

    campaign: Campaign
    jobs: tuple[int, ...]
    names: tuple[str, ...]


def expanded(configs: Sequence[Path], overrides: Sequence[str]) -> tuple[list[Expanded], list[Entry]]:
    """Every campaign among the files, and every run to do: a spec stands for itself. `overrides` come last."""
    from mapmore_cli.spec.campaign import Entry, is_campaign, load_campaign

    campaigns: list[Expanded] = []
    entries: list[Entry] = []
    for config in configs:
        if not is_campaign(config):
            entries.append(Entry(config, tuple(overrides)))
            continue
        campaign, runs = load_campaign(config)
        names = _names(campaign)
        campaigns.append(Expanded(campaign, tuple(range(len(entries), len(entries) + len(runs))), names))
        entries += [Entry(entry.config, (*entry.overrides, *overrides)) for entry in runs]
    return campaigns, entries


def _names(campaign: Campaign) -> tuple[str, ...]:
    """What its runs are called in messages: their own name, else that of their spec, with its folder where another is called alike."""
    bases = [str(run.base or campaign.base) for run in campaign.runs]
    short = [run.name or PurePosixPath(base).stem for run, base in zip(campaign.runs, bases, strict=True)]
    return tuple(name if short.count(name) == 1 else base for name, base in zip(short, bases, strict=True))


def write_page(expanded: Expanded, results: Sequence[Finished | BaseException], runs: Path) -> View:
    """Write `RUNS/CAMPAIGN/index.html` and its tables; a view of these, with the page's path."""
    from mapmore_cli.cli.views.files import PAGE
    from mapmore_cli.reporting.campaign import campaign_tables, render_campaign
    from mapmore_cli.reporting.figures.campaign import campaign_figures
    from mapmore_cli.reporting.figures.catalogue import rendered
    from mapmore_cli.reporting.tables import to_csv
    from mapmore_cli.storage.atomic import refusals_told, write_text

    campaign = expanded.campaign
    finished = [result for result in results if not isinstance(result, BaseException)]
    scores = scores_of(campaign, results)
    tables = campaign_tables(scores)
    figures = [rendered(drawing) for drawing in campaign_figures(scores)]
    failed = {name: message(r) for name, r in zip(expanded.names, results, strict=True) if isinstance(r, BaseException)}
    pages = {run.name: f"../{run.name}/{PAGE.as_posix()}" for run in finished}
    folder = runs / campaign.campaign
    with refusals_told(folder):
        (folder / "tables").mkdir(parents=True, exist_ok=True)
        for table in tables:
            write_text(folder / "tables" / f"{table.name}.csv", to_csv(table))
        for figure in figures:
            write_text(folder / f"{figure.name}.svg", figure.svg)
        write_text(folder / "index.html", render_campaign(campaign.title or campaign.campaign, tables, figures, pages, failed))
    return View({}, tables, (f"campaign page: {folder / 'index.html'}",))


def scores_of(campaign: Campaign, results: Sequence[Finished | BaseException]) -> CampaignScores:
    """What its tables are made of: the results of its runs, one for each."""
    from mapmore_cli.reporting.campaign import CampaignScores

    pairs = [(variant, run) for variant, run in zip(campaign.runs, results, strict=True) if not isinstance(run, BaseException)]
    finished = [run for _, run in pairs]
    printed = {run.name: run.published for run in finished if run.published is not None}
    return CampaignScores(
        {run.name: run.validation.scores for run in finished},
        units={run.name: unit for run in finished for unit in run.validation.units.values()},
        published=printed,
        relative_to=campaign.relative_to,
        best_of=campaign.best_of,
        groups={run.name: variant.group for variant, run in pairs if variant.group is not None},
    )
