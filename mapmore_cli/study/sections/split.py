"""Define the sections about held-out samples, groups, and recordings within one file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import ConfigDict, Field

from mapmore_cli.domain.declared import Either, OfKey, always_in
from mapmore_cli.study.fields import PathOrName, Quantity, Row, Section
from mapmore_cli.study.tree import quoted


class Between(Section):
    """Closed intervals of a quantity.

    - `between`: The intervals, each with its lower end first. Example: `[[100, 200], [300, 350]]`
    """

    between: Annotated[
        list[Annotated[tuple[OfKey, OfKey], Field(strict=False)]], Field(min_length=1)
    ]

    def _contradictions(self) -> Sequence[Row]:
        return [
            (
                low > high,
                f"the lower end of the interval, {low:g}, lies above its upper end, {high:g}",
                "put the lower end first",
                "between",
            )
            for low, high in self.between
        ]


Part = Annotated[float, Field(gt=0, lt=1), always_in("1")]

HeldOut = Annotated[Annotated[list[OfKey], Field(min_length=1)] | Between, Either()]


class Holdout(Section):
    """Samples that are held out of training and used to validate the model. A sample is held out if
    it fulfils every condition of this section.

    Any key that is not in this table must be the name of a quantity. The value of such a key is a
    list of values of the quantity, or `between` with a list of intervals.

    - `files`: Hold out the files with these names (with wildcards). Example: `["*_take2.csv"]`
    - `recordings`: Hold out the recordings with these ids (with wildcards). Example: `["log#2"]`
    - `last`: Hold out this share of every recording, at its end. A recording that is cut at gaps is
      treated as one recording. Example: `0.3`
    - `last_cycles`: Hold out this share of the cycles of every recording, at its end. It needs
      `of`. Example: `0.5`
    - `of`: The quantity whose rises and falls are the cycles of `last_cycles`. Example: `pressure`
    - `fraction`: Hold out this share of all samples, chosen at random. Neighbouring samples are
      alike, so that this flatters the model; prefer whole recordings or levels. Example: `0.2`
    - `seed`: Seed of the random choice by `fraction`; 0 by default. Example: `1`
    """

    model_config = ConfigDict(extra="allow")
    __pydantic_extra__: dict[str, HeldOut]

    files: list[PathOrName] | None = None
    recordings: list[str] | None = None
    last: Part | None = None
    last_cycles: Part | None = None
    of: str | None = None
    fraction: Part | None = None
    seed: Annotated[int, Field(ge=0, lt=2**63)] | None = None

    @property
    def quantities(self) -> dict[str, list[float] | Between]:
        """The conditions on quantities, by name."""
        return self.__pydantic_extra__

    def _contradictions(self) -> Sequence[Row]:
        conditions = (self.files, self.recordings, self.last, self.last_cycles, self.fraction)
        return [
            (
                all(value is None for value in conditions) and not self.quantities,
                "`validate` does not say what is held out",
                "name a quantity, for example `pressure: [250]`",
                "seed",
                "of",
            ),
            (
                (self.last_cycles is None) != (self.of is None),
                "`last_cycles` needs `of`, and `of` needs `last_cycles`",
                ("name the quantity whose cycles are counted: `{last_cycles: 0.5, of: pressure}`"),
                "last_cycles",
                "of",
            ),
            (
                self.seed is not None and self.fraction is None,
                "`seed` has no effect here",
                "use it with `fraction`, or remove it",
                "seed",
            ),
        ]


class Split(Section):
    """Division of the data into training data and held-out data. Without this section, all data are
    used for training.

    With cross-validation (`leave_one_..._out`), the saved model is fitted to all data.

    - `validate`: The samples that are held out. Example: `{pressure: [250]}`
    - `leave_one_level_out`: If true, leave out each level once, fit a model to the other levels,
      and predict the level that was left out. Example: `true`
    - `leave_one_group_out`: If true, leave out each group of `data.groups` once, fit a model to the
      other groups, and predict the group that was left out. Example: `true`
    - `structure_seen`: Set this to true if you chose the structure of the model with the data that
      are held out. The verdict of the run then says so first, because the held-out scores are too
      optimistic. Example: `true`
    """

    hold_out: Holdout | None = Field(default=None, alias="validate")
    leave_one_level_out: bool = False
    leave_one_group_out: bool = False
    structure_seen: bool = False

    @property
    def leaves_out(self) -> bool:
        """Return True if every level or every group is left out once."""
        return self.leave_one_level_out or self.leave_one_group_out

    def _contradictions(self) -> Sequence[Row]:
        ways = {
            "validate": self.hold_out is not None,
            "leave_one_level_out": self.leave_one_level_out,
            "leave_one_group_out": self.leave_one_group_out,
        }
        keys = [key for key, is_chosen in ways.items() if is_chosen]
        both = f"both {quoted(keys, ' and ')} are given"
        return [(len(keys) > 1, both, "choose one", *keys[-1:])]


class Groups(Section):
    """Groups of recordings: specimens or sessions that are scored separately.

    If all samples of a group are held out, its gain is 1 and its offset is 0.

    - `of`: A quantity with one value for each group. It comes from a column, or from `set` at the
      files. Example: `specimen`
    - `offset`: If true, estimate on the training samples what each group adds to the target at
      equal inputs, and subtract it. The mean of all offsets is zero. Example: `true`
    - `gain`: If true, also estimate a factor for each group and divide by it. The factor stays near
      1 if the samples of the group determine it poorly. The geometric mean of all gains is 1.
      Example: `true`
    """

    of: Quantity
    offset: bool = False
    gain: bool = False

    @property
    def has_effects(self) -> bool:
        """Return True if an offset or a gain of each group is removed from the target."""
        return self.offset or self.gain


class Apart(Section):
    """Quantities whose values divide the rows of one file into recordings: rows with the same value
    belong to the same recording.

    Lags, rates and `sample_time` never reach across recordings. The id of a recording is the id of
    the file followed by the value, for example `log[trial=3]`.

    - `of`: The quantity whose values distinguish the recordings, or several quantities. Example:
      `trial`
    """

    of: Annotated[Quantity | list[Quantity], Either()]

    @property
    def quantities(self) -> list[str]:
        """Names of the quantities whose values distinguish recordings. These quantities are no
        inputs of a model.
        """
        return [self.of] if isinstance(self.of, str) else self.of
