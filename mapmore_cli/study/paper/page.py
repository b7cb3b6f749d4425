"""The page over papers: every item with its place and status, comparisons with their verdicts, and figures of ours."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mapmore_cli import __version__
from mapmore_cli.domain.errors import MapmoreError, told
from mapmore_cli.pipeline.report import drawn_figure
from mapmore_cli.reporting.table import Column, Table, environment
from mapmore_cli.spec.paper import Item, LoadedPaper
from mapmore_cli.study.paper.compare import beside, sentences
from mapmore_cli.study.paper.ours import Runs
from mapmore_cli.study.paper.verdicts import Compared, counts, summary

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Shown:
    """A figure of ours, and what it shows."""

    svg: str
    caption: str


@dataclass(frozen=True)
class Result:
    """An item with what was compared; `failed` says why where its runs did not end."""

    item: Item
    tables: tuple[Table, ...] = ()
    compared: tuple[Compared, ...] = ()
    figures: tuple[Shown, ...] = ()
    failed: str = ""

    @property
    def verdicts(self) -> tuple[str, ...]:
        """What was compared, how many agree and how closely, a line for each."""
        return summary(self.compared)

    @property
    def differs(self) -> bool:
        """True where something compared does not agree."""
        return not all(one.holds for one in self.compared)

    @property
    def anchor(self) -> str:
        """The item's place on the page."""
        return self.item.id.replace(" ", "-").replace(",", "")


@dataclass(frozen=True)
class PaperResult:
    """A paper with the results of its items."""

    loaded: LoadedPaper
    results: tuple[Result, ...]

    @property
    def compared(self) -> tuple[Compared, ...]:
        """All comparisons of the paper."""
        return tuple(one for result in self.results for one in result.compared)


def compare_paper(loaded: LoadedPaper, runs: Path, tell: Tell) -> tuple[PaperResult, int]:
    """Bring the runs of a paper up to date and compare each item; returns the result and the highest exit code of those that failed."""
    of = Runs(runs, loaded.folder)
    found, code = [], 0
    for item in loaded.spec.items:
        try:
            found.append(_result(item, loaded, of, tell))
        except (MapmoreError, OSError) as fault:
            code = max(code, fault.exit_code if isinstance(fault, MapmoreError) else 4)
            tell(f"{loaded.spec.paper}, {item.id}: {told(fault)}")
            found.append(Result(item, failed=told(fault)))
    return PaperResult(loaded, tuple(found)), code


def _result(item: Item, loaded: LoadedPaper, runs: Runs, tell: Tell) -> Result:
    tables: list[Table] = []
    compared: list[Compared] = []
    for one in item.compare:
        shown, verdicts = beside(one, loaded.folder / loaded.spec.tables, runs)
        tables += shown
        compared += verdicts
    if item.sentences:
        table, verdicts = sentences(item.sentences, runs)
        tables.append(table)
        compared += verdicts
    return Result(item, tuple(tables), tuple(compared), tuple(_drawn(item, runs, tell)))


def _drawn(item: Item, runs: Runs, tell: Tell) -> Sequence[Shown]:
    found = []
    for one in item.figures:
        text = drawn_figure(runs.run_dir(one.run), one.figure, one.panel, "svg", tell)[0].decode()
        found.append(Shown(text[text.index("<svg") :], one.caption))
    return found


def overview(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each paper, kinds apart: agreeing of compared."""
    kinds = ("value", "size", "order", "bound", "word", "sentence")
    rows = []
    for paper in papers:
        found = counts(paper.compared)
        cells = (f"{found[kind][0]} of {found[kind][1]}" if kind in found else None for kind in kinds)
        status = [result.item.status for result in paper.results]
        rows.append((paper.loaded.spec.paper, len(status), status.count("absent"), *cells))
    columns = (Column("paper"), Column("items"), Column("absent"), *(Column(f"{kind}s that agree") for kind in kinds))
    note = "A size agrees within a factor, a value within a distance, an order where all ranks are the same: they are not added up."
    return Table("papers", "What was compared", columns, tuple(rows), (note,))


def items_table(paper: PaperResult) -> Table:
    """Every equation, table and figure of a paper: where it is here, its status, and what came out."""
    rows = tuple(
        (
            result.item.id,
            result.item.title,
            result.item.status,
            ", ".join(result.item.place),
            result.failed or "; ".join(result.verdicts) or None,
        )
        for result in paper.results
    )
    spec = paper.loaded.spec
    heads = (Column("item"), Column("what"), Column("status"), Column("place"), Column("compared"))
    return Table(f"items_{spec.paper}", f"{spec.paper}: every equation, table and figure", heads, rows)


def verdicts_table(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each item, and how closely it agrees; a row for each kind and quantity."""
    rows = tuple(
        (paper.loaded.spec.paper, result.item.id, line)
        for paper in papers
        for result in paper.results
        for line in ((f"failed: {result.failed.splitlines()[0]}",) if result.failed else result.verdicts)
    )
    return Table("verdicts", "How closely", (Column("paper"), Column("item"), Column("what agrees")), rows)


def document(papers: Sequence[PaperResult]) -> dict[str, Any]:
    """Return the results for programs."""
    return {
        "papers": [
            {
                "paper": paper.loaded.spec.paper,
                "counts": {kind: {"agree": agree, "compared": every} for kind, (agree, every) in counts(paper.compared).items()},
                "items": [
                    {
                        "id": result.item.id,
                        "status": result.item.status,
                        "place": result.item.place,
                        "verdicts": list(result.verdicts),
                        "failed": result.failed or None,
                    }
                    for result in paper.results
                ],
            }
            for paper in papers
        ]
    }


def page(papers: Sequence[PaperResult]) -> str:
    """Return the page as HTML, one file that loads nothing."""
    return (
        environment()
        .get_template("paper.html")
        .render(version=__version__, overview=overview(papers), papers=[(paper, items_table(paper)) for paper in papers])
    )
