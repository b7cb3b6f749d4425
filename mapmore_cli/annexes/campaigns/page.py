"""Campaigns: which runs they stand for, and the page over all of them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import told
from mapmore_cli.domain.scores import RUN_PAGE
from mapmore_cli.reporting.table import Table, to_csv
from mapmore_cli.storage.atomic import make_folder, refusals_told, write_text
from mapmore_cli.storage.run_folder import refuse_foreign
from mapmore_cli.storage.run_record import CAMPAIGN_RECORD
from mapmore_cli.study.campaign import Campaign

if TYPE_CHECKING:
    from mapmore_cli.pipeline.jobs import Finished
    from mapmore_cli.reporting.campaign import CampaignScores


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
        if not isinstance(one, BaseException) and "report" in one.stages
    }
    title = campaign.title or campaign.campaign
    folder = runs / campaign.campaign
    runs_of = [one.name for one in results.values() if not isinstance(one, BaseException)]
    record = {"creator": "mapmore", "campaign": campaign.campaign, "runs": runs_of}
    texts = {
        CAMPAIGN_RECORD: json.dumps(record) + "\n",
        **{f"tables/{table.name}.csv": to_csv(table) for table in tables},
        **{f"{figure.name}.svg": figure.svg for figure in figures},
        "index.html": render_campaign(title, tables, figures, pages, failed),
    }
    with refusals_told(folder):
        refuse_foreign(folder, CAMPAIGN_RECORD)
        folder.mkdir(parents=True, exist_ok=True)
        make_folder(folder / "tables")
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
    tables = {
        f"{run.name} ({one.scores[0].target})" if len(run.table.each) > 1 else run.name: one
        for run in runs
        for one in run.table.each
    }
    scores = CampaignScores(
        {name: one.scores for name, one in tables.items()},
        units={name: unit for name, one in tables.items() for unit in one.units.values()},
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
