"""Define the rules of `mapmore check`: functions that yield the issues of a study (`Subject`). To
add a rule, add its function to one of the lists in `applied.py`.

The readers and the spec refuse some faults by themselves; no rule is needed for these faults.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from mapmore_cli.checking.findings import Issue
from mapmore_cli.domain.arrays import Array, Ends, extremes, joined
from mapmore_cli.domain.recording import Dataset, Recording
from mapmore_cli.study.experiment import ExperimentSpec

__all__ = ["Issue", "Issues", "Rule", "Subject"]

Issues = Iterator[Issue]
Rule = Callable[["Subject"], Issues]
"""Function that looks for one kind of mistake."""


@dataclass(frozen=True)
class Subject:
    """The study that the rules examine: a spec with its recordings, and with its dataset in `made`
    if the dataset could be made. A spec with several targets is examined as one study for each
    target.

    `where(*loc)` returns the `file:line:column` of a part of the spec. `units` holds the unit of
    every quantity of the recordings. Paths of recordings start at `folder`.
    """

    spec: ExperimentSpec
    where: Callable[..., str]
    recordings: tuple[Recording, ...]
    units: Mapping[str, str]
    folder: Path
    target: str
    made: Dataset | None = None

    @property
    def dataset(self) -> Dataset:
        """The dataset with its curves, for rules that need them."""
        assert self.made is not None, "the rule checks curves, but was called without any"
        return self.made

    @property
    def kept(self) -> list[Recording]:
        """The recordings that have at least one sample."""
        return [recording for recording in self.recordings if recording.rows_kept]

    def has(self, *names: str) -> bool:
        """Return True if every recording has all these quantities."""
        return all(name in recording.columns for recording in self.recordings for name in names)

    def pooled(self, name: str) -> Array:
        """Return the values of a quantity in all recordings, one recording after the other,
        (n,).
        """
        values: Array = joined([recording.columns[name] for recording in self.recordings])
        return values

    def span(self, name: str) -> Ends:
        """Return the smallest and the largest value of a quantity that every recording has."""
        ends = [extremes(recording.columns[name]) for recording in self.kept]
        return min(low for low, _ in ends), max(high for _, high in ends)

    def source(self, name: str) -> str:
        """Return the `file:line:column` at which the spec defines a quantity: its column, its
        expression in `derive`, or the section `files` if the value is set for whole files.
        """
        for section in ("columns", "derive"):
            if name in getattr(self.spec.data, section):
                return self.where("data", section, name)
        return self.where("data", "files")
