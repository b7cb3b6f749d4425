"""Define the `data` section of a spec: the recordings, and how they become curves."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.domain.declared import Difference, Either, Seconds, of_sibling
from mapmore_cli.modelling.expressions import parse
from mapmore_cli.study.fields import PathOrName, Quantity, Row, Section, SignedSeconds, Uncertainty
from mapmore_cli.study.sections.logs import FileEntry, Join, Keep, Logs
from mapmore_cli.study.sections.split import Apart, Groups, Split

OfLevel = Annotated[float, of_sibling("of")]

STEP_PRESSURE, STEP_OF = "step_pressure", "pressure"
"""Name of the quantity that `plateau` adds, which is the mean pressure of a step response on its
plateau; and name of the quantity that is averaged.
"""


class Rate(Section):
    """Time derivative of a quantity, computed by a Savitzky-Golay filter.

    - `rate_of`: The quantity to differentiate. Example: `strain`
    - `window`: Width of the filter's window. A wider window gives a smoother rate, but blurs fast
      changes. Example: `30 ms`
    - `order`: Order of the polynomial that is fitted in the window. A higher order follows faster
      changes and passes more noise. Example: `2`
    """

    rate_of: str
    window: Seconds
    order: Annotated[int, Field(ge=1, le=5)] = 3

    @property
    def source(self) -> str:
        """Name of the quantity that is differentiated."""
        return self.rate_of


class Direction(Section):
    """Direction of motion: +1 while a quantity rises and -1 while it falls, taken from the sign of
    its rate.

    While the rate stays within the dead band, the direction keeps its last value. At the start of
    each recording, the direction is +1.

    - `direction_of`: The rate, usually made by `rate_of`. Example: `strain_rate`
    - `dead_band`: Largest absolute rate that is treated as no motion. Set it above the noise of the
      rate. Example: `0.002`
    """

    direction_of: str
    dead_band: Annotated[float, Field(gt=0), of_sibling("direction_of", Difference)]

    @property
    def source(self) -> str:
        """Name of the rate from which the direction is taken."""
        return self.direction_of


class Cycles(Section):
    """Load cycles, which are split into rising and falling branches. At each level of a recording,
    all rising branches together give one curve, and all falling branches together give a second
    curve. The study uses the mean of these two curves as its samples. Half of their difference,
    falling minus rising, is the target `hysteresis`.

    - `over`: The quantity that rises and falls in a cycle. Example: `strain`
    - `samples`: Number of evenly spaced values of this quantity at which both curves are
      interpolated before they are averaged. Example: `200`
    """

    over: str
    samples: Annotated[int, Field(ge=2, le=100_000)] = 200


class Levels(Section):
    """The level quantity: the quantity that is constant within one curve.

    - `of`: The level quantity. Example: `pressure`
    - `at`: Its nominal values, or `auto` to find them in the data. Example: `[100 kPa, 2 bar]`
    - `within`: Largest distance of a sample from its level; samples farther away belong to no
      level. Half the smallest distance between two levels by default; a single level has all
      samples. Example: `10 kPa`
    - `value`: Value of the level quantity in each sample: `measured` is the measured value,
      `nominal` the value of its level. Choose `nominal` if the sensor is noisier than the
      test rig. Example: `nominal`
    """

    of: str
    at: Annotated[Annotated[list[OfLevel], Field(min_length=1)] | Literal["auto"], Either()] = (
        "auto"
    )
    within: Annotated[float, Field(gt=0), of_sibling("of", Difference)] | None = None
    value: Literal["measured", "nominal"] = "measured"

    @property
    def spacing(self) -> float | None:
        """Smallest distance between two neighbouring levels in `at`. None if `at` is `auto` or has
        a single level.
        """
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


class GapRule(Section):
    """Rule for a recording in which samples are missing for some time.

    - `longer_than`: Longest time between two samples that is not a gap. Example: `0.5 s`
    - `action`: `error` stops the run. `split` makes each piece a recording of its own, with the ids
      `<id>#1`, `<id>#2`, and so on; it also splits at a place where the clock was set back.
      Example: `split`
    """

    longer_than: Seconds
    action: Literal["error", "split"] = "error"


class MissingRule(Section):
    """Cells that are treated as missing values, in addition to empty cells, `nan`, `NA` and similar
    words. Samples with a missing value are left out.

    - `tokens`: Texts and numbers that mean a missing value. Example: `[-999, "no signal"]`
    """

    tokens: list[Annotated[str | float, Either()]] = []

    @property
    def texts(self) -> frozenset[str]:
        """The texts among `tokens`, without spaces around them."""
        return frozenset(token.strip() for token in self.tokens if isinstance(token, str))

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers among `tokens`, for example -999."""
        return tuple(token for token in self.tokens if not isinstance(token, str))


Plateau = Annotated[
    Annotated[tuple[SignedSeconds, SignedSeconds], Field(strict=False)] | Literal["auto"], Either()
]
"""Time interval in which a step response rests between its rise and its fall, s; `auto` finds it in
each recording.
"""


class Data(Logs):
    """The recordings, and how they become curves.

    - `join`: Further log files of the same tests, for example from a second logger. Example:
      `[{files: ["force_*.csv"], columns: {force: {column: F}}, on: row}]`
    - `recordings`: How the rows of one file are divided into several recordings. Example: `{of:
      trial}`
    - `skip_bad_files`: If true, leave out files that cannot be read, with a warning that says why.
      A list names the files that may be left out. Example: `["log_3.csv"]`
    - `derive`: Quantities that are computed from the columns: by an expression, as a rate, or as a
      direction of motion. Example: `{strain: "1 - length/0.088"}`
    - `plateau`: The time interval in which a step response rests, or `auto` to find it. Its mean
      pressure becomes the quantity `step_pressure`. Its samples are not used for training. Example:
      `auto`
    - `keep`: Conditions that samples must fulfil; all others are left out. Example: `[{quantity:
      force, above: 0}]`
    - `missing`: What to do about missing values: stop with an `error`, `drop` the samples, or name
      further cells that mean a missing value (the samples are then dropped). Example: `drop`
    - `repeated_time`: What to do if several samples have the same time: stop with an `error`,
      replace them by their `average`, or `spread` them evenly until the next time. Example:
      `average`
    - `glitches`: What to do if a time stamp jumps back, or ahead and back again: stop with an
      `error`, or `drop` the samples. Example: `drop`
    - `gaps`: What to do if samples are missing for some time. Example: `{longer_than: 0.5 s,
      action: split}`
    - `resample`: Bring all recordings to this constant time between samples. A step with several
      samples gets their mean, and a step without samples is interpolated linearly. Models whose
      terms use time steps, such as `lags` and `slow`, need it if the measured time steps are not
      equal. Example: `10 ms`
    - `cycles`: Split load cycles into rising and falling branches, and average them. The samples
      then have no time. Example: `{over: strain}`
    - `levels`: The quantity that is constant within one curve, and its values. Example: `{of:
      pressure, at: auto}`
    - `groups`: The quantity that distinguishes specimens or sessions. Example: `{of: specimen,
      offset: true}`
    - `split`: Which data are held out of training. Example: `{validate: {pressure: [250]}}`
    - `uncertainty`: Standard deviation of the measurement of each quantity: a value, a share of the
      measured value (`2 %`), the name of a column, or values by group. For the target, it sets the
      weights of the samples in the fit. For an input, the run reports how much of the residual it
      explains. Example: `{force: 0.5 N}`
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
        """Names of all quantities that come from columns, including those of joined logs. The time
        is included if it is made from `sample_time`.
        """
        of_joins = (name for join in self.join for name in join.quantities)
        return tuple(
            dict.fromkeys(
                (*self.columns, *(["time"] if self.sample_time is not None else []), *of_joins)
            )
        )

    @property
    def missing_rule(self) -> MissingRule:
        """The rule for missing values; the default rule if `missing` is a word."""
        return self.missing if isinstance(self.missing, MissingRule) else MissingRule()

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all quantities that the samples have. They come from columns and joined logs,
        are set for whole files, or are derived.
        """
        beside = (
            name for entry in self.files if isinstance(entry, FileEntry) for name in entry.set
        )
        stepped = (STEP_PRESSURE,) if self.plateau is not None else ()
        return tuple(dict.fromkeys((*self.measured, *beside, *self.derive, *stepped)))

    @property
    def sources(self) -> dict[str, set[str]]:
        """For each derived quantity, by its name: the quantities from which it is computed."""
        return {
            name: {*parse(rule).names} if isinstance(rule, str) else {rule.source}
            for name, rule in self.derive.items()
        }

    def computed_from(self, *names: str) -> set[str]:
        """Return the derived quantities that are computed from any of the quantities `names`,
        directly or by way of other derived quantities.
        """
        made, sources = {*names}, self.sources
        while more := {name for name, of in sources.items() if of & made} - made:
            made |= more
        return made - {*names}
