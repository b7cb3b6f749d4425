"""The `data` section of an experiment: the recordings, and how they become curves."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from mapmore_cli.domain.declared import (
    Difference,
    Either,
    OfKey,
    Seconds,
    always_in,
    of_sibling,
)
from mapmore_cli.study.fields import PathOrName, Quantity, Row, Section, SignedSeconds, Uncertainty
from mapmore_cli.study.sections.logs import FileEntry, Join, Keep, Logs
from mapmore_cli.study.tree import quoted

OfLevel = Annotated[float, of_sibling("of")]

STEP_PRESSURE, STEP_OF = "step_pressure", "pressure"
"""The quantity that a step response's plateau adds, and the one that it is the mean of."""


class Rate(Section):
    """The time derivative of a quantity, by a Savitzky-Golay filter.

    - `rate_of`: the quantity, as `strain`
    - `window`: width of the filter, as `30 ms`
    - `order`: order of its polynomials, as `2`
    """

    rate_of: str
    window: Seconds
    order: Annotated[int, Field(ge=1, le=5)] = 3

    @property
    def source(self) -> str:
        """The quantity that it is derived from."""
        return self.rate_of


class Direction(Section):
    """The direction of motion, +1 (rise) or -1 (fall): the sign of a rate.

    Within the dead band the last direction holds; a recording starts with +1.

    - `direction_of`: the rate, as `strain_rate`
    - `dead_band`: rate up to which the last direction holds, as `0.002`
    """

    direction_of: str
    dead_band: Annotated[float, Field(gt=0), of_sibling("direction_of", Difference)]

    @property
    def source(self) -> str:
        """The rate that it is derived from."""
        return self.direction_of


class Cycles(Section):
    """Split load cycles into branches, and average each rise with the fall beside it.

    - `over`: the quantity that rises and falls, as `strain`
    - `samples`: common values of it that both branches are resampled on, as `200`
    """

    over: str
    samples: Annotated[int, Field(ge=2, le=100_000)] = 200


class Levels(Section):
    """The quantity held constant within one curve.

    - `of`: the quantity, as `pressure`
    - `at`: its values, or `auto` for those that the data show, as `[100 kPa, 2 bar]`
    - `within`: how far a sample may be off; half the smallest distance between levels by default,
      as `10 kPa`
    - `value`: the value of a sample: what was `measured`, or the `nominal` one of its level, as
      where the sensor is noisier than the rig, as `nominal`
    """

    of: str
    at: Annotated[Annotated[list[OfLevel], Field(min_length=1)] | Literal["auto"], Either()] = (
        "auto"
    )
    within: Annotated[float, Field(gt=0), of_sibling("of", Difference)] | None = None
    value: Literal["measured", "nominal"] = "measured"

    @property
    def spacing(self) -> float | None:
        """Smallest distance between given levels; None for `auto` or a single one."""
        if isinstance(self.at, str) or len(self.at) < 2:
            return None
        ordered = sorted(self.at)
        return min(after - before for before, after in pairwise(ordered))

    def _contradictions(self) -> Sequence[Row]:
        levels, apart = [] if isinstance(self.at, str) else self.at, self.spacing
        twice = sorted({level for level in levels if levels.count(level) > 1})
        half = math.inf if apart is None else apart / 2
        within = self.within or 0.0
        return [
            (
                bool(twice),
                f"level {', '.join(f'{level:g}' for level in twice)} is given twice",
                "give each level once",
                "at",
            ),
            (
                within > half,
                (
                    f"levels overlap: they are {2 * half:g} apart, and `within: {within:g}` is "
                    "more than half of that"
                ),
                f"write `within: {half:g}` or less",
                "within",
            ),
        ]


class Between(Section):
    """Closed intervals of a quantity.

    - `between`: the intervals, lower end first, as `[[100, 200], [300, 350]]`
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
    """Which samples validate. A sample must fulfil every condition that is given.

    Any other key is a quantity, with values or `{between: [[low, high], ...]}`.

    - `files`: globs of files, as `["*_take2.csv"]`
    - `recordings`: globs of ids of recordings, as `["log#2"]`
    - `last`: share at the end of every recording, as `0.3`
    - `last_cycles`: share of the cycles at the end of every recording, as `0.5`
    - `of`: the quantity whose rises and falls are those cycles, as `pressure`
    - `fraction`: share of all samples, drawn by chance, as `0.2`
    - `seed`: number that the draw begins with, as `1`
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
    """Which data validate. Without it, all data train.

    After cross-validation the saved model uses all data.

    - `validate`: which samples are held out, as `{pressure: [250]}`
    - `leave_one_level_out`: cross-validation over levels, as `true`
    - `leave_one_group_out`: cross-validation over `data.groups`, as `true`
    - `structure_seen`: whether the model's structure was chosen with the data that are held out;
      the verdict then begins with that, as `true`
    """

    hold_out: Holdout | None = Field(default=None, alias="validate")
    leave_one_level_out: bool = False
    leave_one_group_out: bool = False
    structure_seen: bool = False

    @property
    def leaves_out(self) -> bool:
        """Whether every level or group is left out in turn."""
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
    """What tells specimens or sessions apart.

    Each group is scored by itself. A group that is held out whole has gain 1 and offset 0.

    - `of`: a quantity with one value for each, from a column or `set` beside the files, as
      `specimen`
    - `offset`: whether what each group adds to the target at equal inputs is estimated on training
      samples and taken off; the mean of all offsets is zero, as `true`
    - `gain`: whether a factor of each group is, too, near 1 where its samples say little; the
      geometric mean of all gains is 1, as `true`
    """

    of: Quantity
    offset: bool = False
    gain: bool = False

    @property
    def has_effects(self) -> bool:
        """Whether anything of the groups is taken off the target."""
        return self.offset or self.gain


class Apart(Section):
    """Which rows of a file are a recording of their own: those of one value of a column.

    Lags, rates and `sample_time` stay within a recording. Its id has the value behind that of the
    file, as `log[trial=3]`.

    - `of`: the quantity whose value tells recordings apart, or several, as `trial`
    """

    of: Annotated[Quantity | list[Quantity], Either()]

    @property
    def quantities(self) -> list[str]:
        """The quantities whose values tell recordings apart; they are no inputs of a model."""
        return [self.of] if isinstance(self.of, str) else self.of


class GapRule(Section):
    """What a recording is where samples are missing in between.

    - `longer_than`: time between two samples from which on it is a gap, as `0.5 s`
    - `action`: `error`, or `split`: pieces are recordings of their own, `<id>#1`, `<id>#2`, ...; a
      clock that is set back splits as well, as `split`
    """

    longer_than: Seconds
    action: Literal["error", "split"] = "error"


class MissingRule(Section):
    """What stands for a missing value, besides an empty cell, `nan`, `NA` and the like; samples
    without a value are then left out.

    - `tokens`: texts and numbers that do, as `[-999, "no signal"]`
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

    - `join`: second logs of the same tests, as `[{files: ["force_*.csv"], columns: {force: {column:
      F}}, on: row}]`
    - `recordings`: which rows of a file are a recording of their own, as `{of: trial}`
    - `skip_bad_files`: whether files that cannot be read are left out, with a warning that says
      why; or the files that are left out, as `["log_3.csv"]`
    - `derive`: what follows from the columns: an expression, a rate or a direction, as `{strain: "1
      - length/0.088"}`
    - `plateau`: where a step response rests, from when to when: its mean pressure is
      `step_pressure`, its samples do not train, as `auto`
    - `keep`: samples to keep, as `[{quantity: force, above: 0}]`
    - `missing`: an `error`, samples to `drop`, or what else stands for a missing value, as `drop`
    - `repeated_time`: stamps that repeat: an `error`, the `average` of their samples, or samples
      `spread` until the next stamp, as `average`
    - `glitches`: stamps that jump back, or ahead and back: an `error`, or samples to `drop`, as
      `drop`
    - `gaps`: what a recording is where it breaks off, as `{longer_than: 0.5 s, action: split}`
    - `resample`: time between samples, to which all are interpolated, as `10 ms`
    - `cycles`: loops to split into branches, as `{over: strain}`
    - `levels`: what is held constant within a curve, as `{of: pressure, at: auto}`
    - `groups`: what tells specimens or sessions apart, as `{of: specimen, offset: true}`
    - `split`: which data are held out of training, as `{validate: {pressure: [250]}}`
    - `uncertainty`: standard deviation of each sample, by quantity: a value, a share of what was
      measured (`2 %`), the name of a column, or values by `groups`; samples of the target weigh by
      it, of an input it is told how much of the residual it explains, as `{force: 0.5 N}`
    """

    join: list[Join] = []
    recordings: Apart | None = None
    skip_bad_files: Annotated[bool | list[PathOrName], Either()] = False
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

    def _contradictions(self) -> Sequence[Row]:
        return [
            *super()._contradictions(),
            *(
                (
                    isinstance(rule, dict) and self.groups is None,
                    (f"the uncertainty of `{name}` is given by group, and the data have no groups"),
                    (
                        "name the quantity that distinguishes them, for example `groups: "
                        "{of: session}`"
                    ),
                    "uncertainty",
                )
                for name, rule in self.uncertainty.items()
            ),
        ]

    @property
    def measured(self) -> tuple[str, ...]:
        """Every quantity that comes from a column, or is the time made from `sample_time`."""
        of_joins = (name for join in self.join for name in join.quantities)
        return tuple(
            dict.fromkeys(
                (*self.columns, *(["time"] if self.sample_time is not None else []), *of_joins)
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
