"""A table or some figures of a paper beside ours, with a verdict that is computed.

Numbers of another muscle agree in size within a factor of two, models agree in order when their errors do. The words for what differs
are in `reasons.md`; nothing here changes a number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path

from pages import printed, scores

from mapmore_cli.domain.scores import Score
from mapmore_cli.pipeline.report import drawn_figure
from mapmore_cli.reporting.table import Cell, Column, Table

SAME_SIZE = 2.0
"""Factor within which numbers of two muscles of one type are called of one size."""
AGREES, DIFFERS = "agrees", "differs"


@dataclass(frozen=True)
class Shown:
    """A figure of ours: which one of the paper it stands beside, and what it shows."""

    of: str
    caption: str
    svg: str


@dataclass(frozen=True)
class Result:
    """A table or some figures of a paper, beside ours.

    Attributes
    ----------
    id
        What the reasons call it, and the page's anchor.
    places
        Where in the paper.
    parts
        What is compared, and whether it agrees.
    specs
        The studies behind it, as paths below `configs/`.
    """

    id: str
    paper: str
    places: str
    title: str
    tables: tuple[Table, ...]
    parts: Sequence[tuple[str, bool]]
    figures: tuple[Shown, ...] = ()
    specs: tuple[str, ...] = ()

    @property
    def agreed(self) -> int:
        """How many parts agree."""
        return sum(holds for _, holds in self.parts)

    @property
    def verdict(self) -> str:
        """`agrees` where all parts do, else `differs: ` and what does; equal words are told once with their count."""
        wrong, every = [what for what, holds in self.parts if not holds], [what for what, _ in self.parts]
        if not wrong:
            return AGREES
        told = [f"{what} ({wrong.count(what)} of {every.count(what)})" if every.count(what) > 1 else what for what in dict.fromkeys(wrong)]
        return f"{DIFFERS}: {', '.join(told)}"

    @property
    def reason(self) -> str:
        """Why it differs; nothing where it agrees."""
        return "" if self.verdict == AGREES else reasons()[self.id]


@dataclass(frozen=True)
class Claim:
    """A sentence of a paper, the numbers here that speak to it, and whether they bear it out."""

    text: str
    here: str
    holds: bool


@cache
def reasons() -> dict[str, str]:
    """The paragraphs of `reasons.md` by their heading."""
    _, *parts = Path(__file__).with_name("reasons.md").read_text(encoding="utf-8").split("\n## ")
    return {head: " ".join(body.split()) for head, _, body in (part.partition("\n") for part in parts)}


def word(holds: bool) -> str:
    """The cell of a verdict."""
    return AGREES if holds else DIFFERS


def same_size(ours: float, theirs: float) -> bool:
    """Whether two numbers are within the factor of each other."""
    return 1 / SAME_SIZE <= ours / theirs <= SAME_SIZE


def order(errors: Mapping[str, float], sign: str = "<") -> str:
    """The models from the least error up."""
    return f" {sign} ".join(sorted(errors, key=errors.__getitem__))


def claimed(claims: Sequence[Claim]) -> list[tuple[str, bool]]:
    """Sentences as parts of a result."""
    return [("a sentence of the text", claim.holds) for claim in claims]


def claims_table(claims: Sequence[Claim], name: str) -> Table:
    """Sentences of a paper beside our numbers."""
    rows = tuple((claim.text, claim.here, word(claim.holds)) for claim in claims)
    return Table(name, "What the text says", (Column("in the paper"), Column("here"), Column("verdict")), rows)


def printed_beside(file: str, figures: Sequence[str], runs: Path) -> tuple[tuple[Table, ...], list[tuple[str, bool]]]:
    """The rows of a published table of errors beside those of the runs, and the order of the models of each study."""
    chosen = [row for row in printed(file) if row["figure"] in figures]
    rows: list[tuple[Cell, ...]] = []
    orders: list[tuple[Cell, ...]] = []
    parts: list[tuple[str, bool]] = []
    for study, group in groupby(chosen, key=lambda row: row["study"]):
        found, said = scores(runs / study, "validate"), list(group)
        ours = {row["model"]: _error(found[row["model"]], row["quantity"]) for row in said}
        theirs = {row["model"]: float(row["printed"]) for row in said}
        for row in said:
            mine, number = ours[row["model"]], theirs[row["model"]]
            bound = row["relation"] == ">="
            holds = mine >= number / SAME_SIZE if bound else same_size(mine, number)
            parts.append(("size", holds))
            rows.append((study, row["model"], f"{'at least ' if bound else ''}{number:g}", mine, mine / number, word(holds)))
        ranks = [order(theirs), order(ours)]
        parts.append(("order of the models", ranks[0] == ranks[1]))
        orders.append((study, *ranks, word(ranks[0] == ranks[1])))
    unit, quantity = chosen[0]["unit"], chosen[0]["quantity"].upper()
    columns = (
        Column("study"),
        Column("model"),
        Column("printed", unit),
        Column("ours", unit, ".4g"),
        Column("ours to printed", "", ".2f"),
        Column("size"),
    )
    title = f"{quantity} on held-out data (figure{'s' if len(figures) > 1 else ''} {' and '.join(figures)})"
    heads = (Column("study"), Column("printed"), Column("ours"), Column("order"))
    return (Table("errors", title, columns, tuple(rows)), Table("order", "From the least error up", heads, tuple(orders))), parts


def _error(score: Score, quantity: str) -> float:
    return 100 * score.nrmse if quantity == "nrmse" else score.rmse


def panel(runs: Path, study: str, figure: str, key: str | None, of: str, caption: str) -> Shown:
    """A figure of a run."""
    svg = drawn_figure(runs / study, figure, key, "svg", warn=print)[0].decode()
    return Shown(of, caption, svg[svg.index("<svg") :])


MUSCLES = {"dmsp-20-88": "McKibben", "peano": "Peano"}
LEVEL = {"dmsp-20-88": "250", "peano": "350"}
"""kPa, the pressure that is held out."""


def held_out_panels(runs: Path, suffix: str, figures: Mapping[str, str]) -> tuple[Shown, ...]:
    """Fit and error at the held-out pressure of both muscles; `figures` are the paper's numbers by muscle."""
    what = "measured and predicted at the held-out pressure, the errors below."
    return tuple(panel(runs, muscle + suffix, "fit", LEVEL[muscle], figures[muscle], f"{name}: {what}") for muscle, name in MUSCLES.items())
