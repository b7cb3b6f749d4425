"""What the scripts beside this file have in common: shipped runs brought up to date, published
tables, and the tables of pages.

A table of a page stands between `<!-- table NAME -->` and `<!-- end -->`. After `<!-- table NAME 3
-->` it is in `tables/PAGE/NAME.csv`: the page has its last three rows and a link, the site all of
it. Sentences quote cells with the marks of cells.py.
"""

from __future__ import annotations

import csv
import re
from argparse import ArgumentParser
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from cells import BLOCK, pages, write_cells
from cells import DOCS as DOCS
from cells import read_rows as read_rows

from mapmore_cli.annexes.campaigns.page import scores_of
from mapmore_cli.annexes.campaigns.tables import CampaignScores, nrmse_table
from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.scores import OWN, Score
from mapmore_cli.pipeline.jobs import Finished, Job, run_one
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Column, Table, to_markdown
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.study.campaign import Entry, load_campaign
from mapmore_cli.study.loader import LoadedSpec, load

CONFIGS = DOCS.parent / "configs"
PUBLISHED = DOCS / "papers" / "published"


def finished(entry: Entry, runs: Path) -> Finished:
    """Return a run, brought up to date with its scores."""
    return run_one(Job(entry.config, runs, entry.overrides, until="validate"))


@cache
def campaign(name: str, runs: Path) -> CampaignScores:
    """Return the scores of a shipped campaign."""
    spec, entries = load_campaign(CONFIGS / "campaigns" / f"{name}.yaml")
    every = [finished(entry, runs) for entry in entries]
    return scores_of({run.name: run for run in every}, spec)


def shipped(config: str, *overrides: str) -> LoadedSpec:
    """Return the spec of a shipped study, as `wrist/wrist-static`, with other settings."""
    return load(CONFIGS / f"{config}.yaml", overrides)


def run(config: str, runs: Path, *overrides: str, until: str = "validate") -> RunFiles:
    """Return the results of a shipped study, brought up to date as far as a stage."""
    return RunFiles(bring_up_to_date(shipped(config, *overrides), runs, until).run_dir)


def scores(files: RunFiles, split: str = "validate") -> dict[str, Score]:
    """Return the pooled rows of a run, by model."""
    return {
        row.model: row
        for row in files.validation().scores
        if (row.split, row.curve) == (split, "all")
    }


def own(files: RunFiles, split: str = "validate") -> Score:
    """Return the pooled row of a run's own model."""
    return scores(files, split)[OWN]


def rms(errors: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(errors**2)))


def r2(truth: Array, found: Array) -> float:
    """Coefficient of determination."""
    return 1 - float(np.sum((found - truth) ** 2) / np.sum((truth - truth.mean()) ** 2))


def printed(name: str) -> list[dict[str, str]]:
    """Return the rows of a published table."""
    with (PUBLISHED / name).open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_tables(page: Path, found: Mapping[str, Callable[[], Table]]) -> None:
    """Replace the tables of a page by those made under their names, and then the numbers that
    sentences of any page quote.
    """

    def block(match: re.Match[str]) -> str:
        head, name, kept, _, end = match.groups()
        if name not in found:
            return match[0]
        table = found[name]()
        if kept is None:
            return f"{head}\n{to_markdown(table, str)}{end}"
        return f"{head}\n{_excerpt(table, int(kept), page.stem, name)}{end}"

    page.write_text(BLOCK.sub(block, page.read_text(encoding="utf-8")), encoding="utf-8")
    for path in pages():
        write_cells(path)


def of_campaign(name: str) -> Callable[[Path], Table]:
    """Return what makes the table of errors of a shipped campaign."""
    return lambda runs: nrmse_table(campaign(name, runs))


def asked() -> tuple[Path, list[str]]:
    """Return the folder of runs, and the names behind it, that the command line gives; what begins
    with a hyphen is no folder, and ends the program with the usage.
    """
    parser = ArgumentParser()
    parser.add_argument("runs", type=Path, help="folder of runs, which are brought up to date")
    parser.add_argument("names", nargs="*", help="what to write, if not everything")
    arguments = parser.parse_args()
    return arguments.runs, arguments.names


def write_page(page: str, tables: Mapping[str, Callable[[Path], Table]]) -> None:
    """Write the tables of a page, or those of them that the command line names behind the folder of
    runs.
    """
    runs, names = asked()
    write_tables(
        DOCS / page,
        {name: partial(table, runs) for name, table in tables.items() if name in (names or tables)},
    )


def _excerpt(table: Table, kept: int, page: str, name: str) -> str:
    """Write a table into its file; return its last rows, its notes and a link to the file."""
    write_rows(DOCS / "tables" / page / f"{name}.csv", [table.headings, *table.shown])
    link = f"[All {len(table.rows)} rows](tables/{page}/{name}.csv)\n"
    if kept:
        return f"{to_markdown(replace(table, rows=table.rows[-kept:]), str)}\n{link}"
    return "".join(f"{note}\n\n" for note in table.notes) + f"{table.title}: {link}"


def write_rows(path: Path, rows: Sequence[Sequence[str]]) -> None:
    """Write headings and rows as CSV."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def in_full(text: str, page: str) -> str:
    """Return the text of a page with the whole table in the place of each link to it."""

    def whole(match: re.Match[str]) -> str:
        if match[3] is None:
            return match[0]
        headings, *rows = read_rows(Path(page), match[2])
        table = Table(match[2], "", tuple(map(Column, headings)), tuple(map(tuple, rows)))
        shown = to_markdown(table, str).replace("****\n\n", "")
        head, tail = '<details markdown="1" open><summary>', f"</summary>\n\n{shown}\n[CSV]"
        return re.sub(
            r"^(.*)\[(All \d+ rows)\](\(.*?\))$",
            lambda link: f"{head}{link[1]}{link[2]}{tail}{link[3]}\n\n</details>\n",
            match[0],
            flags=re.MULTILINE,
        )

    return BLOCK.sub(whole, text)
