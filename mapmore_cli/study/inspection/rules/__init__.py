"""The rules of `mapmore check`. Each is a function that yields what it finds; to add one, name it in one of the two lists.

What the readers and the spec refuse by themselves is no business of a rule.
"""

from __future__ import annotations

from mapmore_cli.study.inspection.rules import curves, levels, memory, samples, units
from mapmore_cli.study.inspection.subject import Rule

OF_RECORDINGS: tuple[Rule, ...] = (
    units.strain_in_per_cent,
    units.pressure_in_pascals,
    units.pressure_in_bar,
    units.pull_of_the_bore,
    units.time_in_milliseconds,
    units.unit_in_the_name,
    units.unit_line,
    samples.constant,
    samples.same_signal,
    samples.clipped,
    samples.cycles_of_noise,
    samples.force_never_pulls,
    curves.wrong_way_round,
    samples.recorded_twice,
)
"""Rules that need the recordings alone, so that they can say why no curves could be made of them."""

OF_CURVES: tuple[Rule, ...] = (
    levels.few_samples,
    levels.segments,
    levels.beyond_training,
    samples.many_dropped,
    samples.unsettled,
    samples.slack_foot,
    curves.single_valued,
    curves.loops_apart,
    memory.even_steps,
)
"""Rules that need the curves."""
