"""A campaign: one spec run in several variants, or several specs, with one page over all."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from mapmore_cli.domain.declared import Contradiction
from mapmore_cli.spec.fields import Name, Section, SettingsOfSpec, SpecPath
from mapmore_cli.spec.loader import load_as
from mapmore_cli.spec.yaml_loader import LARGEST, as_overrides


class Variant(Section):
    """One run of a campaign: a spec (the campaign's `base` by default), the run's `name`, and keys to `set` as `--set` does.

    Of the runs of one `group`, the tables give the median and the worst.
    """

    base: SpecPath | None = None
    name: Name | None = None
    group: str | None = None
    set: Annotated[dict[str, Any], SettingsOfSpec()] = {}  # noqa: RUF012 (pydantic copies it)

    def _contradictions(self) -> Iterator[ValueError]:
        if self.base is None and self.name is None:
            yield Contradiction("a variant of the campaign's base needs a `name`", "add it: every run has a folder of its own")


class Campaign(Section):
    """The runs of a campaign, in the order of its tables.

    `relative_to` names the model that ratios are taken to, `best_of` the formulas of which the best in each run, picked afterwards, is
    compared with.
    """

    schema_version: Literal[1] = 1
    campaign: Name
    title: str | None = None
    base: SpecPath | None = None
    runs: Annotated[list[Variant], Field(min_length=1)]
    relative_to: str | None = None
    best_of: list[str] = []  # noqa: RUF012 (pydantic copies it)

    def _contradictions(self) -> Iterator[ValueError]:
        if self.base is None and any(run.base is None for run in self.runs):
            yield Contradiction("a run has no spec", "give the campaign a `base`, or each run one", "runs")


@dataclass(frozen=True)
class Entry:
    """A spec to run, with overrides as on the command line; `campaign` is the file that asks for it, where one does."""

    config: Path
    overrides: tuple[str, ...]
    campaign: Path | None = None


def is_campaign(path: Path) -> bool:
    """Return True where a YAML file has the key `campaign` at its top level."""
    try:
        with path.open("rb") as file:
            lines = file.read(LARGEST).decode().splitlines()
    except (OSError, UnicodeDecodeError):
        return False  # loading it says why
    return any(line.startswith("campaign:") for line in lines)


def load_campaign(path: Path) -> tuple[Campaign, tuple[Entry, ...]]:
    """Read a campaign and the runs that it stands for; raises SpecError as `spec.loader.load` does."""
    loaded = load_as(path, Campaign)
    entries = []
    for run in loaded.spec.runs:
        named = {} if run.name is None else {"name": run.name}
        entries.append(Entry(loaded.folder / str(run.base or loaded.spec.base), as_overrides({**named, **run.set})))
    return loaded.spec, tuple(entries)
