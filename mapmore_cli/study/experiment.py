"""Define the experiment spec as a pydantic model: its sections, and the rules between them.

Units: every number is in the unit of the model. The loader converts `250 kPa` into a number before
validation (see `study.fields`); the annotation of the field names the unit.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from annotated_types import Len
from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from mapmore_cli.domain.declared import Contradiction, Either, Name, Settings
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Fuse, Segmented
from mapmore_cli.modelling.selection import TERMS_OF_ONE_MODEL, Fit
from mapmore_cli.study.fields import (
    Context,
    Metres,
    Quantity,
    Section,
    SpecPath,
    TargetKind,
    as_target,
)
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.dictionary import DictionaryEntry, remembers
from mapmore_cli.study.sections.model import ModelChoice, Needs, OwnFormula
from mapmore_cli.study.sections.report import Report
from mapmore_cli.study.sections.results import Validate


@dataclass(frozen=True)
class Muscle(Settings):
    """The muscle that was measured. The results record what you write in this section. Formulas
    take the length and the diameter of the muscle from this section.

    - `name`: Name of the muscle on pages. Example: `DMSP-20-88N`
    - `kind`: Kind of muscle. For `mckibben` and `peano`, mapmore checks whether the force of the
      model rises with the pressure and falls with the strain. Example: `mckibben`
    - `length`: Active length at rest. Example: `88 mm`
    - `diameter`: Inner diameter at rest. Example: `20 mm`
    """

    name: str | None = None
    kind: str | None = None
    length: Metres | None = None
    diameter: Metres | None = None

    @property
    def lengths(self) -> dict[str, float | None]:
        """Length and diameter by name, m; None for a dimension that the spec does not give."""
        return {"length": self.length, "diameter": self.diameter}


@dataclass(frozen=True)
class TargetColumn(Settings):
    """A measured quantity as target. `target: tip` is a short form of `target: {column: tip}`. A
    list such as `[tip_x, tip_y]` is a short form for the column `tip_x` with the other names in
    `also`.

    - `column`: The quantity, which must be a key of `data.columns` or `data.derive`. Example: `tip`
    - `also`: Further quantities that are modelled with the same segments and terms. Example:
      `[tip_y]`
    """

    column: str
    also: Annotated[Sequence[Quantity], Len(1)] | None = None


def _given_memory(dictionary: object, info: ValidationInfo) -> bool:
    """Return True if a dictionary that is not validated yet has terms with memory. The result is
    False for a dictionary of the wrong form, whose fault is reported elsewhere.
    """
    try:
        return isinstance(dictionary, list) and remembers(
            [DictionaryEntry.model_validate(entry, context=info.context) for entry in dictionary]
        )
    except ValidationError:
        return False


def _pooled(value: Mapping[str, Any]) -> bool:
    """Return True if a spec that is not validated yet fits one function to all curves together,
    without segments.
    """
    data, segment = value.get("data"), value.get("segment") or {}
    levels = data.get("levels") if isinstance(data, dict) else None
    whole = isinstance(segment, dict) and all(cut == "none" for cut in segment.values())
    return whole and (levels is None or bool(segment))


def _sized_by_data(fit: dict[str, Any]) -> None:
    """Change the section `fit` of a model without segments, so that the data choose the number of
    terms, unless the spec sets this number. One term is enough for a segment, but for all data
    together, the single term would often be the constant.
    """
    if "max_terms" not in fit:
        fit["max_terms"] = TERMS_OF_ONE_MODEL
        if "tolerance" not in fit:
            fit.setdefault("stop", "bic")


class ExperimentSpec(Section):
    """The spec of a study, which says what was measured, how the curves are cut, which terms may be
    chosen, how the pieces are joined, and what the model is compared with.

    - `schema_version`: Version of the format. Example: `1`
    - `name`: Name of the run and of its folder. Example: `my-muscle`
    - `muscle`: The muscle that was measured. Example: `{length: 88 mm, diameter: 20 mm}`
    - `units`: Units of quantities in the model and on pages, if they are not the usual ones.
      Example: `{pressure: bar}`
    - `data`: The recordings, and how they become curves. Example: `{files: ["cycle_*.csv"],
      columns: {force: {column: F, unit: N}}}`
    - `needs`: Specs of other runs on which this one builds. Example: `{static: static.yaml}`
    - `target`: What the model predicts: the `static`, `hysteresis`, `damping` or `dynamic` force, a
      measured quantity, or several quantities that share segments and terms. Example: `static`
    - `segment`: How the range of each variable is cut into segments. `none` uses the curves of all
      levels together. Example: `{strain: {method: even, count: 4}}`
    - `dictionary`: Kinds of candidate terms, from which the fit chooses. Example: `[{polynomial:
      {of: [strain], order: 4}}]`
    - `formulas`: Formulas of your own, each in a file or written here. They can be named like the
      formulas of the literature. Example: `[my_formula.yaml]`
    - `model`: Kind of the model, and the formula (backbone) to which the segment functions are
      added. Example: `{backbone: sarosi}`
    - `fit`: How terms are chosen, and how many. Example: `{max_terms: 2}`
    - `fuse`: How the segment functions are joined, and what the model does outside the measured
      range. Example: `{transition: linear, z_s: 0.25}`
    - `validate`: Competitors of the model, and limits that its scores must keep. Example:
      `{against: [sarosi], require: {nrmse: 0.05}}`
    - `report`: Figures and files of the report. Example: `{formats: [html, pdf]}`
    """

    schema_version: Literal[1] = 1
    name: Name
    muscle: Muscle = Muscle()
    units: dict[Quantity, str] = {}
    data: Data
    needs: Needs = Needs()
    target: Annotated[
        TargetKind | TargetColumn,
        Either(),
        BeforeValidator(
            as_target, json_schema_input_type=TargetKind | TargetColumn | str | list[str]
        ),
    ]
    segment: dict[str, Segmented] = {}
    dictionary: list[DictionaryEntry] = []
    formulas: list[Annotated[SpecPath | OwnFormula, Either()]] = []
    model: ModelChoice = ModelChoice()
    fit: Fit = Fit()
    fuse: Fuse = Fuse()
    validation: Validate = Field(default=Validate(), alias="validate")
    report: Report = Report()
    _unconfirmed: tuple[str, ...] = PrivateAttr(default=())

    @property
    def unconfirmed(self) -> tuple[str, ...]:
        """Guesses of `init` that nobody has confirmed: the comments of the file that begin with
        `CHECK`.
        """
        return self._unconfirmed

    @model_validator(mode="before")
    @classmethod
    def _by_choice(cls, value: object, info: ValidationInfo) -> object:
        """Fill in the defaults that depend on the target, the terms, and the parts of a sum."""
        if not isinstance(value, dict):
            return value
        if "campaign" in value:
            raise Contradiction(
                "this is a campaign of several runs, not an experiment",
                "run it with `mapmore batch`",
                "campaign",
            )
        target, dictionary, model = (value.get(key) for key in ("target", "dictionary", "model"))
        adds, fit = target == "dynamic" and not dictionary, value.setdefault("fit", {})
        if isinstance(model, dict) and (adds or model.get("sum") is not None):
            model.setdefault("type", "sum")
        elif model is None and (adds or dictionary is None):
            value["model"] = {"type": "sum" if adds else "auto"}
        if not isinstance(fit, dict):
            return value
        memory = _given_memory(dictionary, info)
        if memory:
            # without scaling, terms with memory contain the quantities in physical units
            fit.setdefault("scaling", "none")
        elif dictionary and target == "damping":
            # a shift of the origin would turn a product of powers into a sum of terms
            fit.setdefault("scaling", "max_abs")
        if memory or (dictionary and _pooled(value)):
            _sized_by_data(fit)
        return value

    @property
    def own_formulas(self) -> dict[str, OwnFormula]:
        """Formulas that the spec defines, by name. The loader has read their files."""
        return {
            formula.name: formula for formula in self.formulas if isinstance(formula, OwnFormula)
        }

    @property
    def target_quantity(self) -> str:
        """Measured quantity from which the target is computed. It is `force` if the target is the
        force or a part of the force, and otherwise the column that is modelled.
        """
        return self.target.column if isinstance(self.target, TargetColumn) else "force"

    @property
    def also(self) -> tuple[str, ...]:
        """Further quantities that are modelled with the same segments and terms."""
        return tuple(self.target.also or ()) if isinstance(self.target, TargetColumn) else ()

    @property
    def targets(self) -> tuple[str, ...]:
        """All quantities that are modelled."""
        return (self.target_quantity, *self.also)

    @property
    def each(self) -> tuple[ExperimentSpec, ...]:
        """The spec of a study of each single target. With only one target, this is the spec
        itself.
        """
        alone = [{"target": TargetColumn(column=name)} for name in self.targets if self.also]
        return tuple(self.model_copy(update=update) for update in alone) or (self,)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all quantities of the study: the quantities of its data, and `direction` if a
        segment boundary separates the directions of motion.
        """
        cut = [name for name, how in self.segment.items() if isinstance(how, CutByDirection)]
        return tuple(dict.fromkeys((*self.data.quantities, *cut)))

    @property
    def has_memory(self) -> bool:
        """Return True if the run's own model has terms with memory."""
        return self.model.type == "mapmore" and remembers(self.dictionary)

    @property
    def runs_over_time(self) -> bool:
        """Return True if the run's own model predicts the samples of a recording one after the
        other, in the order of time.
        """
        return self.has_memory or self.model.over_time

    @model_validator(mode="after")
    def _structured(self, info: ValidationInfo) -> ExperimentSpec:
        """Check that a spec has a dictionary or a formula. If a search chooses the structure
        (`model: {type: auto}`), check instead that the spec has no section that is a part of the
        structure.
        """
        parts = [
            name
            for name, empty in (("segment", {}), ("fit", Fit()), ("dictionary", []))
            if getattr(self, name) != empty
        ]
        if isinstance(info.context, Context) and info.context.partial:
            return self
        if self.model.type == "auto" and parts:
            remedy = (
                "remove it, or write the whole structure: `dictionary: "
                "[{polynomial: {of: [strain], order: 4}}]`"
            )
            raise Contradiction(
                f"`{parts[0]}` is a part of the structure, which `model: {{type: auto}}` chooses "
                "in a search",
                remedy,
                *parts,
            )
        if self.model.type == "mapmore" and not self.dictionary:
            example = (
                "`[{polynomial: {of: [strain], order: 4}}]`, or `model: {type: literature, "
                "name: sarosi}`"
            )
            raise Contradiction(
                "there are no candidate terms",
                f"add a `dictionary`, for example {example}",
                "dictionary",
                "model",
                "name",
            )
        return self
