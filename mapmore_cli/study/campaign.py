"""Campaigns: one spec run in several variants, or several specs, with one page over all."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.domain.declared import Name
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.study.experiment import OtherSettings
from mapmore_cli.study.fields import Row, Section, SpecPath
from mapmore_cli.study.loader import load_as
from mapmore_cli.study.yaml_loader import as_overrides, read_source


class Variant(Section):
    """One run of a campaign: a spec (the campaign's `base` by default), the run's `name`, and keys
    to `set` as `--set` does.
    """

    base: SpecPath | None = None
    name: Name | None = None
    group: str | None = None  # of whose runs the tables give the median and the worst
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
    """A spec to run, with overrides as on the command line; `campaign` is the file that asks for
    it, where one does.

    It is `called` by its own name, else by that of its spec, with its folder where another of the
    campaign is called alike.
    """

    config: Path
    overrides: tuple[str, ...]
    campaign: Path | None = None
    called: str = ""


def is_campaign(path: Path) -> bool:
    """Return True if a YAML file has the key `campaign` at its top level."""
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
    """A campaign with the numbers of its runs among all jobs."""

    campaign: Campaign
    jobs: tuple[int, ...]


def expanded(
    configs: Sequence[Path], overrides: Sequence[str]
) -> tuple[list[Expanded], list[Entry]]:
    """Return every campaign among the files, and every run to do: a spec stands for itself.
    `overrides` come last.
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
