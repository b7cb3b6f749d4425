"""`make paper`: every shipped study, then one page with the tables and figures of five papers beside ours.

`python docs/paper_page.py RUNS` writes RUNS/paper.html, one file that needs no network. Measured recordings are used where they are
(docs/data.md); else the page says that they are left out.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jinja2 import ChoiceLoader, FileSystemLoader
from markupsafe import Markup, escape
from pages import CONFIGS, DOCS, campaign
from paper import h, m1, m2, p, w
from paper.result import SAME_SIZE, Result

from mapmore_cli import __version__
from mapmore_cli.domain.errors import MapmoreError, told
from mapmore_cli.reporting.campaign import campaign_tables
from mapmore_cli.reporting.figures.campaign import campaign_figures
from mapmore_cli.reporting.figures.catalogue import RenderedFigure, rendered
from mapmore_cli.reporting.report import SCREEN_SCALE, environment
from mapmore_cli.reporting.table import Table
from mapmore_cli.spec.campaign import load_campaign
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.atomic import write_text

PAPERS = {
    "M1": "static force and hysteresis by pieces",
    "M2": "static, damping and dynamic force by pieces",
    "P": "motion by linear sections, found by a swarm",
    "W": "five static models of a wrist robot's muscle",
    "H": "a muscle-like model",
}
RESULTS: Mapping[str, Callable[[Path], Result]] = {
    "m1-static": m1.static,
    "m1-hysteresis": m1.hysteresis,
    "m2-static": m2.static,
    "m2-segmentation": m2.segmentation,
    "m2-table-5": m2.table_5,
    "m2-damping": m2.damping,
    "m2-dynamic": m2.dynamic,
    "p-table-1": p.table_1,
    "p-table-2": p.table_2,
    "p-table-3": p.table_3,
    "w-models": w.models,
    "w-figures": w.simulated,
    "h-table-1": h.table_1,
    "h-joint": h.joint,
}
"""Every table and group of figures by its id, in the order of the page."""

SIMULATED = ("paper",)
MEASURED = ("measured_static", "coiled", "coiled_motion", "measured")
"""Campaigns."""


@dataclass(frozen=True)
class Part:
    """A campaign on the page."""

    title: str
    tables: tuple[Table, ...]
    figures: tuple[RenderedFigure, ...]
    specs: tuple[str, ...]


def recordings() -> Path:
    """Where the measured recordings are looked for."""
    return Path(os.environ.get("MAPMORE_DATA") or DOCS.parents[1] / "shared" / "data")


def batch(campaigns: Sequence[str], runs: Path) -> int:
    """Bring all runs of the campaigns up to date, two at a time on two processors; the exit code of the worst."""
    files = [str(CONFIGS / "campaigns" / f"{name}.yaml") for name in campaigns]
    return subprocess.run(
        [sys.executable, "-m", "mapmore_cli", "batch", *files, "--runs", str(runs)], check=False, stdout=sys.stderr
    ).returncode


def results(runs: Path, failed: dict[str, str]) -> Iterator[Result]:
    """The results of all papers; those whose runs did not end are told in `failed`."""
    for name, make in RESULTS.items():
        try:
            yield make(runs)
        except (MapmoreError, OSError) as fault:
            failed[name] = told(fault)


def measured(runs: Path, failed: dict[str, str]) -> Iterator[Part]:
    """The campaigns of measured muscles."""
    for name in MEASURED:
        try:
            scores = campaign(name, runs)
        except MapmoreError as fault:
            failed[name] = told(fault)
            continue
        spec, entries = load_campaign(CONFIGS / "campaigns" / f"{name}.yaml")
        paths = dict.fromkeys(entry.config.resolve().relative_to(CONFIGS).as_posix() for entry in entries)
        yield Part(spec.title or name, campaign_tables(scores), tuple(map(rendered, campaign_figures(scores))), tuple(paths))


def spec_texts(path: Path) -> dict[str, str]:
    """A spec and what it extends, by their paths below the project."""
    text = path.read_text(encoding="utf-8")
    found = {path.relative_to(DOCS.parent).as_posix(): text}
    for line in text.splitlines():
        if line.startswith("extends:"):
            found |= spec_texts((path.parent / line.partition(":")[2].strip()).resolve())
    return found


def prose(text: str) -> Markup:
    """Text with words between backquotes as code."""
    return Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", str(escape(text))))


def page(found: Sequence[Result], parts: Sequence[Part], failed: Mapping[str, str], absent: str) -> str:
    """The page as HTML."""
    templates = environment()
    assert templates.loader is not None
    templates.loader = ChoiceLoader([templates.loader, FileSystemLoader(DOCS / "paper")])
    specs = dict.fromkeys([spec for result in found for spec in result.specs] + [spec for part in parts for spec in part.specs])
    templates.filters["prose"] = prose
    return templates.get_template("paper.html").render(
        version=__version__,
        same_size=SAME_SIZE,
        results=found,
        agreed=sum(result.agreed for result in found),
        compared=sum(len(result.parts) for result in found),
        papers=PAPERS,
        failed=failed,
        measured=parts,
        absent=absent,
        specs={spec: spec_texts(CONFIGS / spec) for spec in specs},
        names={spec: load(CONFIGS / spec).spec.name for result in found for spec in result.specs},
        scale=SCREEN_SCALE,
    )


def main(arguments: Sequence[str]) -> int:
    """Run everything and write the page."""
    runs = Path(arguments[0])
    there = recordings().is_dir()
    absent = "" if there else f"there are no measured recordings in {recordings()} (docs/data.md says where to get them)"
    if absent:
        print(f"left out: {absent}", file=sys.stderr)
    code = batch((*(reversed(MEASURED) if there else ()), *SIMULATED), runs)  # the longest runs first, so that no process waits at the end
    failed: dict[str, str] = {}
    found = list(results(runs, failed))
    parts = list(measured(runs, failed)) if there else []
    write_text(runs / "paper.html", page(found, parts, failed, absent))
    print(f"page: {runs / 'paper.html'}")
    return code or bool(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
