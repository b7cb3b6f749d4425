"""Find contradictions between settings of an experiment that are valid one by one."""

from mapmore_cli.study.checks import (
    competitors,
    effect,
    levels,
    names,
    shapes,
    target,
    terms,
    units,
)

OF_EACH_TARGET = (
    *(names.names_of_quantities, names.derivations),
    *(terms.clocks, terms.terms),
    *(effect.along_recordings, effect.idle),
    *(levels.segmented, levels.leaving_out, levels.groups),
    *(levels.recordings_apart, levels.after_cycles, levels.chosen_levels),
    *(target.target, target.kind, target.of_kinds),
    *(competitors.formulas, competitors.competitors, competitors.own_formulas),
    *(shapes.shapes, units.units),
)
"""Checks of a study of one target. Each yields its findings for a spec."""
OF_WHOLE_STUDY = (target.several, units.metrics)
"""Checks of the whole spec, which may have several targets."""
