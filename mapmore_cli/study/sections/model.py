"""Define the sections `needs` and `model`, and the formulas that a spec defines itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from math import inf
from typing import TYPE_CHECKING, Annotated, Literal

from annotated_types import Gt, Len
from pydantic import Field

from mapmore_cli.domain import plugins
from mapmore_cli.domain.declared import Contradiction, Pair, Seconds, Settings, always_in
from mapmore_cli.modelling import kinds
from mapmore_cli.modelling.literature.own import FamilySettings
from mapmore_cli.study.fields import Quantity, Row, Section, SpecPath

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)


class FormulaParameter(Section):
    """A parameter of a formula.

    - `unit`: Unit of the parameter, shown beside its value. Example: `kPa`
    - `bounds`: Smallest and largest value of the parameter. Required if the formula is not linear
      in this parameter. Example: `[0, 10]`
    """

    unit: str | None = None
    bounds: Pair | None = None

    def _contradictions(self) -> Sequence[Row]:
        low, high = self.bounds or (-inf, inf)
        return [
            (
                not low < high,
                f"the lower bound {low:g} is not below the upper bound {high:g}",
                "put the lower bound first",
                "bounds",
            )
        ]


class OwnFormula(Section):
    """A formula of your own. The name of your formula can be used wherever a formula of the
    literature can be named.

    - `name`: Name of the formula. Example: `my_formula`
    - `expression`: The force as an expression of quantities and parameters. Example: `a*pressure*(1
      - b*strain)^2`
    - `source`: Where the formula comes from. Example: `my notes`
    - `units`: Units of the quantities in the expression; the model's units by default. Example:
      `{pressure: bar}`
    - `parameters`: The parameters of the formula. The formula must be linear in every parameter
      without `bounds`. Example: `{a: {unit: N/kPa}, b: {bounds: [0, 10]}}`
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=60)]
    expression: Annotated[str, Field(max_length=2000)]
    source: Annotated[str, Field(max_length=500)] = ""
    units: dict[Quantity, str] = {}
    parameters: Annotated[dict[Quantity, FormulaParameter], Field(min_length=1)]

    def definition(self, units: Mapping[str, str]) -> str:
        """Return the formula as a text (a definition) that can be used without the spec. Its
        quantities are in the `units` of the model.

        Raises ExpressionError for a malformed expression, SpecError for a wrong unit, and
        ValueError if the formula is nonlinear in a parameter that has no bounds.
        """
        from mapmore_cli.modelling.expressions import (
            Name,
            Number,
            multiply,
            parse,
            substitute,
            to_text,
        )
        from mapmore_cli.modelling.literature.own import definition
        from mapmore_cli.study.units import convert

        scaled = {
            name: multiply(Number(convert(1.0, units[name], unit)), Name(name))
            for name, unit in self.units.items()
            if name in units and units[name] != unit
        }
        return definition(
            self.name,
            self.source or "the spec",
            to_text(substitute(parse(self.expression), scaled)),
            {name: parameter.bounds for name, parameter in self.parameters.items()},
            {
                name: parameter.unit
                for name, parameter in self.parameters.items()
                if parameter.unit is not None
            },
        )


@dataclass(frozen=True)
class Needs(Settings):
    """Specs of the runs on which this run builds.

    - `static`: The run with the static model. The static model is subtracted from the force to
      obtain the damping force, or is a part of the sum. Example: `static.yaml`
    - `damping`: The run with the damping model, which is added to the static model. Example:
      `damping.yaml`
    """

    static: SpecPath | None = None
    damping: SpecPath | None = None


@dataclass(frozen=True, kw_only=True)
class TendonSettings(Settings):
    """An elastic tendon between the muscle and the point where force and length are measured.

    - `stiffness`: Force per length by which the tendon is stretched. Example: `2 kN/m`
    - `force`: Force of the tendon at its rest length. Example: `0.5 N`
    """

    stiffness: Annotated[float, Gt(0), always_in("N/m")]
    force: Annotated[float, always_in("N")] = 0.0


@dataclass(frozen=True, kw_only=True)
class Summand(Settings):
    """A part of a sum: the model of another run, or a formula.

    - `model`: Path of the spec of the other run. Example: `flexor.yaml`
    - `formula`: Name of a formula. Example: `sarosi`
    - `sign`: Whether the part is added (1) or subtracted (-1). Example: `-1`
    - `inputs`: Expression for each input of the part, in the quantities of this study. If two parts
      have inputs of the same name that are different quantities, give an expression for both.
      Example: `{pressure: p1, strain: "-s"}`
    - `tendon`: The tendon in series with this part, which must be the model of a muscle. Example:
      `{stiffness: 2 kN/m}`
    """

    model: SpecPath | None = None
    formula: str | None = None
    sign: Literal[1, -1] = 1
    inputs: Annotated[dict[Quantity, str], Field(json_schema_extra={"default": {}})] = field(
        default_factory=dict
    )
    tendon: TendonSettings | None = None

    def __post_init__(self) -> None:
        """Require either a model or a formula, and refuse a formula in series with a tendon."""
        if self.tendon is not None and self.formula is not None:
            raise Contradiction(
                "a formula cannot be fitted behind a tendon",
                "fit the formula in a run of its own, and name its spec as `model`",
                "tendon",
            )
        if (self.model is None) == (self.formula is None):
            raise Contradiction(
                "a part of a sum needs either `model` or `formula`",
                "give one of them, for example `{model: flexor.yaml}`",
                "model",
                "formula",
            )


FitMethod = Literal["variable_projection", "levenberg_marquardt", "simplex"]
"""How a formula of the literature is fitted."""

Summands = Annotated[Sequence[Summand], Len(1)]
"""Parts of a sum: models of runs, or formulas that are fitted together."""


def refuse_mixed(parts: Sequence[Summand]) -> None:
    """Refuse a sum in which some parts are models of runs and others are formulas."""
    if len({part.formula is None for part in parts}) > 1:
        raise Contradiction(
            "this sum mixes models and formulas",
            "fit each formula in a run of its own, and name its spec as `model`",
            "sum",
        )


if TYPE_CHECKING:
    ModelType = str
else:  # names of mapmore's own types of models, and of the types that plugins add
    ModelType = Literal[(*kinds.OWN_TYPES, *sorted(plugins.entry_points("kinds")))]


@dataclass(frozen=True, kw_only=True)
class ModelSettings(Settings):
    """The kind of model that the run builds. Each key except `type` belongs to one type of model,
    and is refused for the other types. The key `backbone` belongs to the type `mapmore`. The keys
    `name` and `family` belong to `literature`, the keys `budget`, `prefer` and `inputs` to `auto`,
    and the key `sum` to the type `sum`. All other keys belong to `state_space`. The value of `type`
    is one of these words:

    - `mapmore` fits a function to each segment. The function consists of terms of the dictionary,
      and may be added to a formula (the backbone).
    - `literature` fits the formula `name` alone, or a `family`.
    - `auto` searches a structure for the model on the training data. `auto` is the default if the
      spec has neither `dictionary` nor `model`. The sections `segment`, `dictionary` and `fit` are
      refused, because the search chooses their settings. The search writes the structure that it
      finds as a spec, `found.yaml`, into the run folder.
    - `sum` adds the static and the damping model of the runs in `needs`, or other models and
      formulas that the key `sum` lists with their signs and their inputs. `sum` is the default if
      the key `sum` is given, and for the target `dynamic` without a dictionary.
    - `state_space` fits a state-space model of motion with linear sections along an input (Brown
      and Xie 2024).

    - `type`: Kind of the model, one of the words above. Example: `literature`
    - `budget`: Computing time of each process of a search. More time tries more structures. If the
      budget ends before all structures were tried, a repetition may choose another one. Example:
      `5 min`
    - `prefer`: With `short`, a search ends after the first list of structures. By default, longer
      structures are tried as well if a black box has an error that is smaller by at least a tenth.
      Example: `short`
    - `inputs`: Inputs that a search may use; by default all quantities that vary. Example:
      `[pressure, strain]`
    - `backbone`: A formula of the literature; the segment functions explain only what remains after
      it. `auto` compares all formulas, and no formula, on training data that were left out; of
      those within 2 % of the smallest error, it takes the one with the fewest parameters. With
      three levels or fewer, it takes `sarosi_hinged`. Example: `sarosi`
    - `name`: The formula of `type: literature`. Example: `sarosi`
    - `sum`: The parts of a sum. Example: `[{model: flexor.yaml}, {model: extensor.yaml, sign: -1}]`
    - `family`: One formula for several specimens that differ in a quantity, for example in their
      length. Example: `{of: rest_length}`
    """

    type: ModelType = "mapmore"
    budget: Seconds = 60.0
    prefer: Literal["short"] | None = None
    inputs: Annotated[Sequence[Quantity], Len(1)] | None = None
    backbone: str | None = None
    name: str | None = None
    sum: Summands | None = None
    family: FamilySettings | None = None

    def __post_init__(self) -> None:
        """Refuse keys that do not belong to the type, and require the keys that the type needs.
        `family` implies `type: literature`.
        """
        if self.type not in (*kinds.OWN_TYPES, *(kind.name for kind in kinds.kinds())):
            raise Contradiction(
                f"no installed package defines the model type `{self.type}`",
                "install the package that defines it, or choose another `type`",
                "type",
            )
        if self.family is not None:
            if self.type not in ("mapmore", "literature"):
                raise Contradiction(
                    f"a model of type `{self.type}` cannot have `family`",
                    "remove `type` or `family`",
                    "family",
                )
            if self.backbone is not None or (
                self.name is not None and not self.name.startswith("{")
            ):
                raise Contradiction(
                    "a family uses its own formula",
                    "remove `backbone` and `name`",
                    "backbone",
                    "name",
                )
            object.__setattr__(self, "type", "literature")
        if self.type == "literature" and self.name is None and self.family is None:
            raise Contradiction(
                "type `literature` needs the `name` of a formula",
                "add it, for example `name: sarosi`",
                "type",
            )
        for key in self.changed:
            owner = _TYPE_OF.get(key, self.type)
            if owner != self.type:
                instead = "use `backbone`, or" if key == "name" else "remove it, or use"
                raise Contradiction(
                    f"a model of type `{self.type}` cannot have `{key}`",
                    f"{instead} `type: {owner}`",
                    key,
                )
        refuse_mixed(self.sum or ())

    @property
    def over_time(self) -> bool:
        """Return True if the output of every model of this type depends on earlier samples of the
        recording, whatever terms the dictionary contains.
        """
        return any(kind.over_time for kind in kinds.kinds() if kind.name == self.type)


_TYPE_OF = {
    **dict.fromkeys(("budget", "prefer", "inputs"), "auto"),
    **{key.name: kind.name for kind in kinds.kinds() for key in fields(kind.settings)},
    **{"name": "literature", "backbone": "mapmore", "sum": "sum"},
}
"""The type of model to which each key belongs. A key of a plugin replaces a key of the search with
the same name; `name`, `backbone` and `sum` always belong to the types of mapmore itself.
"""

if TYPE_CHECKING:
    ModelChoice = ModelSettings
else:  # the keys of the kinds that plugins add come first
    _ADDED = tuple(kind.settings for kind in kinds.kinds() if kind.settings is not Settings)
    _ABOUT = {"__doc__": ModelSettings.__doc__, "__module__": __name__}
    ModelChoice = dataclass(frozen=True, kw_only=True)(
        type("ModelChoice", (ModelSettings, *_ADDED), _ABOUT)
    )
