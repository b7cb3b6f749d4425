"""Published tables and sentences beside numbers of our runs, verdicts by declared rules, and the
page over papers.

Values, sizes, orders, bounds, words and sentences are counted apart, and each says how closely it
agrees.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
from scipy.stats import kendalltau

from mapmore_cli import __version__
from mapmore_cli.annexes.motion.simulation import last_wavelength
from mapmore_cli.domain.errors import DataError, MapmoreError, SpecError, told
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling.expressions import ExpressionError, evaluate, parse
from mapmore_cli.pipeline.report import collected, drawn_figure, published_table, reads
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Cell, Column, Table, environment
from mapmore_cli.reporting.tables import all_tables
from mapmore_cli.spec.campaign import (
    Comparison,
    Item,
    LoadedPaper,
    Number,
    Ours,
    Sentence,
    Side,
    Verdict,
)
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.run_folder import RunFiles

Row = Mapping[str, Cell]

KINDS = ("value", "size", "order", "bound", "word", "sentence")
WORD = {True: "agrees", False: "differs"}


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
    rule: float = math.nan


def judged(rule: Verdict, what: str, printed: Cell, ours: Cell) -> Compared:
    """Compare two cells by a rule that needs no others; a number that is missing agrees with
    nothing.
    """
    if rule.same:
        return Compared("word", what, str(printed) == str(ours))
    theirs, mine = _float(printed), _float(ours)
    ratio = mine / theirs if theirs else math.nan
    if rule.within is not None:
        return Compared(
            "value", what, abs(mine - theirs) <= rule.within, abs(mine - theirs), rule.within
        )
    if rule.factor is not None:
        return Compared("size", what, 1 / rule.factor <= ratio <= rule.factor, ratio, rule.factor)
    return Compared(
        "bound", what, mine >= theirs if rule.bound == "at_least" else mine <= theirs, ratio
    )


def summary(found: Sequence[Compared]) -> tuple[str, ...]:
    """Say of each kind how many agree, what was compared, and how closely."""
    groups: dict[tuple[str, str, float], list[Compared]] = {}
    for one in found:
        groups.setdefault(
            (one.kind, one.what, -1.0 if math.isnan(one.rule) else one.rule), []
        ).append(one)
    return tuple(_told(kind, what, rule, group) for (kind, what, rule), group in groups.items())


def _told(kind: str, what: str, rule: float, group: Sequence[Compared]) -> str:
    count = f"{sum(one.holds for one in group)} of {len(group)}"
    close = [one.closeness for one in group if math.isfinite(one.closeness)]
    if kind == "sentence":
        return f"sentences of the text: {count} hold"
    if kind == "word":
        return f"{what}: {count} are the same"
    if not close:
        return f"{what}: {count} agree"
    low, high = f"{min(close):.3g}", f"{max(close):.3g}"
    span = low if low == high else f"{low} to {high}"
    match kind:
        case "value":
            return f"{what}: {count} values within {rule:g} (off by {span})"
        case "size":
            return (
                f"{what}: {count} sizes within a factor of {rule:g} (ours are {span} of the "
                "printed)"
            )
        case "order":
            return f"order by {what}: {count} as printed (mean tau {sum(close) / len(close):.2f})"
        case _:
            return f"{what}: {count} beyond the printed bound (ours are {span} of it)"


def counts(found: Sequence[Compared]) -> dict[str, tuple[int, int]]:
    """How many agree, and how many were compared, by kind."""
    kinds = dict.fromkeys(one.kind for one in found)
    return {
        kind: (sum(o.holds for o in found if o.kind == kind), sum(o.kind == kind for o in found))
        for kind in kinds
    }


def beside(one: Comparison, tables: Path, runs: Runs) -> tuple[list[Table], list[Compared]]:
    """Return the tables and the verdicts of a comparison; raises SpecError for a published table, a
    column or a row that is not there.
    """
    printed = _printed(tables / one.published, one.where)
    columns = [Column(label) for label in one.labels]
    shown: list[list[Cell]] = [[row[label] for label in one.labels] for row in printed]
    found: list[Compared] = []
    orders: list[Table] = []
    for number in one.numbers:
        ours = _paired(
            one.ours.model_copy(update={"rows": {**one.ours.rows, **number.rows}}), printed, runs
        )
        cells = [
            (_value(number.printed, p), _value(number.ours, o))
            for p, o in zip(printed, ours, strict=True)
        ]
        columns += [Column(f"{number.name}, printed", number.unit), Column("ours", number.unit)]
        for row, pair in zip(shown, cells, strict=True):
            row += pair
        if number.verdict is None:
            continue
        if number.verdict.order is not None:
            table, verdicts = _ordered(number, number.verdict.order, one.labels, printed, cells)
            orders.append(table)
        else:
            verdicts = [judged(number.verdict, number.name, *pair) for pair in cells]
            columns.append(Column(_heading(number.verdict)))
            for row, verdict in zip(shown, verdicts, strict=True):
                row.append(WORD[verdict.holds])
        found += verdicts
    table = Table(
        Path(one.published).stem,
        one.title,
        tuple(columns),
        tuple(map(tuple, shown)),
        tuple(one.notes),
    )
    return [table, *orders], found


def _heading(rule: Verdict) -> str:
    if rule.within is not None:
        return f"within {rule.within:g}"
    if rule.factor is not None:
        return f"within a factor of {rule.factor:g}"
    return "the same" if rule.same else f"{(rule.bound or '').replace('_', ' ')} the printed"


def _printed(path: Path, where: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Return the rows of a published table that are asked for, all texts."""
    table = published_table(path)
    names = [column.name for column in table.columns]
    if unknown := sorted(set(where) - set(names)):
        raise SpecError(
            f"{path.name}: has no column {unknown[0]!r}", f"there are {', '.join(names)}"
        )
    rows = [dict(zip(names, map(str, row), strict=True)) for row in table.rows]
    kept = [row for row in rows if all(row[name] in texts for name, texts in where.items())]
    if not kept:
        raise SpecError(f"{path.name}: no row is left", "mend `where`")
    return kept


def _paired(ours: Ours, printed: Sequence[Mapping[str, str]], runs: Runs) -> list[Row]:
    """Return a row of ours for each printed one: the total of those it asks for, or the next that
    no printed row has taken.
    """
    taken: dict[str, int] = {}
    found: list[Row] = []
    for row in printed:
        rows = runs.rows(ours, row)
        key = repr(rows)
        turn = 0 if ours.total else taken.get(key, 0)
        taken[key] = turn + 1
        if turn >= len(rows):
            raise SpecError(
                f"table {ours.table!r}: {len(rows)} rows of ours for the printed row "
                f"{', '.join(row.values())}",
                "mend `rows`",
            )
        numbers = [name for name, cell in rows[0].items() if isinstance(cell, int | float)]
        found.append(
            {name: sum(_float(one[name]) for one in rows) for name in numbers}
            if ours.total
            else rows[turn]
        )
    return found


def _value(text: str, row: Mapping[str, Cell] | Mapping[str, str]) -> Cell:
    """Return a column of a row, a number where it is one, or the value of an expression of its
    columns; SpecError where it is neither.
    """
    cells: dict[str, Cell] = {}
    for name, cell in row.items():
        try:
            cells[name] = (float(cell) if cell else None) if isinstance(cell, str) else cell
        except ValueError:
            cells[name] = cell
    if text in cells:
        return cells[text]
    numbers = {
        name: np.array([float(cell)])
        for name, cell in cells.items()
        if isinstance(cell, int | float)
    }
    try:
        return float(evaluate(parse(text), numbers, 1)[0])
    except (ExpressionError, KeyError, DataError, ValueError) as fault:
        raise SpecError(f"{text!r}: {fault}", f"there are {', '.join(row)}") from fault


def _ordered(
    number: Number,
    groups: Sequence[str],
    labels: Sequence[str],
    printed: Sequence[Mapping[str, str]],
    cells: Sequence[tuple[Cell, Cell]],
) -> tuple[Table, list[Compared]]:
    """Return the orders within each group, least first, and whether their ranks are the same; an
    order of one is none.
    """
    members: dict[tuple[str, ...], list[int]] = {}
    for k, row in enumerate(printed):
        members.setdefault(tuple(row[name] for name in groups), []).append(k)
    rest = [label for label in labels if label not in groups]
    rows, found = list[tuple[Cell, ...]](), list[Compared]()
    for group, places in members.items():
        pairs = np.array([[_float(cells[k][side]) for k in places] for side in (0, 1)])
        names = [" ".join(printed[k][label] for label in rest) for k in places]
        tau = float(kendalltau(*pairs).statistic)
        found.append(Compared("order", number.name, tau > 1 - 1e-9, tau))
        texts = [" < ".join(names[k] for k in np.argsort(side, kind="stable")) for side in pairs]
        rows.append((", ".join(group), *texts, tau, WORD[found[-1].holds]))
    heads = (
        Column(", ".join(groups)),
        Column("printed"),
        Column("ours"),
        Column("Kendall's tau", "", ".2f"),
        Column("order"),
    )
    return Table("order", f"Order by {number.name}, least first", heads, tuple(rows)), found


def _float(cell: Cell) -> float:
    return float(cell) if isinstance(cell, int | float) else math.nan


def sentences(said: Sequence[Sentence], runs: Runs) -> tuple[Table, list[Compared]]:
    """Return sentences of the paper beside the numbers that speak to them."""

    def number(side: Side) -> float:
        rows = runs.rows(side.ours, {})
        if len(rows) != 1:
            raise SpecError(f"{side.value!r}: {len(rows)} rows of ours", "mend `ours.rows`")
        return _float(_value(side.value, rows[0]))

    rows, found = list[tuple[Cell, ...]](), list[Compared]()
    for one in said:
        left, right = (
            number(one.left),
            number(one.right) if isinstance(one.right, Side) else one.right,
        )
        holds = left < right if one.relation == "<" else left > right
        found.append(Compared("sentence", "sentences", holds))
        rows.append((one.says, f"{left:.4g} {one.relation} {right:.4g}", WORD[holds]))
    heads = (Column("in the paper"), Column("here it would be"), Column("verdict"))
    return Table("sentences", "What the text says", heads, tuple(rows)), found


@dataclass
class Runs:
    """The runs that papers ask for, each brought up to date once; `folder` is where specs' paths
    start.
    """

    runs: Path
    folder: Path
    _tables: dict[Path, Mapping[str, Table]] = field(default_factory=dict)

    def run_dir(self, spec: str) -> Path:
        """Bring the run of a spec up to date and return its folder; raises as its stages do."""
        return bring_up_to_date(load(self.folder / spec), self.runs, "validate").run_dir

    def rows(self, ours: Ours, printed: Mapping[str, str]) -> list[Row]:
        """Return the rows of ours that a printed row stands beside, by column.

        Raises SpecError for a table or a column that the run does not have, or a `{column}` that
        the printed row does not have.
        """
        path = self.folder / _filled(ours.run, printed)
        if path not in self._tables:
            self._tables[path] = _tables(self.run_dir(_filled(ours.run, printed)))
        found = self._tables[path]
        if ours.table not in found:
            raise SpecError(
                f"{path.name}: its run has no table {ours.table!r}", f"there are {', '.join(found)}"
            )
        table = found[ours.table]
        names = [
            re.sub(r"[^A-Za-z0-9]+", "_", column.name).strip("_") for column in table.columns
        ]  # as expressions write them
        if unknown := sorted(set(ours.rows) - set(names)):
            raise SpecError(
                f"{path.name}: table {ours.table!r} has no column {unknown[0]!r}",
                f"there are {', '.join(names)}",
            )
        wanted = {name: _filled(text, printed) for name, text in ours.rows.items()}
        rows = [dict(zip(names, row, strict=True)) for row in table.rows]
        return [row for row in rows if all(str(row[name]) == text for name, text in wanted.items())]


def _filled(text: str, printed: Mapping[str, str]) -> str:
    try:
        return text.format_map(printed)
    except (KeyError, ValueError, IndexError, AttributeError) as fault:
        raise SpecError(
            f"{text!r}: names no column of the published table ({fault})",
            f"there are {', '.join(printed)}",
        ) from fault


def _tables(run_dir: Path) -> dict[str, Table]:
    """Return the tables of a run's page; `scores` has every row, under the names that the specs
    have, and `curves` what was measured.
    """
    shown = all_tables(collected(reads(load(run_dir / "experiment.yaml").spec), run_dir))
    names = [one.name for one in fields(Score)]
    rows = tuple(
        tuple(getattr(row, name) for name in names) for row in RunFiles(run_dir).scores().scores
    )
    scores = Table("scores", "Scores", tuple(map(Column, names)), rows)
    return {**{table.name: table for table in shown}, "scores": scores, "curves": _curves(run_dir)}


def _curves(run_dir: Path) -> Table:
    """Return the last wavelength of every quantity of every curve, its range and mean; `repeats`
    counts whole wavelengths in `seconds`.
    """
    names = ("curve", "quantity", "lowest", "highest", "mean", "seconds", "wavelength", "repeats")
    rows: list[tuple[Cell, ...]] = []
    for curve in RunFiles(run_dir).dataset().curves:
        time = curve.columns.get("time")
        step = (
            float(np.median(np.diff(time))) if time is not None and len(time) > 1 else float("nan")
        )
        for name, values in curve.columns.items():
            last = values[-last_wavelength(values) :]
            wave = step * len(last)
            numbers = (
                float(last.min()),
                float(last.max()),
                float(last.mean()),
                step * (len(values) - 1),
                wave,
            )
            rows.append(
                (curve.id, name, *numbers, numbers[3] // wave if wave > 0 else float("nan"))
            )
    return Table("curves", "Curves", tuple(map(Column, names)), tuple(rows))


# The page
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Shown:
    """A figure of ours, and what it shows."""

    svg: str
    caption: str


@dataclass
class Result:
    """An item with what was compared; `failed` says why where its runs did not end."""

    item: Item
    tables: list[Table] = field(default_factory=list)
    compared: list[Compared] = field(default_factory=list)
    figures: list[Shown] = field(default_factory=list)
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


def compare_paper(
    loaded: LoadedPaper, runs: Path, tell: Callable[[str], None]
) -> tuple[PaperResult, int]:
    """Bring the runs of a paper up to date and compare each item; return the result and the highest
    exit code of those that failed.
    """
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


def _result(item: Item, loaded: LoadedPaper, runs: Runs, tell: Callable[[str], None]) -> Result:
    found = Result(item)
    for one in item.compare:
        tables, verdicts = beside(one, loaded.folder / loaded.spec.tables, runs)
        found.tables += tables
        found.compared += verdicts
    if item.sentences:
        table, verdicts = sentences(item.sentences, runs)
        found.tables.append(table)
        found.compared += verdicts
    for drawn in item.figures:
        svg = drawn_figure(runs.run_dir(drawn.run), drawn.figure, drawn.panel, "svg", tell)[
            0
        ].decode()
        found.figures.append(Shown(svg[svg.index("<svg") :], drawn.caption))
    return found


def overview(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each paper, kinds apart: agreeing of compared."""
    rows = []
    for paper in papers:
        found = counts(paper.compared)
        cells = (
            f"{found[kind][0]} of {found[kind][1]}" if kind in found else None for kind in KINDS
        )
        status = [result.item.status for result in paper.results]
        rows.append((paper.loaded.spec.paper, len(status), status.count("absent"), *cells))
    columns = (
        Column("paper"),
        Column("items"),
        Column("absent"),
        *(Column(f"{kind}s that agree") for kind in KINDS),
    )
    note = (
        "A size agrees within a factor, a value within a distance, an order where all ranks "
        "are the same: they are not added up."
    )
    return Table("papers", "What was compared", columns, tuple(rows), (note,))


def _items_table(paper: PaperResult) -> Table:
    """Every equation, table and figure of a paper: where it is here, its status, and what came
    out.
    """
    name = paper.loaded.spec.paper
    rows = tuple(
        (
            one.item.id,
            one.item.title,
            one.item.status,
            ", ".join(one.item.place),
            one.failed or "; ".join(one.verdicts) or None,
        )
        for one in paper.results
    )
    heads = (Column("item"), Column("what"), Column("status"), Column("place"), Column("compared"))
    return Table(f"items_{name}", f"{name}: every equation, table and figure", heads, rows)


def verdicts_table(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each item, and how closely it agrees; a row for each kind and
    quantity.
    """
    rows = tuple(
        (paper.loaded.spec.paper, result.item.id, line)
        for paper in papers
        for result in paper.results
        for line in (
            (f"failed: {result.failed.splitlines()[0]}",) if result.failed else result.verdicts
        )
    )
    return Table(
        "verdicts", "How closely", (Column("paper"), Column("item"), Column("what agrees")), rows
    )


def page(papers: Sequence[PaperResult]) -> str:
    """Return the page as HTML, one file that loads nothing."""
    template = environment().get_template("paper.html")
    return template.render(
        version=__version__,
        overview=overview(papers),
        papers=[(paper, _items_table(paper)) for paper in papers],
    )
