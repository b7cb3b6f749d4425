"""Find out how the experiment was done: which quantity was held constant, and at which levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmore_cli.annexes.drafting.answers import Hold
from mapmore_cli.annexes.drafting.draft import Conditions
from mapmore_cli.checking.evidence import two_digits
from mapmore_cli.checking.rules.curves import FEWEST
from mapmore_cli.domain.errors import DataError, UsageError
from mapmore_cli.domain.recording import Recording
from mapmore_cli.modelling.signals.cycles import split_cycles
from mapmore_cli.modelling.signals.plateau import default_within, find_levels, match_levels
from mapmore_cli.study.sections.data import Cycles

# samples farther from a level than this fraction of the smallest gap between levels are left out
NEAR = 0.1


@dataclass(frozen=True)
class Held:
    """A quantity that was held constant, and how this was found out.

    - `of`: the quantity that was held constant.
    - `at`: its levels.
    - `within`: the largest distance of a sample from its level, if samples between levels must be
      left out; otherwise None.
    - `swept`: the quantity that was swept at each level.
    - `why`: the reason why `of` is regarded as held constant.
    """

    of: str
    at: list[float]
    within: float | None
    swept: str
    why: str


@dataclass(frozen=True)
class Experiment:
    """Description of an experiment: its recordings, the names of its inputs and of its target, the
    quantity that was held constant, the values in names of files (`conditions`), and the quantities
    that distinguish the recordings of one file (`apart`).
    """

    recordings: Sequence[Recording]
    inputs: Sequence[str]
    target: str
    held: Held | None
    conditions: Conditions
    apart: Sequence[str] = ()


def find_held(
    recordings: Sequence[Recording],
    inputs: Sequence[str],
    hold: Hold | None,
    conditions: Conditions,
) -> Held | None:
    """Return the quantity that was held constant while another input moved. Return None if there is
    no such quantity, if several inputs have levels, or if there is only a single level.

    If a person names the quantity, this quantity is used. Otherwise, it must be the only input with
    levels:

    - An input has levels if it stays near one value in each recording, for example because its
      values are in names of files.
    - If no input has such levels, and the study is a table without a clock, an input has levels if
      it takes a few values repeatedly.

    In a table without a clock, the levels must also have enough samples for a curve on average.
    `conditions` are the values in names of files, which are also columns of the recordings.

    Raises
    ------
    UsageError
        If the quantity that a person names is no input.
    """
    asked = None if hold is None else hold.name
    if asked == "none":
        return None
    if asked not in (None, *inputs):
        raise UsageError(
            f"--hold: no input is called {asked}",
            f"name one of {', '.join(inputs)}, or write `--hold none`",
        )
    levels = {name: values for name in inputs if (values := own_levels(recordings, name))}
    is_table = "time" not in recordings[0].columns
    if asked is None:
        if is_table and not levels:
            levels = {name: values for name in inputs if (values := set_values(recordings, name))}
        if len(levels) != 1:
            return None
        (values,) = levels.values()
        if is_table and sum(one.rows_kept for one in recordings) < FEWEST * len(values):
            # with few samples at each value, the quantity moved in steps and was not held constant
            return None
    of = asked or next(iter(levels))
    swept = next((name for name in inputs if name not in (of, *levels)), None)
    at = levels.get(of)
    if at is None:
        at = find_levels(np.concatenate([one.columns[of] for one in recordings])).tolist()
    if swept is None or len(at) < 2:
        return None
    within = None if of in levels else two_digits(NEAR * 2 * default_within(np.array(at)))
    is_one = is_table and len(recordings) == 1
    stays = "takes few values" if is_one else "one value in each recording"
    why = "you" if asked else "names" if of in conditions else stays
    return Held(of, at, within, swept, why)


def own_levels(recordings: Sequence[Recording], name: str) -> list[float] | None:
    """Return the levels of a quantity that stays near one value in each recording. Return None if
    there are fewer than two levels, or if a gap between neighbouring levels is at most half as wide
    as the largest range of values at one level.
    """
    series = [recording.columns[name] for recording in recordings if recording.rows_kept]
    ends = np.array(sorted(np.quantile(values, (0.05, 0.95)).tolist() for values in series))
    reach = np.maximum.accumulate(ends[:, 1])
    first = np.flatnonzero(ends[1:, 0] > reach[:-1]) + 1
    lows, highs = ends[[0, *first], 0], reach[[*(first - 1), -1]]
    gaps, widths = lows[1:] - highs[:-1], highs - lows
    if not gaps.size or 2 * gaps.min() <= widths.max():
        return None
    ends_of_levels = zip(lows.tolist(), highs.tolist(), strict=True)
    return [_neat((low + high) / 2, (high - low) / 4) for low, high in ends_of_levels]


def _neat(middle: float, scatter: float) -> float:
    """Return the mean value `middle`, rounded to as few digits as the scatter around it allows."""
    shorter = (round(middle, digits) + 0.0 for digits in range(-6, 13))
    return next((number for number in shorter if abs(number - middle) <= scatter), middle)


def set_values(recordings: Sequence[Recording], name: str) -> list[float]:
    """Return the distinct values of a quantity if there are at least three, and if each of them
    occurs at least three times on average. Otherwise return an empty list. A quantity with only two
    values may be a switch.
    """
    values, counts = np.unique(
        np.concatenate([recording.columns[name] for recording in recordings]), return_counts=True
    )
    return values.tolist() if len(values) > 2 and counts.mean() >= 3 else []


def goes_in_cycles(recordings: Sequence[Recording], held: Held) -> bool:
    """Return True if the swept quantity moves there and back at every level of every recording."""
    at = np.array(held.at)
    within = held.within or default_within(at)
    samples = Cycles(over=held.swept).samples
    for recording in recordings:
        place = match_levels(recording.columns[held.of], at, within)
        for level in np.unique(place[place >= 0]):
            try:
                split_cycles(recording.columns[held.swept][place == level], {}, samples)
            except DataError:
                return False
    return True
