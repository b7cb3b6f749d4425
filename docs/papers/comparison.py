"""Published tables and claims beside numbers of our runs, verdicts by declared rules, and the page
over papers.

Values, sizes, orders, bounds, words and claims are counted apart, inputs and settings by
themselves, and each says how closely it agrees.
"""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from claims import CLOSE, Judge
from jinja2 import ChoiceLoader, FileSystemLoader
from our_numbers import Cell, Row, Runs, as_float, cell_value, csv_rows
from paper import Claim, Comparison, Item, LoadedPaper, Ours, PaperError, Shown, Verdict
from scipy.stats import kendalltau

from mapmore_cli import __version__
from mapmore_cli.domain.errors import MapmoreError
from mapmore_cli.pipeline.report import drawn_figure
from mapmore_cli.reporting.table import Column, Table, environment

HERE = Path(__file__).parent
PUBLISHED = HERE / "published"
"""Tables that the papers print, as printed."""

WORDS = {
    "value": "{what}: {count} values within {rule:g} (off by {span})",
    "size": "{what}: {count} sizes within a factor of {rule:g} (ours are {span} of the printed)",
    "order": "order by {what}: {count} as printed (mean tau {mean:.2f})",
    "bound": "{what}: {count} beyond the printed bound (ours are {span} of it)",
    "word": "{what}: {count} are the same",
    "claim": "claims: {count} hold",
    "input": "{what}: {count} inputs as printed",
    "setting": "{what}: {count} settings as printed",
}
"""What is said of comparisons, by kind."""


@dataclass(frozen=True)
class Compared:
    """One comparison: what kind, of what, whether it holds, and how closely.

    `closeness` is the distance of a value, ours to the printed one of a size and a bound, and
    Kendall's tau of an order.
    """

    kind: str
    what: str
    holds: bool
    closeness: float = math.nan
    rule: float = 0.0

    @property
    def word(self) -> str:
        """The verdict in a table."""
        return "agrees" if self.holds else "differs"


def judged(rule: Verdict, what: str, printed: Cell, ours: Cell) -> Compared:
    """Compare two cells by a rule that needs no others; a number that is missing agrees with
    nothing.
    """
    if rule.same:
        return Compared("word", what, str(printed) == str(ours))
    theirs, mine = as_float(printed), as_float(ours)
    if rule.within is not None:
        distance = abs(mine - theirs)
        return Compared("value", what, distance <= rule.within, distance, rule.within)
    ratio = mine / theirs if theirs else math.nan
    if rule.factor is not None:
        return Compared("size", what, 1 / rule.factor <= ratio <= rule.factor, ratio, rule.factor)
    holds = mine >= theirs if rule.bound == "at_least" else mine <= theirs
    return Compared("bound", what, holds, ratio)


def summary_lines(compared: Sequence[Compared]) -> tuple[str, ...]:
    """Say of each kind how many agree, what was compared, and how closely."""
    lines = []
    for kind, what, rule in dict.fromkeys((one.kind, one.what, one.rule) for one in compared):
        group = [one for one in compared if (one.kind, one.what, one.rule) == (kind, what, rule)]
        count = f"{sum(one.holds for one in group)} of {len(group)}"
        close = [one.closeness for one in group if math.isfinite(one.closeness)] or [math.nan]
        span = " to ".join(dict.fromkeys(f"{end:.3g}" for end in (min(close), max(close))))
        words = WORDS[kind]
        if kind in ("value", "size", "order", "bound") and math.isnan(close[0]):
            words = "{what}: {count} agree"
        mean = sum(close) / len(close)
        lines.append(words.format(what=what, count=count, rule=rule, span=span, mean=mean))
    return tuple(lines)


def counts(compared: Sequence[Compared]) -> dict[str, tuple[int, int]]:
    """How many agree, and how many were compared, by kind."""
    agreeing = Counter(one.kind for one in compared if one.holds)
    return {kind: (agreeing[kind], n) for kind, n in Counter(one.kind for one in compared).items()}


def beside(
    one: Comparison, tables: Path, root: Path, runs: Runs
) -> tuple[list[Table], list[Compared]]:
    """Return the tables and the verdicts of a comparison; raises PaperError for a published table,
    a column or a row that is not there.
    """
    own, shipped = (folder / one.published for folder in (tables, PUBLISHED))
    printed = _printed_rows(shipped if shipped.is_file() and not own.is_file() else own, one.where)
    columns: list[tuple[Column, Sequence[Cell]]] = [
        (Column(label), [row[label] for row in printed]) for label in one.labels
    ]
    compared = list[Compared]()
    orders: list[Table] = []
    for number in one.numbers:
        wanted = one.ours.model_copy(update={"rows": {**one.ours.rows, **number.rows}})
        theirs = [cell_value(number.printed, row) for row in printed]
        ours = [cell_value(number.ours, row) for row in _rows_beside(wanted, printed, root, runs)]
        columns.append((Column(f"{number.name}, printed", number.unit), theirs))
        columns.append((Column("ours", number.unit), ours))
        rule = number.verdict
        if rule is None:
            continue
        pairs = list(zip(theirs, ours, strict=True))
        if rule.order is not None:
            table, verdicts = _ordered(number.name, rule.order, one.labels, printed, pairs)
            orders.append(table)
        else:
            verdicts = [judged(rule, number.name, *pair) for pair in pairs]
            columns.append((Column(_rule_words(rule)), [verdict.word for verdict in verdicts]))
        compared += verdicts
    heads, cells = zip(*columns, strict=True)
    rows = zip(*cells, strict=True)
    table = Table.of(Path(one.published).stem, one.title, heads, rows, *one.notes)
    if one.role != "result":
        compared = [replace(verdict, kind=one.role) for verdict in compared]
    return [table, *orders], compared


def _rule_words(rule: Verdict) -> str:
    if rule.within is not None:
        return f"within {rule.within:g}"
    if rule.factor is not None:
        return f"within a factor of {rule.factor:g}"
    return "the same" if rule.same else f"{(rule.bound or '').replace('_', ' ')} the printed"


def _printed_rows(path: Path, where: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Return the rows of a published table that are asked for, all texts."""
    kept = csv_rows(path).kept(where)
    if not kept:
        raise PaperError(f"{path.name}: no row is left: mend `where`")
    return [{name: str(cell) for name, cell in row.items()} for row in kept]


def _rows_beside(
    ours: Ours, printed: Sequence[Mapping[str, str]], root: Path, runs: Runs
) -> list[Row]:
    """Return a row of ours for each printed one: the total of those it asks for, or the next that
    no printed row has taken.
    """
    taken: Counter[str] = Counter()
    pairs: list[Row] = []
    for row in printed:
        rows = runs.rows(ours, row, root)
        key = repr(rows)
        turn = 0 if ours.total else taken[key]
        taken[key] += 1
        if turn >= len(rows):
            raise PaperError(
                f"table {ours.table!r}: {len(rows)} rows of ours for the printed row "
                f"{', '.join(row.values())}: mend `rows`"
            )
        pair = rows[turn]
        if ours.total:
            pair = {name: sum(as_float(cell_value(name, one)) for one in rows) for name in pair}
        pairs.append(pair)
    return pairs


def _ordered(
    what: str,
    groups: Sequence[str],
    labels: Sequence[str],
    printed: Sequence[Mapping[str, str]],
    pairs: Sequence[tuple[Cell, Cell]],
) -> tuple[Table, list[Compared]]:
    """Return the orders within each group, least first, and whether their ranks are the same; an
    order of one is none.
    """
    members: dict[str, list[tuple[str, float, float]]] = {}
    for row, (theirs, ours) in zip(printed, pairs, strict=True):
        name = " ".join(row[label] for label in labels if label not in groups)
        group = ", ".join(row[label] for label in groups)
        members.setdefault(group, []).append((name, as_float(theirs), as_float(ours)))
    rows, compared = list[tuple[Cell, ...]](), list[Compared]()
    for group, ranked in members.items():
        numbers = np.array([sides for _, *sides in ranked])
        tau = float(kendalltau(*numbers.T).statistic)
        verdict = Compared("order", what, tau > 1 - 1e-9, tau)
        orders = np.argsort(numbers, axis=0, kind="stable").T
        texts = [" < ".join(ranked[i][0] for i in order) for order in orders]
        rows.append((group, *texts, tau, verdict.word))
        compared.append(verdict)
    columns = (Column(", ".join(groups)), "printed", "ours", "Kendall's tau .2f", "order")
    return Table.of("order", f"Order by {what}, least first", columns, rows), compared


# The page
# --------------------------------------------------------------------------------------------------


@dataclass
class Told:
    """A claim or a reason beside its numbers; `failed` says why where its runs did not end."""

    shown: Shown
    holds: bool | None = None
    numbers: str = ""
    failed: str = ""

    @property
    def verdict(self) -> str:
        """The verdict in a table."""
        if self.failed:
            return "failed"
        if self.holds is None:
            return "untold"
        return "holds" if self.holds else "does not hold"

    @property
    def compared(self) -> list[Compared]:
        """What it counts as, among what was compared; nothing where no number speaks to it."""
        if not isinstance(self.shown, Claim) or (self.holds is None and not self.failed):
            return []
        kind = self.shown.role if self.shown.role != "result" else "claim"
        return [Compared(kind, "claims", bool(self.holds))]


@dataclass
class Result:
    """An item with what was compared, and its figures as SVG with their captions; `failed` says
    why where its runs did not end.
    """

    item: Item
    tables: list[Table] = field(default_factory=list)
    compared: list[Compared] = field(default_factory=list)
    figures: list[tuple[str, str]] = field(default_factory=list)
    reasons: list[Told] = field(default_factory=list)
    failed: str = ""

    @property
    def verdicts(self) -> tuple[str, ...]:
        """What was compared, how many agree and how closely, a line for each."""
        return summary_lines(self.compared)

    @property
    def differs(self) -> bool:
        """True where something compared does not agree."""
        return not all(one.holds for one in self.compared)


@dataclass(frozen=True)
class PaperResult:
    """A paper with the results of its items, and its claims."""

    loaded: LoadedPaper
    results: tuple[Result, ...]
    claims: tuple[Told, ...]

    @property
    def compared(self) -> list[Compared]:
        """All comparisons of the paper, and its claims."""
        of_items = [one for result in self.results for one in result.compared]
        return of_items + [one for claim in self.claims for one in claim.compared]

    @property
    def reasons(self) -> list[Told]:
        """Every explanation of a difference."""
        return [one for result in self.results for one in result.reasons]

    def claims_of(self, item: str) -> list[Told]:
        """Return the claims whose place is an item."""
        return [
            claim
            for claim in self.claims
            if isinstance(claim.shown, Claim) and item in claim.shown.place
        ]

    def has_section(self, one: Result) -> bool:
        """Return True where there is more to show of an item than a row of the table of items."""
        claims = self.claims_of(one.item.id)
        return bool(one.tables or one.figures or one.reasons or one.failed or claims)

    def links(self, places: Sequence[str], page: Path) -> Iterator[tuple[str, str]]:
        """Yield places with where each is, seen from the page: items on it, others as files."""
        ids = {result.item.id for result in self.results}
        for place in places:
            file = self.loaded.folder / self.loaded.spec.root / place.partition("#")[0]
            away = Path(os.path.relpath(file, page.parent)).as_posix()
            yield place, f"#{self.anchor(place)}" if place in ids else away

    def anchor(self, item: str) -> str:
        """Return an item's place on the page."""
        return f"{self.loaded.spec.paper}-{item}".replace(" ", "-").replace(",", "")


def compare_paper(
    loaded: LoadedPaper, runs: Path, tell: Callable[[str], None]
) -> tuple[PaperResult, int]:
    """Bring the runs of a paper up to date, compare each item and judge each claim; return the
    result and the highest exit code of those that failed.
    """
    spec, of, codes = loaded.spec, Runs(runs, loaded.folder), [0]
    judge = Judge(of, spec.sources, loaded.folder / spec.root)

    @contextmanager
    def noted(what: str, one: Told | Result) -> Iterator[None]:
        try:
            yield
        except (MapmoreError, PaperError, OSError) as fault:
            codes.append(getattr(fault, "exit_code", 3))
            one.failed = str(fault)
            tell(f"{spec.paper}, {what}: {one.failed}")

    def spoken(shown: Shown) -> Told:
        one = Told(shown)
        if shown.holds:
            with noted(shown.says, one):
                one.holds, one.numbers = judge.judged(shown)
        return one

    results = [Result(item, reasons=[*map(spoken, item.why)]) for item in spec.items]
    for result in results:
        with noted(result.item.id, result):
            _fill(result, loaded, of, tell)
    return PaperResult(loaded, tuple(results), tuple(map(spoken, spec.claims))), max(codes)


def _fill(result: Result, loaded: LoadedPaper, runs: Runs, tell: Callable[[str], None]) -> None:
    """Compare an item with its runs, and draw its figures."""
    for one in result.item.compare:
        folder, spec = loaded.folder, loaded.spec
        tables, verdicts = beside(one, folder / spec.tables, folder / spec.root, runs)
        result.tables += tables
        result.compared += verdicts
    for figure in result.item.figures:
        if figure.run is None:
            path = loaded.folder / loaded.spec.root / str(figure.file)
            svg = path.read_text(encoding="utf-8")
        else:
            what = (figure.figure, figure.panel, "svg", tell)
            data, _ = drawn_figure(runs.run_dir(figure.run), *what, models=figure.models)
            svg = data.decode()
        result.figures.append((svg[svg.index("<svg") :], figure.caption))


def overview(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each paper, kinds apart: agreeing of compared."""
    rows: list[tuple[Cell, ...]] = []
    for paper in papers:
        agreeing = {kind: f"{a} of {n}" for kind, (a, n) in counts(paper.compared).items()}
        status = [result.item.status for result in paper.results]
        untold = sum(claim.verdict == "untold" for claim in paper.claims)
        because = f"{sum(bool(one.holds) for one in paper.reasons)} of {len(paper.reasons)}"
        head = (paper.loaded.spec.paper, len(status), status.count("absent"))
        cells = map(agreeing.get, WORDS)
        rows.append((*head, *cells, untold, because))
    kinds = (f"{kind}s that {'hold' if kind == 'claim' else 'agree'}" for kind in WORDS)
    last = ("untold claims", "explanations that hold")
    notes = (
        "A size agrees within a factor, a value within a distance, an order where all ranks are "
        "the same: they are not added up. Inputs and settings were put in; the others came out.",
        f"In claims, < and > are taken as they stand, and ~ is within a factor of {CLOSE:g}.",
    )
    columns = ("paper", "items", "absent", *kinds, *last)
    return Table.of("papers", "What was compared", columns, rows, *notes)


def verdicts_table(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each item, and how closely it agrees, a row for each kind and
    quantity; and every claim.
    """
    rows: list[tuple[Cell, ...]] = []
    for paper in papers:
        name = paper.loaded.spec.paper
        for result in paper.results:
            failed = result.failed.partition("\n")[0]
            lines = [f"failed: {failed}"] if failed else result.verdicts
            rows += [(name, result.item.id, line) for line in lines]
        rows += [
            (name, "claim", f"{one.verdict}: {one.shown.says} {one.numbers}".strip())
            for one in paper.claims
        ]
    return Table.of("verdicts", "How closely", ("paper", "item", "what agrees"), rows)


def page(papers: Sequence[PaperResult], target: Path) -> str:
    """Return the page as HTML, one file that loads nothing; `target` is where it will be."""
    reports = environment()  # which have the frame and the tables
    assert reports.loader is not None
    loader = ChoiceLoader([FileSystemLoader(HERE), reports.loader])
    template = reports.overlay(loader=loader).get_template("papers.html")
    return template.render(
        version=__version__, overview=overview(papers), papers=papers, target=target
    )
