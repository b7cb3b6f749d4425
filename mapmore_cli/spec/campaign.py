"""Files that name several studies.

A campaign is one spec run in several variants, or several specs, with one page over all. A paper
lists its equations, tables and figures, where each is here, and which numbers of ours stand beside
the printed ones.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

from annotated_types import Gt
from pydantic import Field

from mapmore_cli.domain.declared import Contradiction, Name
from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.domain.scores import FIGURES
from mapmore_cli.spec.diagnostics import Finding
from mapmore_cli.spec.experiment import Competitor, OtherSettings
from mapmore_cli.spec.fields import Section, SpecPath
from mapmore_cli.spec.loader import Loaded, load, load_as
from mapmore_cli.spec.yaml_loader import as_overrides, read_source


class Variant(Section):
    """One run of a campaign: a spec (the campaign's `base` by default), the run's `name`, and keys
    to `set` as `--set` does.
    """

    base: SpecPath | None = None
    name: Name | None = None
    group: str | None = None  # of whose runs the tables give the median and the worst
    set: OtherSettings = {}

    def _contradictions(self) -> Iterator[ValueError]:
        if self.base is None and self.name is None:
            yield Contradiction(
                "a variant of the campaign's base needs a `name`",
                "add it: every run has a folder of its own",
            )


class Campaign(Section):
    """The runs of a campaign, in the order of its tables."""

    schema_version: Literal[1] = 1
    campaign: Name
    title: str | None = None
    base: SpecPath | None = None
    runs: Annotated[list[Variant], Field(min_length=1)]
    relative_to: str | None = None  # the model that ratios are taken to
    best_of: list[
        str
    ] = []  # formulas of which the best in each run, picked afterwards, is compared with

    def _contradictions(self) -> Iterator[ValueError]:
        if self.base is None and any(run.base is None for run in self.runs):
            yield Contradiction(
                "a run has no spec", "give the campaign a `base`, or each run one", "runs"
            )


@dataclass(frozen=True)
class Entry:
    """A spec to run, with overrides as on the command line; `campaign` is the file that asks for
    it, where one does.
    """

    config: Path
    overrides: tuple[str, ...]
    campaign: Path | None = None


def is_campaign(path: Path) -> bool:
    """Return True where a YAML file has the key `campaign` at its top level."""
    try:
        lines = read_source(path).text.splitlines()
    except SpecError:
        return False  # loading it says why
    return any(line.startswith("campaign:") for line in lines)


def load_campaign(path: Path) -> tuple[Campaign, tuple[Entry, ...]]:
    """Read a campaign and the runs that it stands for; raises SpecError as `spec.loader.load`
    does.
    """
    loaded = load_as(path, Campaign)
    entries = []
    for run in loaded.spec.runs:
        named = {} if run.name is None else {"name": run.name}
        entries.append(
            Entry(
                loaded.folder / str(run.base or loaded.spec.base),
                as_overrides({**named, **run.set}),
            )
        )
    return loaded.spec, tuple(entries)


# Papers
# --------------------------------------------------------------------------------------------------

_ID = re.compile(r"(equation|table|figure|text) (\d+)(?:([a-z])|(?: to (\d+)))?(?:, .*)?")


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

    def _contradictions(self) -> Iterator[ValueError]:
        if len(self.model_fields_set) != 1:
            yield Contradiction(
                "a verdict has one rule", "give `within`, `factor`, `order`, `bound` or `same`"
            )


class Ours(Section):
    """Rows of a table of a run: its scores, or any table of its page, by its name there.

    Texts in `run` and `rows` may hold `{column}` of the printed row; printed rows that ask for the
    same rows take them in turn.
    """

    run: SpecPath
    table: str = "scores"
    rows: dict[str, str] = {}  # which: texts by column
    total: bool = False  # adds up the numbers of these rows


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
    notes: list[str] = []


class Side(Section):
    """A number of a run: an expression of the columns of one row."""

    ours: Ours
    value: str


class Sentence(Section):
    """A sentence of the paper as an inequality of our numbers."""

    says: str
    left: Side
    relation: Literal["<", ">"]
    right: float | Side


class Drawn(Section):
    """A figure of a run, all of it or one panel, and what it shows."""

    run: SpecPath
    figure: Literal[tuple(FIGURES)]  # type: ignore[valid-type]
    panel: str | None = None
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
    why: str = ""  # it differs, or is not here
    compare: list[Comparison] = []
    sentences: list[Sentence] = []
    figures: list[Drawn] = []

    def _contradictions(self) -> Iterator[ValueError]:
        if self.status == "compared" and not self.compare and not self.sentences:
            yield Contradiction("compared with nothing", "give `compare` or `sentences`", "status")
        if self.status == "drawn" and not self.figures:
            yield Contradiction("no figure is drawn", "give `figures`", "status")
        if self.status == "absent" and not self.why:
            yield Contradiction("absent without a reason", "give `why`", "status")

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
    paper: Name
    title: str
    has: dict[Literal["equation", "table", "figure"], Annotated[int, Field(ge=0, le=200)]]
    root: SpecPath = "."  # where places start
    tables: SpecPath = "."  # where published tables are that do not ship with the program
    items: Annotated[list[Item], Field(min_length=1)]


LoadedPaper = Loaded[Paper]


def load_paper(path: Path) -> LoadedPaper:
    """Read a paper; raises SpecError for every mistake at once, also a numbered item that is not
    listed, and a place that is not there.
    """
    return load_as(path, Paper, check=lambda paper: _findings(paper, path.parent))


def _findings(paper: Paper, folder: Path) -> Iterator[Finding]:
    listed = {one for item in paper.items for one in item.stands_for}
    for kind, count in paper.has.items():
        for number in range(1, count + 1):
            if (kind, number) not in listed:
                yield Finding(
                    ("items",),
                    f"{kind} {number} is not listed",
                    "add an item with its status and its place",
                    on_key=True,
                )
    for k, item in enumerate(paper.items):
        for j, place in enumerate(item.place):
            name, _, words = place.partition("#")
            file = folder / paper.root / name
            if not file.exists():
                yield Finding(
                    ("items", k, "place", j),
                    f"there is no {file}",
                    "places start at the paper's `root`",
                )
            elif words and words not in " ".join(file.read_text(encoding="utf-8").split()):
                yield Finding(
                    ("items", k, "place", j),
                    f"{name} does not hold {words!r}",
                    "name words that stand there",
                )


@dataclass(frozen=True)
class Expanded:
    """A campaign with the numbers of its runs among all jobs, and their names for messages.

    A run is called by its own name, else by that of its spec, with its folder where another is
    called alike.
    """

    campaign: Campaign
    jobs: tuple[int, ...]
    names: tuple[str, ...]


def expanded(
    configs: Sequence[Path], overrides: Sequence[str]
) -> tuple[list[Expanded], list[Entry]]:
    """Every campaign among the files, and every run to do: a spec stands for itself. `overrides`
    come last.
    """
    campaigns: list[Expanded] = []
    entries: list[Entry] = []
    for config in configs:
        if not is_campaign(config):
            entries.append(Entry(config, tuple(overrides)))
            continue
        campaign, runs = load_campaign(config)
        bases = [str(run.base or campaign.base) for run in campaign.runs]
        short = [run.name or PurePosixPath(run.base or "").stem for run in campaign.runs]
        uses = Counter(short)
        names = tuple(
            name if uses[name] == 1 else base for name, base in zip(short, bases, strict=True)
        )
        campaigns.append(
            Expanded(campaign, tuple(range(len(entries), len(entries) + len(runs))), names)
        )
        entries += [Entry(entry.config, (*entry.overrides, *overrides), config) for entry in runs]
    return campaigns, entries


def run_names(entries: Sequence[Entry], campaigns: Sequence[Expanded]) -> list[str]:
    """Return the name of every run; where its spec is wrong, which its own run will say, what it is
    called in messages.

    Raises UsageError where two of the runs, their variations and the campaigns have one name, which
    would be the same folder.
    """
    called = {
        number: name
        for campaign in campaigns
        for number, name in zip(campaign.jobs, campaign.names, strict=True)
    }
    names: list[str] = []
    owners: dict[str, str] = {}

    def claim(folder: str, owner: str) -> None:
        alike = folder.lower()  # one folder, where capitals do not count in names of files
        if alike in owners:
            raise UsageError(
                f"{owners[alike]} and {owner} have the same name, '{folder}'",
                "give each a `name` of its own",
            )
        owners[alike] = owner

    for one in campaigns:
        claim(one.campaign.campaign, f"the campaign '{one.campaign.campaign}'")
    for number, entry in enumerate(entries):
        try:
            spec = load(entry.config, entry.overrides).spec
        except SpecError:
            short = called.get(number, entry.config.stem)
            names.append(str(entry.config) if short in names else short)
            continue
        claim(spec.name, str(entry.config))
        for rival in spec.validation.against:
            if isinstance(rival, Competitor) and rival.set is not None:
                claim(f"{spec.name}.{rival.label}", f"{entry.config} as '{rival.label}'")
        names.append(spec.name)
    return names
