"""The rules of `mapmore check`: functions that yield what they find in a subject. To add one, name it in one of the two lists of `lint`.

What the readers and the spec refuse by themselves is no business of a rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np

from mapmore_cli.domain.arrays import Array
from mapmore_cli.domain.recording import Dataset, Recording
from mapmore_cli.spec.experiment import ExperimentSpec
from mapmore_cli.spec.units import convert

Severity = Literal["error", "warning", "hint"]
"""An error makes the study wrong or impossible, a warning probably wrong; a hint says what could be better."""

Cause = Literal["spec", "data"]
"""What has to be mended."""

ORDER: tuple[Severity, ...] = ("error", "warning", "hint")


@dataclass(frozen=True)
class Issue:
    """One thing that a user should look at: its `message` says what is wrong, its `remedy` what to do.

    `id` is the rule's name for it, which stays the same from release to release; `place` is a `file:line:column` of the spec, or the
    recording; `cause` is what has to be mended, and decides the exit code of an error.
    """

    severity: Severity
    id: str
    place: str
    message: str
    remedy: str
    cause: Cause = "spec"


Rule = Callable[["Subject"], Iterator[Issue]]
"""Looks for one kind of mistake."""


@dataclass(frozen=True)
class Subject:
    """A spec with its recordings, and with the dataset where it could be `made` of them.

    `where(*loc)` is the `file:line:column` of a part of the spec; `units` gives the unit of every quantity of the recordings, `folder`
    is where their sources start.
    """

    spec: ExperimentSpec
    where: Callable[..., str]
    recordings: tuple[Recording, ...]
    units: Mapping[str, str]
    folder: Path
    made: Dataset | None = None

    @property
    def dataset(self) -> Dataset:
        """The curves, for rules that need them."""
        assert self.made is not None, "a rule of curves was given none"
        return self.made

    def has(self, *names: str) -> bool:
        """Return True where every recording has all these quantities."""
        return all(name in recording.columns for recording in self.recordings for name in names)

    def pooled(self, name: str, unit: str | None = None) -> Array:
        """Return a quantity of all recordings together, `(n,)`, converted to `unit`."""
        values = self._pooled[name]
        return values if unit is None else convert(values, self.units[name], unit)

    def largest(self, name: str, unit: str | None = None) -> float:
        """Return the largest absolute value of a quantity; 0 where a recording lacks it."""
        return float(np.abs(self.pooled(name, unit)).max()) if self.has(name) else 0.0

    def source(self, name: str) -> str:
        """Where the spec says what a quantity is: its column, its expression, or the files that it is set for."""
        for section in ("columns", "derive"):
            if name in getattr(self.spec.data, section):
                return self.where("data", section, name)
        return self.where("data", "files")

    @cached_property
    def _pooled(self) -> dict[str, Array]:
        first = self.recordings[0].columns
        return {name: np.concatenate([recording.columns[name] for recording in self.recordings]) for name in first}
