"""Define campaigns: several variants of one spec, or several specs, that share one table and one
page.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.domain.declared import Name
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.study.fields import Row, Section, SpecPath
from mapmore_cli.study.loader import load_as
from mapmore_cli.study.sections.results import OtherSettings
from mapmore_cli.study.yaml_dumper import as_overrides
from mapmore_cli.study.yaml_loader import read_source, refuse_pipe


class Variant(Section):
    """One run of a campaign: its spec (by default the `base` of the campaign), its `name`, and
    other values for some keys of the spec (`set`, with the same keys as the option `--set`).
    """

    base: SpecPath | None = None
    name: Name | None = None
    group: str | None = None  # runs of one group share a row with their median and worst score
    set: OtherSettings = {}

    def _contradictions(self) -> Sequence[Row]:
        return [
            (
                self.base is None and self.name is None,
                "a variant of the campaign's base needs a `name`",
                "add a `name`, because every run has a folder of its own",
            )
        ]


class Campaign(Section):
    """A campaign: its runs, in the order in which its tables show them."""

    schema_version: Literal[1] = 1
    campaign: Name
    title: str | None = None
    base: SpecPath | None = None
    runs: Annotated[list[Variant], Field(min_length=1)]
    # name of a model; the errors of all other models are divided by the errors of this model
    relative_to: str | None = None
    best_of: list[
        str
        # in each run, only the formula with the smallest error is shown, as a single competitor
        # The best formula is chosen by the scores that are shown, so its score is optimistic.
    ] = []

    def _contradictions(self) -> Sequence[Row]:
        return [
            (
                self.base is None and any(run.base is None for run in self.runs),
                "this run has no spec",
                "give the campaign a `base`, or the run a `spec`",
                "runs",
            )
        ]


@dataclass(frozen=True)
class Entry:
    """A spec to run, with overrides as on the command line. `campaign` is the campaign file that
    lists the spec, or None.

    `called` is the name of the run. A run without a name is called by the file name of its spec,
    without the ending. If several runs of the campaign have this name, `called` is the path of the
    spec instead.
    """

    config: Path
    overrides: tuple[str, ...]
    campaign: Path | None = None
    called: str = ""


def is_campaign(path: Path) -> bool:
    """Return True if a YAML file has the key `campaign` or `runs` at its top level. No other spec
    has these keys, so that a campaign without its name is reported as such. Raises SpecError for a
    pipe or a device, which a worker could not open.
    """
    refuse_pipe(path)
    try:
        lines = read_source(path).text.splitlines()
    except SpecError:
        return False  # the file is loaded later, and the loader then reports why it cannot be read
    return any(line.startswith(("campaign:", "runs:")) for line in lines)


def load_campaign(path: Path) -> tuple[Campaign, tuple[Entry, ...]]:
    """Read a campaign and return it with its runs. Raises SpecError under the same conditions as
    `study.loader.load`.
    """
    loaded = load_as(path, Campaign)
    entries, runs = [], loaded.spec.runs
    short = [run.name or PurePosixPath(run.base or "").stem for run in runs]
    for run, name in zip(runs, short, strict=True):
        base = str(run.base or loaded.spec.base)
        settings = {**({} if run.name is None else {"name": run.name}), **run.set}
        called = name if short.count(name) == 1 else base
        entries.append(Entry(loaded.folder / base, as_overrides(settings), path, called))
    return loaded.spec, tuple(entries)


@dataclass(frozen=True)
class Expanded:
    """A campaign, and the indices of its runs in the list of all runs."""

    campaign: Campaign
    jobs: tuple[int, ...]


def expanded(
    configs: Sequence[Path], overrides: Sequence[str]
) -> tuple[list[Expanded], list[Entry]]:
    """Return every campaign among the files, and the list of the runs of all files. A file that is
    not a campaign is the spec of a single run. `overrides` are applied to every run, after the
    settings of its campaign.
    """
    campaigns: list[Expanded] = []
    entries: list[Entry] = []
    for config in configs:
        runs: tuple[Entry, ...] = (Entry(config, (), called=config.stem),)
        if is_campaign(config):
            campaign, runs = load_campaign(config)
            jobs = range(len(entries), len(entries) + len(runs))
            campaigns.append(Expanded(campaign, tuple(jobs)))
        entries += [replace(run, overrides=(*run.overrides, *overrides)) for run in runs]
    return campaigns, entries
