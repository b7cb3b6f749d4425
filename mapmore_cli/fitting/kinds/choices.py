"""Collect the sections of a spec on which a model depends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from mapmore_cli.domain.recording import Signal
from mapmore_cli.fitting.kinds.dictionary import signals_of, units_of
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.pieces.recipe import Cuts, Fuse, Segmented
from mapmore_cli.modelling.selection import AUTO, Fit
from mapmore_cli.study.experiment import ExperimentSpec
from mapmore_cli.study.sections.data import STEP_OF, STEP_PRESSURE, Levels
from mapmore_cli.study.sections.dictionary import DictionaryEntry, remembers
from mapmore_cli.study.sections.model import ModelChoice, Summand
from mapmore_cli.study.sections.results import Competitor
from mapmore_cli.study.units import base_units

SegmentSection = Mapping[str, Segmented]


@dataclass(frozen=True)
class ModelChoices:
    """The settings of a spec on which a model depends. Stages that run before the model is made
    read only the sections that they need.

    - `lengths`: dimensions of the muscle (m) that its formula needs.
    - `summands`: specs of the runs whose models are added.
    - `intervals`: True if the model is also fitted with each part of the training data left out in
      turn.
    """

    levels: Levels | None
    segment: SegmentSection
    dictionary: list[DictionaryEntry]
    model: ModelChoice
    fit: Fit
    lengths: Mapping[str, float | None]
    name: str = "trial"
    fuse: Fuse = field(default_factory=Fuse)
    signals: tuple[Signal, ...] = ()
    summands: tuple[str, ...] = ()
    intervals: bool = False

    @property
    def kind(self) -> str:
        """Name of the kind of model. For the default `model.type: mapmore`, it is `memory` if the
        dictionary contains terms with memory, and otherwise `pieces`. For `literature`, it is
        `formula`. For any other type, it is the type itself.
        """
        if self.model.type == "mapmore":
            return "memory" if remembers(self.dictionary) else "pieces"
        return "formula" if self.model.type == "literature" else self.model.type

    @property
    def over_time(self) -> bool:
        """Return True if the model is computed along whole recordings, because its output depends
        on earlier samples.
        """
        return self.kind in ("memory", "state_space")


def with_definitions(spec: ExperimentSpec) -> ExperimentSpec:
    """Return the spec with the name of each user-defined formula replaced by its definition. A
    stage then needs no other file for the formula.
    """
    if not spec.own_formulas and spec.model.family is None:
        return spec
    units = units_of(spec)
    family = spec.model.family
    relative = None if family is None else family.definition(metres_of(units[family.of]))
    definitions = {name: formula.definition(units) for name, formula in spec.own_formulas.items()}

    def put(name: str | None) -> str | None:
        return name if name is None else definitions.get(name, name)

    def summed(parts: Sequence[Summand] | None) -> list[Summand] | None:
        return (
            None if parts is None else [replace(part, formula=put(part.formula)) for part in parts]
        )

    def rival(competitor: str | Competitor) -> str | Competitor:
        if isinstance(competitor, str):
            return (
                competitor
                if competitor not in definitions
                else Competitor.model_validate({"model": definitions[competitor], "as": competitor})
            )
        changed = {key: put(getattr(competitor, key)) for key in ("model", "static", "damping")}
        return competitor.model_copy(
            update={**changed, "sum": summed(competitor.sum), "as_": competitor.label}
        )

    model = spec.model
    named = replace(
        model, backbone=put(model.backbone), name=relative or put(model.name), sum=summed(model.sum)
    )
    validation = spec.validation.model_copy(
        update={"against": [rival(competitor) for competitor in spec.validation.against]}
    )
    return spec.model_copy(update={"model": named, "validation": validation})


def metres_of(unit: str) -> float:
    """Return the number of metres in one unit; 1 if the unit is no unit of length."""
    base = base_units(unit)
    return base.factor if base is not None and dict(base.powers) == {"m": 1} else 1.0


def lengths_of(model: ModelChoice, lengths: Mapping[str, float | None]) -> dict[str, float | None]:
    """Return the `lengths` of the muscle (m) that the formula of the model needs. The formula is
    the model itself or its backbone.
    """
    name = model.name or model.backbone
    needed = literature.get(name).dimensions if name not in (None, AUTO) else ()
    return {key: length for key, length in lengths.items() if key in needed}


def level_of(levels: Levels | None, segment: SegmentSection) -> str | None:
    """Return the quantity of `levels`; the model interpolates between the curves at its levels.
    Return None if there are no levels, or if `segment: {<quantity>: none}` pools the curves.

    For step responses, the quantity is the pressure. Each curve has the pressure of its plateau as
    level, and a prediction uses the pressure at the same sample.
    """
    if levels is None or segment.get(levels.of) == "none":
        return None
    return STEP_OF if levels.of == STEP_PRESSURE else levels.of


def by_trial(segment: SegmentSection) -> bool:
    """Return True if segment boundaries are chosen by comparing fits (`method: optimal`)."""
    return any(isinstance(cut, Cuts) and cut.method == "optimal" for cut in segment.values())


def model_choices(spec: ExperimentSpec) -> ModelChoices:
    """Return the sections of a spec that determine the model. The stage `fuse` depends on all of
    them.
    """
    spec = with_definitions(spec)
    return ModelChoices(
        spec.data.levels,
        spec.segment,
        spec.dictionary,
        spec.model,
        spec.fit,
        lengths_of(spec.model, spec.muscle.lengths),
        name=spec.name,
        fuse=spec.fuse,
        signals=signals_of(spec),
        summands=tuple(summands(spec)),
        intervals=spec.validation.intervals,
    )


def fit_choices(spec: ExperimentSpec) -> ModelChoices:
    """Return the sections of a spec on which the fit depends. The rules for joining pieces are
    included only if the choice of a backbone depends on them.
    """
    whole = model_choices(spec)
    made = (whole.levels, whole.segment, whole.dictionary, whole.model, whole.fit, whole.lengths)
    return ModelChoices(*made, fuse=whole.fuse if whole.model.backbone == AUTO else Fuse())


def summands(spec: ExperimentSpec) -> list[str]:
    """Return the specs of the runs whose models are added."""
    if spec.model.sum is not None:
        return list(dict.fromkeys(part.model for part in spec.model.sum if part.model is not None))
    return [str(spec.needs.static), str(spec.needs.damping)] if spec.model.type == "sum" else []
