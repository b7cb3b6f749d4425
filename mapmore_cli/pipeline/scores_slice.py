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

    - `target`: quantity whose prediction is scored.
    - `seen_as`: the same quantity if the model must be inverted to predict it; otherwise None.
    - `against`, `simple`: competitors that the spec names, and whether simple models are added.
    - `static`: spec of the static run in `needs`.
    - `lengths`: dimensions of the muscle in m.
    - `normaliser`: name of the value by which errors are divided, for example `max`.
    - `cycles_of`: quantity whose last cycles are held out; None if no cycles are held out.
    - `folds`: settings with which the model is fitted again if every level or group is left out
      once (cross-validation); None without cross-validation.
    - `groups`: quantity that gives the group of a sample.
    - `without_groups`: True if groups instead of levels are left out.
    - `structure_seen`: held-out data with which the structure of the model was nevertheless chosen:
      `levels`, `groups` or `data`; empty if there are none.
    - `robust`: section `fit` if its loss is robust; otherwise None.
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
    """Return the part of the spec on which the scores depend. The static run, the settings for
    fitting the model again, and the section `fit` are left out if they have no effect on the scores
    of this study, so that a change of them does not repeat the stage.
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
