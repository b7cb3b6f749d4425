"""Write the page that compares all runs of a campaign, and find the names of these runs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from mapmore_cli.domain.errors import SpecError, UsageError, Warn, error_text
from mapmore_cli.reporting.order import RUN_PAGE
from mapmore_cli.reporting.scripts import joined, scripts
from mapmore_cli.reporting.table import Table, environment, to_csv
from mapmore_cli.storage.atomic import content_of, make_folder, refusals_told, write_own
from mapmore_cli.storage.ownership import to_trash
from mapmore_cli.storage.run_folder import refuse_foreign
from mapmore_cli.storage.run_record import CAMPAIGN_RECORD
from mapmore_cli.study.campaign import Campaign, Entry, Expanded
from mapmore_cli.study.loader import load
from mapmore_cli.study.sections.results import Competitor

if TYPE_CHECKING:
    from mapmore_cli.annexes.campaigns.tables import CampaignScores
    from mapmore_cli.pipeline.jobs import Finished
    from mapmore_cli.reporting.figures.drawing import RenderedFigure


def write_page(
    campaign: Campaign,
    results: Mapping[str, Finished | BaseException],
    runs: Path,
    warn: Warn,
) -> tuple[Path, tuple[Table, ...]]:
    """Write `RUNS/CAMPAIGN/index.html`, the page of a campaign, with its figures and tables.
    `results` holds the results of the campaign's runs by name, in order. `warn` is called for each
    file in the folder of the page that somebody changed.

    Returns the path of the page, and the tables on it.
    """
    from mapmore_cli.annexes.campaigns.figure import campaign_figures
    from mapmore_cli.annexes.campaigns.tables import campaign_tables
    from mapmore_cli.reporting.figures.drawing import render_figure

    scores = scores_of(results, campaign)
    tables = campaign_tables(scores)
    figures = [render_figure(drawing) for drawing in campaign_figures(scores)]
    failed = {
        n: error_text(result) for n, result in results.items() if isinstance(result, BaseException)
    }
    pages = {
        name: f"../{result.name}/{RUN_PAGE}"
        for name, result in results.items()
        if not isinstance(result, BaseException) and "report" in result.stages
    }
    folder = runs / campaign.campaign
    runs_of = [result.name for result in results.values() if not isinstance(result, BaseException)]
    record = {"creator": "mapmore", "campaign": campaign.campaign, "runs": runs_of}
    texts = {
        **{f"tables/{table.name}.csv": to_csv(table) for table in tables},
        **{f"{figure.name}.svg": figure.svg for figure in figures},
        "index.html": render_campaign(campaign, tables, figures, pages, failed),
    }
    with refusals_told(folder):
        refuse_foreign(folder, CAMPAIGN_RECORD)
        folder.mkdir(parents=True, exist_ok=True)
        make_folder(folder / "tables")
        files = _ways_made(folder, texts, warn)
        write_own(folder / CAMPAIGN_RECORD, json.dumps({**record, "files": files}) + "\n")
        for name, text in texts.items():
            write_own(folder / name, text)
    return folder / "index.html", tables


def _ways_made(folder: Path, texts: Mapping[str, str], warn: Warn) -> dict[str, list[str]]:
    """Move files of the last page to the trash if somebody changed them after mapmore wrote them.
    Remove unchanged files that the new page does not have. Return, for each file of the new page, a
    list with the hash of its new contents. If the file exists already and was written by mapmore,
    the list also has the hash of its present contents.

    A record of an older version of mapmore lists no files. Then every existing file is treated as
    written by mapmore.
    """
    known: object = None
    with suppress(OSError, ValueError, AttributeError):
        known = json.loads(content_of(folder / CAMPAIGN_RECORD)).get("files")
    files = dict[str, list[str]]()
    for name, text in texts.items():
        files[name] = [sha256(text.encode()).hexdigest()]
        place = folder / name
        if place.is_symlink() or not place.is_file():
            continue  # for a link, an error is raised later, when the file is written
        there = sha256(place.read_bytes()).hexdigest()
        if not isinstance(known, dict) or there in (*files[name], *known.get(name, ())):
            files[name].append(there)
        else:
            trash = to_trash(folder, [name])
            warn(f"{place}: was changed after mapmore wrote the page; the old files are in {trash}")
    former = known if isinstance(known, dict) else {}
    for name in former.keys() - texts.keys():
        place = folder / name
        # a copied record could name files elsewhere
        is_inside = place.parent in (folder, folder / "tables")
        if (
            is_inside
            and place.is_file()
            and not place.is_symlink()
            and sha256(place.read_bytes()).hexdigest() in former[name]
        ):
            place.unlink()
    return files


def scores_of(
    results: Mapping[str, Finished | BaseException], campaign: Campaign | None = None
) -> CampaignScores:
    """Return the scores from which the tables over several runs are made. `results` holds, by the
    name of each run, its result or its error. If a `campaign` is given, the scores also have its
    groups of runs, and the models with which it compares the others (`relative_to` and `best_of`).
    """
    from mapmore_cli.annexes.campaigns.tables import CampaignScores

    finished = {name: run for name, run in results.items() if not isinstance(run, BaseException)}
    outputs = [
        (
            name,
            f"{run.name} ({table.scores[0].target})" if len(run.table.each) > 1 else run.name,
            table,
        )
        for name, run in finished.items()
        for table in run.table.each
    ]
    scores = CampaignScores(
        {label: table.scores for _, label, table in outputs},
        units={label: unit for _, label, table in outputs for unit in table.units.values()},
        published={
            label: paper for name, label, _ in outputs if (paper := finished[name].published)
        },
        failed=tuple(name for name in results if name not in finished),
    )
    if campaign is None:
        return scores
    groups = dict(zip(results, (variant.group for variant in campaign.runs), strict=True))
    return replace(
        scores,
        relative_to=campaign.relative_to,
        best_of=campaign.best_of,
        groups={label: group for name, label, _ in outputs if (group := groups[name])},
    )


def render_campaign(
    campaign: Campaign,
    tables: Sequence[Table],
    figures: Sequence[RenderedFigure],
    pages: Mapping[str, str],
    failed: Mapping[str, str],
) -> str:
    """Return the page of a campaign as HTML. `pages` holds, by the name of a finished run, the link
    to its page; `failed` holds, by the name of a failed run, its error message.
    """
    from mapmore_cli.reporting.report import MOST_ROWS

    template = environment().get_template("campaign.html")
    tables = [table.head(MOST_ROWS) for table in tables]
    return template.render(
        title=campaign.title or campaign.campaign,
        name=campaign.campaign,
        tables=tables,
        figures=figures,
        pages=pages,
        failed=failed,
        scripts=scripts([joined("tables.js")]),
    )


def run_names(
    entries: Sequence[Entry],
    campaigns: Sequence[Expanded],
    known: Mapping[int, str],
) -> list[str]:
    """Return the name of every run. A run whose spec has an error gets the name that messages use
    for it; the error is reported when the run starts. `known` holds names that are known already,
    by the index of the entry, so that the spec of the entry need not be read.

    Raises UsageError if two of the runs, their variations and the campaigns have the same name,
    because they would be written into the same folder.
    """
    names: list[str] = []
    named = (campaign.campaign.campaign for campaign in campaigns)
    claims = [(name, f"the campaign '{name}'") for name in named]
    for number, entry in enumerate(entries):
        if number in known:
            names.append(known[number])
            claims.append((known[number], str(entry.config)))
            continue
        try:
            spec = load(entry.config, entry.overrides).spec
        except SpecError:
            names.append(str(entry.config) if entry.called in names else entry.called)
            continue
        names.append(spec.name)
        claims.append((spec.name, str(entry.config)))
        claims += [
            (f"{spec.name}.{rival.label}", f"{entry.config} as '{rival.label}'")
            for rival in spec.validation.against
            if isinstance(rival, Competitor) and rival.set is not None
        ]
    owners: dict[str, str] = {}
    for folder, owner in claims:
        # file systems that ignore the case of letters take both names for the same folder
        first = owners.setdefault(folder.lower(), owner)
        if first is not owner:
            raise UsageError(
                f"{first} and {owner} have the same name, '{folder}', and would share a folder",
                "give each run a `name` of its own",
            )
    return names
