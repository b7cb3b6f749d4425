"""A paper: its equations, tables, figures and claims, where each is here, and which numbers of ours
speak to it.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

import yaml
from annotated_types import Gt
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator


class PaperError(Exception):
    """A paper, a published table or a number of ours that is not as it should be."""


_ID = re.compile(r"(equation|table|figure|text) (\d+)(?:([a-z])|(?: to (\d+)))?(?:, .*)?")
REFERENCE = re.compile(r"(?:(least|greatest|mean) )?([A-Za-z_]\w*)\[([^\]]*)\]\.(\w+)")
"""A number in an inequality: `SOURCE[ROW].COLUMN`; the least, greatest or mean of several rows,
as `ROW|ROW` or with `*`.
"""
RELATION = re.compile(r"\s([<>~])\s")

Role = Literal["result", "input", "setting"]
"""What agrees is a result, or was put in: an input of the experiment, a setting of the method."""


class Section(BaseModel):
    """Base of every part of a paper: closed and immutable."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    def _faults(self) -> Iterator[str]:
        """Yield what does not fit each other within the section."""
        yield from ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for fault in self._faults():
            raise ValueError(fault)
        return self


class Verdict(Section):
    """When a number of ours agrees with a printed one: exactly one of the keys."""

    within: Annotated[float, Gt(0)] | None = None  # the greatest distance, in the printed unit
    factor: Annotated[float, Gt(1)] | None = (
        None  # within which sizes are of each other, with one sign
    )
    order: list[str] | None = (
        None  # the columns whose groups are ordered by the numbers, least first
    )
    bound: Literal["at_least", "at_most"] | None = None  # what the printed number is to ours
    same: Literal[True] | None = None  # words

    def _faults(self) -> Iterator[str]:
        if len(self.model_fields_set) != 1:
            yield "a verdict has one rule: give `within`, `factor`, `order`, `bound` or `same`"


class OfRun(Section):
    """What is of a `run`, or a `file` below the paper's `root` that a command wrote."""

    run: str | None = None
    file: str | None = None

    def _faults(self) -> Iterator[str]:
        if (self.run is None) == (self.file is None):
            kind = "figure is of" if isinstance(self, Drawn) else "source is"
            yield f"a {kind} a `run` or a `file`: give one of them"


class Ours(OfRun):
    """Rows of a table of a run (its scores, or any table of its page, by its name there), or of a
    CSV file.

    Texts in `run` and `rows` may hold `{column}` of the printed row; printed rows that ask for the
    same rows take them in turn.
    """

    table: str = "scores"
    rows: dict[str, str] = {}  # which: texts by column
    total: bool = False  # adds up the numbers of these rows


class Source(OfRun):
    """A table that inequalities take numbers from: of a `run` (by default the pooled scores on
    held-out data), or a CSV `file`.

    `rows` keeps the rows with these texts; the texts in the columns of `key` name a row.
    """

    table: str = "scores"
    along: str = ""  # the quantity that `shapes` go along
    rows: dict[str, str] = {}
    key: Annotated[list[str], Field(min_length=1)] = ["model"]

    @property
    def kept(self) -> dict[str, str]:
        """The texts by column that rows must have."""
        scores = self.run is not None and self.table == "scores"
        return {"split": "validate", "curve": "all", **self.rows} if scores else self.rows


class Number(Section):
    """Two numbers side by side, each a column or an expression of columns; names of columns of ours
    are written with underscores.
    """

    name: str
    unit: str = ""
    printed: str
    ours: str
    rows: dict[str, str] = {}  # beside those of the comparison
    verdict: Verdict | None = None


class Comparison(Section):
    """A published table beside ours, row by row. `where` keeps rows of it; `labels` are the columns
    that name a row.
    """

    title: str
    published: str
    where: dict[str, list[str]] = {}
    labels: Annotated[list[str], Field(min_length=1)]
    ours: Ours
    numbers: Annotated[list[Number], Field(min_length=1)]
    role: Role = "result"
    notes: list[str] = []


class Shown(Section):
    """What is said, and the inequalities of our numbers that all hold where it is true.

    `static[mapmore].rmse < static[sarosi].rmse < 20`: columns of rows of the paper's `sources`.
    `a ~ b`: within a quarter of each other.
    """

    says: str
    holds: list[str] = []

    @property
    def inequalities(self) -> list[str]:
        """All that must hold."""
        return self.holds

    def _faults(self) -> Iterator[str]:
        yield from self._no_inequality(self.holds)

    def _no_inequality(self, texts: Sequence[str]) -> Iterator[str]:
        for text in texts:
            if not RELATION.search(text):
                yield f"{text!r} is no inequality: write <, > or ~ between numbers"


class Reason(Shown):
    """Why ours differs: numbers that the explanation gives (`holds`), the next best explanation
    (`rival`), and numbers that the rival would not give (`against`).

    An explanation that fits the facts as well as another explains nothing, so that all three are
    asked for.
    """

    rival: str = ""
    against: list[str] = []

    def _faults(self) -> Iterator[str]:
        yield from super()._faults()
        yield from self._no_inequality(self.against)
        if not (self.holds and self.rival and self.against):
            yield (
                "an explanation needs `holds`, the `rival` explanation, and inequalities "
                "`against` it that the rival would not give"
            )

    @property
    def inequalities(self) -> list[str]:
        """All that must hold."""
        return [*self.holds, *self.against]


class Claim(Shown):
    """A claim of the paper in our words: the sections that make it (`of`), and where it is here
    (`place`: items of the paper, or files below its `root`).

    A claim that no number of ours speaks to has the reason in `untold`.
    """

    of: str
    place: Annotated[list[str], Field(min_length=1)]
    untold: str = ""
    role: Role = "result"

    def _faults(self) -> Iterator[str]:
        yield from super()._faults()
        if bool(self.holds) == bool(self.untold):
            yield "a claim has a verdict: give `holds`, or `untold` with the reason"


class Drawn(OfRun):
    """A figure of a run, all of it or one panel, or an SVG `file`. `models` are those that it
    shows, where that is not all of the run.
    """

    figure: str = "fit"
    panel: str | None = None
    models: list[str] = []
    caption: str


class Item(Section):
    """An equation, a table, a figure or a passage of the paper, as `figure 3`, `equation 2 to 9` or
    `text 1, section IV.B`.

    `computed`: the program computes it; `compared`: our numbers stand beside it; `drawn`: our
    figure does; `told`: a page tells of it. `place` lists files where it is, from the paper's
    `root`; after a `#` stand words that the file holds.
    """

    id: Annotated[str, Field(pattern=rf"^{_ID.pattern}$")]
    title: str
    status: Literal["computed", "compared", "drawn", "told", "absent"]
    place: Annotated[list[str], Field(min_length=1)]
    note: str = ""  # how it is read, or why it is not here
    why: list[Reason] = []  # it differs
    compare: list[Comparison] = []
    figures: list[Drawn] = []

    def _faults(self) -> Iterator[str]:
        if self.status == "drawn" and not self.figures:
            yield "no figure is drawn: give `figures`"
        if self.status == "absent" and not self.note:
            yield "absent without a reason: give `note`"

    @property
    def stands_for(self) -> tuple[tuple[str, int], ...]:
        """Kind and number of all that it lists."""
        found = _ID.fullmatch(self.id)
        assert found is not None
        kind, first, _, last = found.groups()
        return tuple((kind, number) for number in range(int(first), int(last or first) + 1))


class Paper(Section):
    """A paper. `has` counts what it numbers: each of these must be among the `items`."""

    schema_version: Literal[1] = 1
    paper: str
    title: str
    has: dict[Literal["equation", "table", "figure"], Annotated[int, Field(ge=0, le=200)]]
    root: str = "."  # where places start
    tables: str = "."  # where published tables are that do not ship with the program
    sources: dict[str, Source] = {}
    items: Annotated[list[Item], Field(min_length=1)]
    claims: list[Claim] = []


@dataclass(frozen=True)
class LoadedPaper:
    """A paper, and the folder that its paths start at."""

    spec: Paper
    folder: Path


def load_paper(path: Path) -> LoadedPaper:
    """Read a paper; raises PaperError for every mistake at once, also a numbered item that is not
    listed, and a place or a source that is not there.
    """
    try:
        paper = Paper.model_validate(yaml.safe_load(path.read_text(encoding="utf-8")))
    except ValidationError as fault:
        mistakes = [
            f"{'.'.join(map(str, one['loc']))}: {one['msg']}"
            for one in fault.errors(include_url=False)
        ]
    except (OSError, yaml.YAMLError) as fault:
        raise PaperError(f"{path} cannot be read: {fault}") from fault
    else:
        mistakes = list(_mistakes(paper, path.parent))
    if mistakes:
        raise PaperError("\n".join(f"{path}: {one}" for one in mistakes))
    return LoadedPaper(paper, path.parent)


def _mistakes(paper: Paper, folder: Path) -> Iterator[str]:
    listed = {one for item in paper.items for one in item.stands_for}
    counted = ((kind, n + 1) for kind, count in paper.has.items() for n in range(count))
    for kind, number in counted:
        if (kind, number) not in listed:
            yield f"{kind} {number} is not listed: add an item with its status and its place"
    ids = {item.id for item in paper.items}
    spoken_of = {place for claim in paper.claims for place in claim.place}
    for item in paper.items:
        yield from _wrong_places(item.id, item.place, folder / paper.root)
        for reason in item.why:
            yield from _unknown_sources(item.id, paper, reason.inequalities)
        if item.status == "compared" and not item.compare and item.id not in spoken_of:
            yield f"{item.id} is compared with nothing: give `compare`, or a claim at this `place`"
    for claim in paper.claims:
        yield from _wrong_places(claim.says, claim.place, folder / paper.root, ids)
        yield from _unknown_sources(claim.says, paper, claim.holds)


def _wrong_places(
    what: str, places: Sequence[str], root: Path, items: Collection[str] = ()
) -> Iterator[str]:
    for place in places:
        name, _, words = place.partition("#")
        file = root / name
        if place in items:
            continue
        if not file.exists():
            yield f"{what}: there is no {file}; places start at the paper's `root`"
        elif words and words not in " ".join(file.read_text(encoding="utf-8").split()):
            yield f"{what}: {name} does not hold {words!r}"


def _unknown_sources(what: str, paper: Paper, texts: Sequence[str]) -> Iterator[str]:
    for text in texts:
        for _, name, *_ in REFERENCE.findall(text):
            if name not in paper.sources:
                known = ", ".join(paper.sources) or "none"
                yield f"{what}: there is no source {name!r}; there are {known}"
