"""The experiment spec as a pydantic model: its sections, and what holds between them.

Units: every number is already in the model's unit; the loader turns `250 kPa` into a number before validation (see `spec.quantities`), in
the unit that the field's mark names.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, TypeAdapter, ValidationError, ValidationInfo, model_validator

from mapmore_cli.domain.declared import Contradiction, Either, Settings
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Fuse, Segmented
from mapmore_cli.modelling.selection import Fit
from mapmore_cli.spec.fields import PARTIAL, Metres, Name, Quantity, SpecPath, WholeSpec
from mapmore_cli.spec.sections.data import Data
from mapmore_cli.spec.sections.dictionary import DictionaryEntry, remembers
from mapmore_cli.spec.sections.model import ModelChoice, Needs, OwnFormula
from mapmore_cli.spec.sections.results import Report, Validate


@dataclass(frozen=True)
class Muscle(Settings):
    """What was measured, with dimensions in metres; recorded in the results, and used by formulas that need dimensions."""

    name: str | None = None
    kind: str | None = None
    length: Metres | None = None
    diameter: Metres | None = None

    @property
    def lengths(self) -> dict[str, float | None]:
        """The dimensions by name, m; None where nothing is said."""
        return {"length": self.length, "diameter": self.diameter}


@dataclass(frozen=True)
class TargetColumn(Settings):
    """A canonical quantity as target."""

    column: str


@functools.cache
def _dictionaries() -> TypeAdapter[list[DictionaryEntry]]:
    return TypeAdapter(list[DictionaryEntry])


def _given_memory(dictionary: Any) -> bool:
    """Whether a dictionary that is not validated yet has terms with memory; False where its form is wrong, which is reported elsewhere."""
    try:
        return remembers(_dictionaries().validate_python(dictionary))
    except ValidationError:
        return False


class ExperimentSpec(WholeSpec):
    """One experiment: what was measured, how to cut it up, which terms may appear, how to join, what to compare with."""

    schema_version: Literal[1] = 1
    name: Name
    muscle: Muscle = Muscle()
    units: dict[Quantity, str] = {}
    data: Data
    needs: Needs = Needs()
    target: Annotated[Literal["static", "hysteresis", "damping", "dynamic"] | TargetColumn, Either()]
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
        """The guesses of `init` that nobody has confirmed: the file's comments that begin with `CHECK`."""
        return self._unconfirmed

    @model_validator(mode="before")
    @classmethod
    def _by_choice(cls, given: Any) -> Any:
        """Defaults that depend on the target, on the terms, and on the parts of a sum."""
        if not isinstance(given, dict):
            return given
        if "campaign" in given:
            raise Contradiction("this is a campaign of several runs, not an experiment", "run it with `mapmore batch`", "campaign")
        target, dictionary, model, fit = given.get("target"), given.get("dictionary"), given.get("model"), given.get("fit", {})
        adds, chosen = target == "dynamic" and not dictionary, dict(given)
        if isinstance(model, dict) and (adds or model.get("sum") is not None):
            chosen["model"] = {"type": "sum", **model}
        elif model is None and (adds or dictionary is None):
            chosen["model"] = {"type": "sum" if adds else "auto"}
        if isinstance(fit, dict) and _given_memory(dictionary):
            chosen["fit"] = {"scaling": "none", **fit}  # numbers of steps and widths in physical units stay readable
        elif isinstance(fit, dict) and target == "damping":
            chosen["fit"] = {"scaling": "max_abs", **fit}  # pure products, which no shifted origin leaves so
        return chosen

    @property
    def own_formulas(self) -> dict[str, OwnFormula]:
        """The formulas that the spec defines, by name; the loader has read their files."""
        return {one.name: one for one in self.formulas if isinstance(one, OwnFormula)}

    @property
    def target_quantity(self) -> str:
        """The measured quantity that is modelled, or whose component is."""
        return self.target.column if isinstance(self.target, TargetColumn) else "force"

    @property
    def quantities(self) -> tuple[str, ...]:
        """Every quantity of the study: of its data, and the `direction` where segments are cut by it."""
        cut = [name for name, how in self.segment.items() if isinstance(how, CutByDirection)]
        return tuple(dict.fromkeys((*self.data.quantities, *cut)))

    @property
    def has_memory(self) -> bool:
        """Whether the run's own model has terms with memory."""
        return self.model.type == "mapmore" and remembers(self.dictionary)

    @property
    def runs_over_time(self) -> bool:
        """Whether the run's own model runs along recordings."""
        return self.has_memory or self.model.type == "state_space"

    @model_validator(mode="after")
    def _structured(self, info: ValidationInfo) -> ExperimentSpec:
        """Require a structure where none is searched, and none where one is."""
        given = [name for name, empty in (("segment", {}), ("fit", Fit()), ("dictionary", [])) if getattr(self, name) != empty]
        if info.context is PARTIAL:
            return self
        if self.model.type == "auto" and given:
            remedy = "remove it, or say the whole structure, as `dictionary: [{polynomial: {of: [strain], order: 4}}]`"
            raise Contradiction(f"`{given[0]}` is part of the structure that `model: {{type: auto}}` searches", remedy, *given)
        if self.model.type == "mapmore" and not self.dictionary:
            example = "`[{polynomial: {of: [strain], order: 4}}]`, or `model: {type: literature, name: sarosi}`"
            raise Contradiction("there are no candidate terms", f"add a `dictionary`, as {example}", "dictionary", "model", "name")
        return self
