"""Campaigns: which runs they stand for, and the page over all of them."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import SpecError, UsageError, told
from mapmore_cli.domain.scores import RUN_PAGE
from mapmore_cli.reporting.table import Table, to_csv
from mapmore_cli.spec.campaign import Campaign, Entry, is_campaign, load_campaign
from mapmore_cli.spec.experiment import Competitor
from mapmore_cli.spec.loader import LoadedSpec, load
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
        short = [
            run.name or PurePosixPath(base).stem
            for run, base in zip(campaign.runs, bases, strict=True)
        ]
        uses = Counter(short)
        names = tuple(
            name if uses[name] == 1 else base for name, base in zip(short, bases, strict=True)
        )
        campaigns.append(
            Expanded(campaign, tuple(range(len(entries), len(entries) + len(runs))), names)
        )
        entries += [Entry(entry.config, (*entry.overrides, *overrides), config) for entry in runs]
    return campaigns, entries


def specs_of(entries: Sequence[Entry]) -> list[LoadedSpec | None]:
    """Return the spec of every run; None where it is wrong, which its own run will say."""
    specs: list[LoadedSpec | None] = [None] * len(entries)
    for number, entry in enumerate(entries):
        with suppress(SpecError):
            specs[number] = load(entry.config, entry.overrides)
    return specs


def run_names(
    entries: Sequence[Entry], campaigns: Sequence[Expanded], specs: Sequence[LoadedSpec | None]
) -> list[str]:
    """Return the name of every run; where its spec is wrong, what it is called in messages.

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

    for campaign in campaigns:
        claim(campaign.campaign.campaign, f"the campaign '{campaign.campaign.campaign}'")
    for number, (entry, loaded) in enumerate(zip(entries, specs, strict=True)):
        if loaded is None:
            short = called.get(number, entry.config.stem)
            names.append(str(entry.config) if short in names else short)
            continue
        spec = loaded.spec
        claim(spec.name, str(entry.config))
        for rival in spec.validation.against:
            if isinstance(rival, Competitor) and rival.set is not None:
                claim(f"{spec.name}.{rival.label}", f"{entry.config} as '{rival.label}'")
        names.append(spec.name)
    return names


def refuse_foreign_folders(campaigns: Sequence[Expanded], runs: Path) -> None:
    """Raise WriteError where the page of a campaign has no place: better before its runs are
    done.
    """
    for one in campaigns:
        refuse_foreign(runs / one.campaign.campaign, CAMPAIGN_RECORD)


def write_page(
    campaign: Campaign, results: Mapping[str, Finished | BaseException], runs: Path
) -> tuple[Path, tuple[Table, ...]]:
    """Write `RUNS/CAMPAIGN/index.html` with its figures and tables; `results` are those of its runs
    by name, in their order.

    Returns the path of the page, and the tables on it.
    """
    from mapmore_cli.reporting.campaign import campaign_tables
    from mapmore_cli.reporting.figures.commands import campaign_figures
    from mapmore_cli.reporting.figures.drawing import rendered
    from mapmore_cli.reporting.report import render_campaign

    scores = scores_of(campaign, results)
    tables = campaign_tables(scores)
    figures = [rendered(drawing) for drawing in campaign_figures(scores)]
    failed = {
        name: told(result) for name, result in results.items() if isinstance(result, BaseException)
    }
    pages = {
        name: f"../{result.name}/{RUN_PAGE}"
        for name, result in results.items()
        if not isinstance(result, BaseException)
    }
    folder = runs / campaign.campaign
    with refusals_told(folder):
        refuse_foreign(folder, CAMPAIGN_RECORD)
        (folder / "tables").mkdir(parents=True, exist_ok=True)
        write_text(
            folder / CAMPAIGN_RECORD,
            json.dumps({"creator": "mapmore", "campaign": campaign.campaign}) + "\n",
        )
        for table in tables:
            write_text(folder / "tables" / f"{table.name}.csv", to_csv(table))
        for figure in figures:
            write_text(folder / f"{figure.name}.svg", figure.svg)
        write_text(
            folder / "index.html",
            render_campaign(campaign.title or campaign.campaign, tables, figures, pages, failed),
        )
    return folder / "index.html", tables


def scores_of(
    campaign: Campaign, results: Mapping[str, Finished | BaseException]
) -> CampaignScores:
    """Return what its tables are made of: the results of its runs by name, one for each."""
    from mapmore_cli.reporting.campaign import CampaignScores

    pairs = [
        (variant, run)
        for variant, run in zip(campaign.runs, results.values(), strict=True)
        if not isinstance(run, BaseException)
    ]
    finished = [run for _, run in pairs]
    return CampaignScores(
        {run.name: run.table.scores for run in finished},
        units={run.name: unit for run in finished for unit in run.table.units.values()},
        published={run.name: run.published for run in finished if run.published is not None},
        relative_to=campaign.relative_to,
        best_of=campaign.best_of,
        groups={run.name: variant.group for variant, run in pairs if variant.group is not None},
        failed=tuple(name for name, result in results.items() if isinstance(result, BaseException)),
    )
