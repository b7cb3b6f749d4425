"""The `data` section of an experiment: the recordings, and how they become curves."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from mapmore_cli.domain.declared import Contradiction, Either, InUnit, OfKey, Seconds, of_sibling
from mapmore_cli.spec.fields import (
    PathOrName,
    Quantity,
    Section,
    SignedSeconds,
    Uncertainty,
)
from mapmore_cli.spec.sections.logs import FileEntry, Join, Keep, Logs

OfLevel = Annotated[float, of_sibling("of")]

STEP_PRESSURE, STEP_OF = "step_pressure", "pressure"
"""The quantity that a step response's plateau adds, and the one that it is the mean of."""


class Rate(Section):
    """The time derivative of `rate_of`, by a Savitzky-Golay filter of polynomial `order` over
    `window` seconds.
    """

    rate_of: str
    window: Seconds
    order: Annotated[int, Field(ge=1, le=5)] = 3


class Direction(Section):
    """The direction of motion, +1 (rise) or -1 (fall): the sign of the rate `direction_of`, where
    that exceeds the `dead_band`.

    Within the dead band the last direction holds; a recording starts with +1.
    """

    direction_of: str
    dead_band: Annotated[float, Field(gt=0), of_sibling("direction_of")]


class Cycles(Section):
    """Split load cycles into branches `over` one quantity, and resample both on `samples` common
    values.
    """

    over: str
    samples: Annotated[int, Field(ge=2, le=100_000)] = 200


class Levels(Section):
    """The quantity (`of`) held constant within one curve, its values (`at`), and how far a sample
    may be off (`within`).

    `within` is half the smallest distance between levels where it is not given. The `value` of a
    sample is what was `measured`, which surfaces and interpolation between levels use, or the
    `nominal` one of its level, as where the sensor is noisier than the rig.
    """

    of: str
    at: Annotated[Annotated[list[OfLevel], Field(min_length=1)] | Literal["auto"], Either()] = (
        "auto"
    )
    within: Annotated[float, Field(gt=0), of_sibling("of")] | None = None
    value: Literal["measured", "nominal"] = "measured"

    @property
    def spacing(self) -> float | None:
        """Smallest distance between given levels; None for `auto` or a single one."""
        if isinstance(self.at, str) or len(self.at) < 2:
            return None
        ordered = sorted(self.at)
        return min(after - before for before, after in pairwise(ordered))

    def _contradictions(self) -> Iterator[ValueError]:
        if self.spacing == 0 and not isinstance(self.at, str):
            twice = sorted({level for level in self.at if self.at.count(level) > 1})
            yield Contradiction(
                f"level {', '.join(f'{level:g}' for level in twice)} is given twice",
                "give each level once",
                "at",
            )
        if self.within is not None and self.spacing is not None and self.within > self.spacing / 2:
            yield Contradiction(
                f"levels overlap: they lie {self.spacing:g} apart, and `within: "
                f"{self.within:g}` reaches further than half of that",
                f"give `within` of {self.spacing / 2:g} or less",
                "within",
            )


class Between(Section):
    """Closed intervals of a quantity."""

    between: Annotated[
        list[Annotated[tuple[OfKey, OfKey], Field(strict=False)]], Field(min_length=1)
    ]

    def _contradictions(self) -> Iterator[ValueError]:
        for low, high in self.between:
            if low > high:
                yield Contradiction(
                    f"the interval runs from {low:g} to {high:g}",
                    "put the lower end first",
                    "between",
                )


Part = Annotated[float, Field(gt=0, lt=1), InUnit(lambda _: "1")]
HeldOut = Annotated[Annotated[list[OfKey], Field(min_length=1)] | Between, Either()]


class Holdout(Section):
    """Which samples validate. A sample must fulfil every condition that is given.

    `files` and `recordings` are globs; `last` is a share of every recording, `last_cycles` of its
    cycles, the rises and falls `of` a quantity, and `fraction` of all samples, drawn with `seed`.
    Any other key is a quantity, with values or `{between: [[low, high], ...]}`.
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
        """The keys that are quantities."""
        return self.__pydantic_extra__

    def _contradictions(self) -> Iterator[ValueError]:
        conditions = (self.files, self.recordings, self.last, self.last_cycles, self.fraction)
        if all(value is None for value in conditions) and not self.quantities:
            yield Contradiction(
                "`validate` does not say what is held out",
                "name a quantity, as `pressure: [250]`",
                "seed",
                "of",
            )
        if (self.last_cycles is None) != (self.of is None):
            remedy = "say of which quantity, as `{last_cycles: 0.5, of: pressure}`"
            yield Contradiction("`last_cycles` and `of` go together", remedy, "last_cycles", "of")
        if self.seed is not None and self.fraction is None:
            yield Contradiction("`seed` draws nothing here", "it belongs to `fraction`", "seed")


class Split(Section):
    """Which data validate. Without it, all data train.

    `leave_one_level_out` and `leave_one_group_out` are cross-validation over levels or
    `data.groups`: the saved model uses all data.
    """

    hold_out: Holdout | None = Field(default=None, alias="validate")
    leave_one_level_out: bool = False
    leave_one_group_out: bool = False

    def _contradictions(self) -> Iterator[ValueError]:
        given = [
            key for key in ("leave_one_level_out", "leave_one_group_out") if getattr(self, key)
        ]
        told = [*(["validate"] if self.hold_out is not None else []), *given]
        if len(told) > 1:
            yield Contradiction(
                f"both {' and '.join(f'`{key}`' for key in told)} are given", "choose one", told[-1]
            )


class Groups(Section):
    """What tells specimens or sessions apart: the quantity `of`, one value for each, from a column
    or `set` beside the files.

    Each group is scored by itself, and `split: {leave_one_group_out: true}` leaves each out in
    turn. With `offset`, what each group adds to the target at equal inputs is estimated on training
    samples and taken off; the mean of all offsets is zero. With `gain`, so is a factor of each
    group, near 1 where its samples say little; the geometric mean of all gains is 1. A group that
    is held out whole has gain 1 and offset 0.
    """

    of: Quantity
    offset: bool = False
    gain: bool = False

    @property
    def has_effects(self) -> bool:
        """Whether anything of the groups is taken off the target."""
        return self.offset or self.gain


class GapRule(Section):
    """Gaps between samples `longer_than` seconds are an error, or split the recording.

    With `split`, pieces are recordings of their own, `<id>#1`, `<id>#2`, ...; a clock that is set
    back splits as well.
    """

    longer_than: Seconds
    action: Literal["error", "split"] = "error"


class MissingRule(Section):
    """Texts and numbers that stand for a missing value, besides an empty cell, `nan`, `NA` and the
    like; samples without a value are then left out.
    """

    tokens: list[Annotated[str | float, Either()]] = []

    @property
    def texts(self) -> frozenset[str]:
        """Tokens as cells of text hold them."""
        return frozenset(token.strip() for token in self.tokens if isinstance(token, str))

    @property
    def numbers(self) -> tuple[float, ...]:
        """Tokens that are numbers, as -999."""
        return tuple(token for token in self.tokens if not isinstance(token, str))


Plateau = Annotated[
    Annotated[tuple[SignedSeconds, SignedSeconds], Field(strict=False)] | Literal["auto"], Either()
]
"""Where a step response rests between its rise and its fall: from when to when, or found in each
recording.
"""


class Data(Logs):
    """The recordings, and how they become curves.

    - `columns` say which column holds which quantity; `join` adds those of a second log; `derive`
      adds what follows from them.
    - `gaps` are where a recording breaks off; `glitches: drop` leaves out stamps that jump back, or
      ahead and back; `resample` makes even
      steps; `keep` chooses samples.
    - `cycles` splits loops into branches, `levels` names what is constant within a curve, `groups`
      tells specimens apart, `split` holds
      data out.
    - `plateau` is where a step response rests, `auto` or `[from, to]`: its mean pressure is
      `step_pressure`, its samples do not train.
    - `uncertainty` is the standard deviation of each sample of a quantity: a value (`0.5 N`), a
      share of what was measured (`2 %`), the name of a column, or values by those of `groups`, as
      `{'1': 0.5 N, '2': 1 N}`. Samples of the target weigh by it; of
      an input it is told how much of the residual it explains.
    """

    join: list[Join] = []
    derive: dict[Quantity, Annotated[str | Rate | Direction, Either(key="direction_of")]] = {}
    plateau: Plateau | None = None
    keep: list[Keep] = []
    missing: Annotated[Literal["error", "drop"] | MissingRule, Either()] = "error"
    repeated_time: Literal["error", "average", "spread"] = "error"
    glitches: Literal["error", "drop"] = "error"
    gaps: GapRule | None = None
    resample: Seconds | None = None
    cycles: Cycles | None = None
    levels: Levels | None = None
    groups: Groups | None = None
    uncertainty: dict[Quantity, Uncertainty] = {}
    split: Split = Split()

    def _contradictions(self) -> Iterator[ValueError]:
        yield from super()._contradictions()
        for name, rule in self.uncertainty.items():
            if isinstance(rule, dict) and self.groups is None:
                yield Contradiction(
                    f"the uncertainty of `{name}` is by group, and there are no groups",
                    "say what tells them apart, as `groups: {of: session}`",
                    "uncertainty",
                )

    @property
    def measured(self) -> tuple[str, ...]:
        """Every quantity that comes from a column, or is the time made from `sample_time`."""
        joined = (name for join in self.join for name in join.quantities)
        return tuple(
            dict.fromkeys(
                (*self.columns, *(["time"] if self.sample_time is not None else []), *joined)
            )
        )

    @property
    def missing_rule(self) -> MissingRule:
        """What stands for a missing value."""
        return self.missing if isinstance(self.missing, MissingRule) else MissingRule()

    @property
    def quantities(self) -> tuple[str, ...]:
        """Every quantity that the samples have: of columns and joined logs, set beside files,
        derived.
        """
        beside = (
            name for entry in self.files if isinstance(entry, FileEntry) for name in entry.set
        )
        stepped = (STEP_PRESSURE,) if self.plateau is not None else ()
        return tuple(dict.fromkeys((*self.measured, *beside, *self.derive, *stepped)))
