"""List the rules by the data that they need (recordings or curves), and apply them to a spec and
its data.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import Any

from mapmore_cli.checking.rules import (
    Issue,
    Rule,
    Subject,
    curves,
    fits,
    odd_values,
    pairs,
    samples,
    signs,
    units,
)
from mapmore_cli.domain.errors import DataError, SpecError
from mapmore_cli.domain.recording import Dataset
from mapmore_cli.ingestion.dataset import build_dataset
from mapmore_cli.ingestion.files import slice_of
from mapmore_cli.study.loader import LoadedSpec
from mapmore_cli.study.sections.split import Split

OF_RECORDINGS: tuple[Rule, ...] = (
    *(units.strain_in_per_cent, units.unit_in_the_name, units.unit_line, units.formulas_in_labels),
    *(samples.constant, samples.same_signal, samples.clipped),
    *(signs.force_never_pulls, signs.strain_turned),
    *(samples.still_cycles, units.header_of_numbers),
    *(samples.recorded_twice, odd_values.spikes_in, odd_values.fill_values),
    odd_values.below_vacuum,
    *(pairs.computed_from, pairs.untold_difference),
)
"""Rules that need only the recordings, so that they can also explain why no curves could be
made.
"""

OF_CURVES: tuple[Rule, ...] = (
    curves.few_samples,
    curves.one_fold,
    fits.short_segments,
    fits.few_for_formula,
    curves.even_steps,
)
"""Rules that need the curves."""

OF_CHECK: tuple[Rule, ...] = (
    samples.unsettled,
    samples.offset,
    curves.single_valued,
    fits.contradicted_shape,
    curves.beyond_training,
)
"""Rules that only `check` applies: hints, and facts that a run reports together with its scores."""


def issues_of(
    loaded: LoadedSpec, dataset: Dataset, *, curves: bool = True, hints: bool = False
) -> list[Issue]:
    """Return the issues that the rules find in a dataset. If `curves` is False, only the rules
    about recordings are applied. If `hints` is True, hints are included.
    """
    units = slice_of(loaded.spec).units
    subjects = [
        Subject(
            loaded.spec,
            loaded.where,
            dataset.recordings,
            units,
            loaded.folder,
            target,
            each if curves else None,
        )
        for target, each in zip(loaded.spec.targets, dataset.each, strict=True)
    ]
    rules = (
        *OF_RECORDINGS,
        *(OF_CURVES if curves else ()),
        *(OF_CHECK if curves and hints else ()),
    )
    issues = (issue for subject in subjects for rule in rules for issue in rule(subject))
    return [*dict.fromkeys(issue for issue in issues if hints or issue.severity != "hint")]


def issues_without_curves(loaded: LoadedSpec) -> list[Issue]:
    """Apply the rules about recordings in a study in which no curves can be made, and return their
    issues. An issue may be the reason why there are no curves: for example, if a strain is in per
    cent, no sample lies near a level. Return an empty list if the recordings cannot be read.
    """
    bare: dict[str, Any] = {
        "derive": {},
        "keep": [],
        "cycles": None,
        "levels": None,
        "groups": None,
        "split": Split(),
    }
    bare |= {"missing": "drop", "repeated_time": "average"}
    part = slice_of(loaded.spec)
    with suppress(SpecError, DataError):
        recordings = build_dataset(
            replace(part, data=part.data.model_copy(update=bare)),
            loaded.folder,
            tables=loaded.tables,
        )
        return issues_of(loaded, recordings, curves=False)
    return []
