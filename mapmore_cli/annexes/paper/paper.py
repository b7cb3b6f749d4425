"""Published tables and sentences beside numbers of our runs, verdicts by declared rules, and the
page over papers.

Values, sizes, orders, bounds, words and sentences are counted apart, and each says how closely it
agrees.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
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
from mapmore_cli.pipeline.report import collected, drawn_figure, report_slice
from mapmore_cli.pipeline.runner import bring_up_to_date
from mapmore_cli.reporting.table import Cell, Column, Table, environment
from mapmore_cli.reporting.tables import all_tables
from mapmore_cli.spec.campaign import (
    Comparison,
    Item,
    LoadedPaper,
    Ours,
    Sentence,
    Side,
    Verdict,
)
from mapmore_cli.spec.loader import load
from mapmore_cli.storage.run_folder import RunFiles
from mapmore_cli.storage.run_record import score_row

Row = Mapping[str, Cell]

PUBLISHED = Path(__file__).parent / "published"
"""Tables that the papers print, as printed; they ship with the program."""

WORDS = {
    "value": "{what}: {count} values within {rule:g} (off by {span})",
    "size": "{what}: {count} sizes within a factor of {rule:g} (ours are {span} of the printed)",
    "order": "order by {what}: {count} as printed (mean tau {mean:.2f})",
    "bound": "{what}: {count} beyond the printed bound (ours are {span} of it)",
    "word": "{what}: {count} are the same",
    "sentence": "sentences of the text: {count} hold",
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
    theirs, mine = _float(printed), _float(ours)
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
    groups: dict[tuple[str, str, float], list[Compared]] = {}
    for one in compared:
        groups.setdefault((one.kind, one.what, one.rule), []).append(one)
    lines = []
    for (kind, what, rule), group in groups.items():
        count = f"{sum(one.holds for one in group)} of {len(group)}"
        close = [one.closeness for one in group if math.isfinite(one.closeness)] or [math.nan]
        span = " to ".join(dict.fromkeys(f"{end:.3g}" for end in (min(close), max(close))))
        words = WORDS[kind]
        if kind not in ("word", "sentence") and math.isnan(close[0]):
            words = "{what}: {count} agree"
        mean = sum(close) / len(close)
        lines.append(words.format(what=what, count=count, rule=rule, span=span, mean=mean))
    return tuple(lines)


def counts(compared: Sequence[Compared]) -> dict[str, tuple[int, int]]:
    """How many agree, and how many were compared, by kind."""
    groups: dict[str, list[bool]] = {}
    for one in compared:
        groups.setdefault(one.kind, []).append(one.holds)
    return {kind: (sum(holds), len(holds)) for kind, holds in groups.items()}


def beside(one: Comparison, tables: Path, runs: Runs) -> tuple[list[Table], list[Compared]]:
    """Return the tables and the verdicts of a comparison; raises SpecError for a published table, a
    column or a row that is not there.
    """
    own, shipped = (folder / one.published for folder in (tables, PUBLISHED))
    printed = _printed_rows(shipped if shipped.is_file() and not own.is_file() else own, one.where)
    columns: list[tuple[Column, Sequence[Cell]]] = [
        (Column(label), [row[label] for row in printed]) for label in one.labels
    ]
    compared: list[Compared] = []
    orders: list[Table] = []
    for number in one.numbers:
        wanted = one.ours.model_copy(update={"rows": {**one.ours.rows, **number.rows}})
        theirs = [_cell_value(number.printed, row) for row in printed]
        ours = [_cell_value(number.ours, row) for row in _rows_beside(wanted, printed, runs)]
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
    return [table, *orders], compared


def _rule_words(rule: Verdict) -> str:
    if rule.within is not None:
        return f"within {rule.within:g}"
    if rule.factor is not None:
        return f"within a factor of {rule.factor:g}"
    return "the same" if rule.same else f"{(rule.bound or '').replace('_', ' ')} the printed"


def _printed_rows(path: Path, where: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Return the rows of a published table that are asked for, all texts."""
    try:
        with path.open(newline="", encoding="utf-8") as lines:
            names, *cells = csv.reader(lines)
            rows = [dict(zip(names, row, strict=True)) for row in cells]
    except (OSError, ValueError) as fault:
        raise SpecError(f"{path} is no table ({fault})", "give a CSV file with headings") from fault
    if unknown := sorted(set(where) - set(names)):
        raise SpecError(
            f"{path.name}: has no column {unknown[0]!r}", f"there are {', '.join(names)}"
        )
    kept = [row for row in rows if all(row[name] in texts for name, texts in where.items())]
    if not kept:
        raise SpecError(f"{path.name}: no row is left", "mend `where`")
    return kept


def _rows_beside(ours: Ours, printed: Sequence[Mapping[str, str]], runs: Runs) -> list[Row]:
    """Return a row of ours for each printed one: the total of those it asks for, or the next that
    no printed row has taken.
    """
    taken: Counter[str] = Counter()
    pairs: list[Row] = []
    for row in printed:
        rows = runs.rows(ours, row)
        key = repr(rows)
        turn = 0 if ours.total else taken[key]
        taken[key] += 1
        if turn >= len(rows):
            raise SpecError(
                f"table {ours.table!r}: {len(rows)} rows of ours for the printed row "
                f"{', '.join(row.values())}",
                "mend `rows`",
            )
        pair = rows[turn]
        if ours.total:
            numbers = [name for name, cell in pair.items() if isinstance(cell, int | float)]
            pair = {name: sum(_float(one[name]) for one in rows) for name in numbers}
        pairs.append(pair)
    return pairs


def _cell_value(text: str, row: Mapping[str, Cell] | Mapping[str, str]) -> Cell:
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
        members.setdefault(group, []).append((name, _float(theirs), _float(ours)))
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


def _float(cell: Cell) -> float:
    return float(cell) if isinstance(cell, int | float) else math.nan


def sentences_table(said: Sequence[Sentence], runs: Runs) -> tuple[Table, list[Compared]]:
    """Return sentences of the paper beside the numbers that speak to them."""

    def number(side: Side | float) -> float:
        if not isinstance(side, Side):
            return side
        rows = runs.rows(side.ours, {})
        if len(rows) != 1:
            raise SpecError(f"{side.value!r}: {len(rows)} rows of ours", "mend `ours.rows`")
        return _float(_cell_value(side.value, rows[0]))

    rows, compared = list[tuple[Cell, ...]](), list[Compared]()
    for one in said:
        left, right = number(one.left), number(one.right)
        verdict = Compared(
            "sentence", "sentences", left < right if one.relation == "<" else left > right
        )
        rows.append((one.says, f"{left:.4g} {one.relation} {right:.4g}", verdict.word))
        compared.append(verdict)
    columns = ("in the paper", "here it would be", "verdict")
    return Table.of("sentences", "What the text says", columns, rows), compared


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
        spec = _with_cells(ours.run, printed)
        path = self.folder / spec
        if path not in self._tables:
            self._tables[path] = _tables(self.run_dir(spec))
        tables = self._tables[path]
        if ours.table not in tables:
            raise SpecError(
                f"{path.name}: its run has no table {ours.table!r}",
                f"there are {', '.join(tables)}",
            )
        table = tables[ours.table]
        # as expressions write them
        names = [re.sub(r"[^A-Za-z0-9]+", "_", column.name).strip("_") for column in table.columns]
        if unknown := sorted(set(ours.rows) - set(names)):
            raise SpecError(
                f"{path.name}: table {ours.table!r} has no column {unknown[0]!r}",
                f"there are {', '.join(names)}",
            )
        wanted = {name: _with_cells(text, printed) for name, text in ours.rows.items()}
        rows = [dict(zip(names, row, strict=True)) for row in table.rows]
        return [row for row in rows if all(str(row[name]) == text for name, text in wanted.items())]


def _with_cells(text: str, printed: Mapping[str, str]) -> str:
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
    shown = all_tables(collected(report_slice(load(run_dir / "experiment.yaml").spec), run_dir))
    rows = [score_row(row) for row in RunFiles(run_dir).scores().scores]
    cells = (tuple(row.values()) for row in rows)
    scores = Table.of("scores", "Scores", [one.name for one in fields(Score)], cells)
    return {**{table.name: table for table in shown}, "scores": scores, "curves": _curves(run_dir)}


def _curves(run_dir: Path) -> Table:
    """Return the last wavelength of every quantity of every curve, its range and mean; `repeats`
    counts whole wavelengths in `seconds`.
    """
    names = ("curve", "quantity", "lowest", "highest", "mean", "seconds", "wavelength", "repeats")
    rows: list[tuple[Cell, ...]] = []
    for curve in RunFiles(run_dir).dataset().curves:
        steps = np.diff(curve.columns.get("time", np.empty(0)))
        step = float(np.median(steps)) if len(steps) else math.nan
        for name, values in curve.columns.items():
            last = values[-last_wavelength(values) :]
            ends = (float(last.min()), float(last.max()), float(last.mean()))
            seconds, wave = step * (len(values) - 1), step * len(last)
            repeats = seconds // wave if wave > 0 else math.nan
            rows.append((curve.id, name, *ends, seconds, wave, repeats))
    return Table.of("curves", "Curves", names, rows)


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
        return summary_lines(self.compared)

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
    def compared(self) -> list[Compared]:
        """All comparisons of the paper."""
        return [one for result in self.results for one in result.compared]


def compare_paper(
    loaded: LoadedPaper, runs: Path, tell: Callable[[str], None]
) -> tuple[PaperResult, int]:
    """Bring the runs of a paper up to date and compare each item; return the result and the highest
    exit code of those that failed.
    """
    of = Runs(runs, loaded.folder)
    results, code = [], 0
    for item in loaded.spec.items:
        try:
            results.append(_result(item, loaded, of, tell))
        except (MapmoreError, OSError) as fault:
            code = max(code, fault.exit_code if isinstance(fault, MapmoreError) else 4)
            tell(f"{loaded.spec.paper}, {item.id}: {told(fault)}")
            results.append(Result(item, failed=told(fault)))
    return PaperResult(loaded, tuple(results)), code


def _result(item: Item, loaded: LoadedPaper, runs: Runs, tell: Callable[[str], None]) -> Result:
    result = Result(item)
    for one in item.compare:
        tables, verdicts = beside(one, loaded.folder / loaded.spec.tables, runs)
        result.tables += tables
        result.compared += verdicts
    if item.sentences:
        table, verdicts = sentences_table(item.sentences, runs)
        result.tables.append(table)
        result.compared += verdicts
    for figure in item.figures:
        folder = runs.run_dir(figure.run)
        data, _ = drawn_figure(folder, figure.figure, figure.panel, "svg", tell)
        svg = data.decode()
        result.figures.append(Shown(svg[svg.index("<svg") :], figure.caption))
    return result


def overview(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each paper, kinds apart: agreeing of compared."""
    rows: list[tuple[Cell, ...]] = []
    for paper in papers:
        agreeing = {kind: f"{a} of {n}" for kind, (a, n) in counts(paper.compared).items()}
        status = [result.item.status for result in paper.results]
        cells = map(agreeing.get, WORDS)
        rows.append((paper.loaded.spec.paper, len(status), status.count("absent"), *cells))
    columns = ("paper", "items", "absent", *(f"{kind}s that agree" for kind in WORDS))
    note = (
        "A size agrees within a factor, a value within a distance, an order where all ranks "
        "are the same: they are not added up."
    )
    return Table.of("papers", "What was compared", columns, rows, note)


def _items_table(paper: PaperResult) -> Table:
    """Every equation, table and figure of a paper: where it is here, its status, and what came
    out.
    """
    name = paper.loaded.spec.paper
    rows: list[tuple[Cell, ...]] = []
    for one in paper.results:
        head = (one.item.id, one.item.title, one.item.status, ", ".join(one.item.place))
        rows.append((*head, one.failed or "; ".join(one.verdicts) or None))
    columns = ("item", "what", "status", "place", "compared")
    title = f"{name}: every equation, table and figure"
    return Table.of(f"items_{name}", title, columns, rows)


def verdicts_table(papers: Sequence[PaperResult]) -> Table:
    """Tabulate what was compared in each item, and how closely it agrees; a row for each kind and
    quantity.
    """
    rows: list[tuple[Cell, ...]] = []
    for paper in papers:
        for result in paper.results:
            failed = result.failed.partition("\n")[0]
            lines = [f"failed: {failed}"] if failed else result.verdicts
            rows += [(paper.loaded.spec.paper, result.item.id, line) for line in lines]
    return Table.of("verdicts", "How closely", ("paper", "item", "what agrees"), rows)


def page(papers: Sequence[PaperResult]) -> str:
    """Return the page as HTML, one file that loads nothing."""
    template = environment().get_template("paper.html")
    items = [(paper, _items_table(paper)) for paper in papers]
    return template.render(version=__version__, overview=overview(papers), papers=items)
