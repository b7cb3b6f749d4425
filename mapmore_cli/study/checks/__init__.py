"""Find the mistakes of an experiment that no single field shows."""

from mapmore_cli.study.checks.competitors import competitors, formulas, own_formulas
from mapmore_cli.study.checks.effect import along_recordings, idle
from mapmore_cli.study.checks.levels import (
    after_cycles,
    chosen_levels,
    groups,
    leaving_out,
    recordings_apart,
    segmented,
)
from mapmore_cli.study.checks.names import derivations, names_of_quantities
from mapmore_cli.study.checks.shapes import shapes
from mapmore_cli.study.checks.target import kind, of_kinds, several, target
from mapmore_cli.study.checks.terms import clocks, terms
from mapmore_cli.study.checks.units import metrics, units

OF_EACH_TARGET = (
    *(names_of_quantities, derivations, clocks, terms, along_recordings, idle),
    *(segmented, leaving_out, groups, recordings_apart, after_cycles, chosen_levels),
    *(target, kind, of_kinds, formulas, competitors, own_formulas, shapes, units),
)
"""Checks of a study of one target. Each yields its findings for a spec."""
OF_WHOLE_STUDY = (several, metrics)
"""Checks of the whole spec, which may have several targets."""
