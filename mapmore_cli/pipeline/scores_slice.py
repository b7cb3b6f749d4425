"""Define the settings on which the scores of a run depend, apart from its model."""

from __future__ import annotations

from dataclasses import dataclass

from mapmore_cli.fitting.kinds.choices import ModelChoices, model_choices, with_definitions
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.results import Competitor


@dataclass(frozen=True)
class ScoresSlice:
    """Part of the spec on which the scores depend, apart from the model.

    `target` is the scored quantity. If the model must be inverted to predict this quantity,
    `seen_as` names it too; otherwise, `seen_as` is None. `static` is the spec of the static run in
    `needs`, `lengths` are the muscle's dimensions in m, `cycles_of` is the quantity whose cycles
    are held out, `robust` is the section `fit` if its loss is robust, and `folds` holds the
    settings of the models if every level is left out once (cross-validation). `structure_seen`
    names the data with which the structure was chosen, if these data are held out now.
    """

    target: str
    seen_as: str | None
    against: list[str | Competitor]
    simple: bool
    static: str | None
    lengths: dict[str, float | None]
    normaliser: str
    cycles_of: str | None
    folds: ModelChoices | None
    groups: str | None
    without_groups: bool
    structure_seen: str
    robust: Fit | None


def scores_slice(spec: ExperimentSpec) -> ScoresSlice:
    """Return the part of the spec on which the scores depend. Settings for sums and for load-cycle
    formulas are included only if the study can have such competitors.
    """
    spec = with_definitions(spec)
    target = spec.target if isinstance(spec.target, str) else spec.target.column
    moving, split, groups = target in ("damping", "dynamic"), spec.data.split, spec.data.groups
    every = "groups" if split.leave_one_group_out else "levels" if split.leaves_out else "data"
    return ScoresSlice(
        target=spec.validation.as_ or target,
        seen_as=spec.validation.as_,
        against=spec.validation.against,
        simple=spec.validation.simple,
        static=spec.needs.static if moving else None,
        lengths=spec.muscle.lengths,
        normaliser=spec.validation.normaliser,
        cycles_of=split.hold_out.of if split.hold_out is not None else None,
        folds=model_choices(spec) if split.leaves_out else None,
        groups=groups.of if groups is not None else None,
        without_groups=split.leave_one_group_out,
        structure_seen=every if split.structure_seen else "",
        robust=None if spec.fit.loss == "squares" else spec.fit,
    )
