"""What no section of an experiment shows by itself: names, units and choices that must fit each other."""

from __future__ import annotations

from collections.abc import Iterator

from mapmore_cli.spec import check_dictionary, check_memory, check_models, check_names, check_study
from mapmore_cli.spec.diagnostics import Finding
from mapmore_cli.spec.experiment import ExperimentSpec

CHECKS = (
    check_names.names,
    check_names.derived,
    check_names.clocks,
    check_names.expressions,
    check_dictionary.terms,
    check_study.levels,
    check_study.groups,
    check_study.after_cycles,
    check_study.boundaries_by_fits,
    check_study.joining,
    check_study.chosen_backbone,
    check_study.turned,
    check_study.held_out,
    check_study.target,
    check_study.own_formulas,
    check_study.formulas,
    check_study.metrics,
    check_study.units,
    check_models.sums,
    check_models.needed_runs,
    check_models.plateaus,
    check_models.families,
    check_models.directions,
    check_models.training_level,
    check_models.load_cycle_formulas,
    check_models.composites,
    check_memory.time,
    check_memory.segments,
    check_memory.settings,
    check_models.time,
    check_models.quantities,
    check_models.sections,
)


def findings(spec: ExperimentSpec) -> Iterator[Finding]:
    """Every mistake of an experiment whose form is right."""
    for check in CHECKS:
        yield from check(spec)
