"""The sections `needs` and `model`: the runs that a model builds on, and its kind; and formulas
that a spec defines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
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

    - `unit`: its unit, shown beside its value, as `kPa`
    - `bounds`: between what it is sought, where the formula is not linear in it, as `[0, 10]`
    """

    unit: str | None = None
    bounds: Pair | None = None

    def _contradictions(self) -> Sequence[Row]:
        low, high = self.bounds or (0.0, 1.0)
        return [
            (
                not low < high,
                f"the lower bound {low:g} is above the upper bound {high:g}",
                "put the lower bound first",
                "bounds",
            )
        ]


class OwnFormula(Section):
    """A formula to be named wherever one of the literature may be.

    - `name`: its name, as `my_formula`
    - `expression`: the force, of quantities and parameters, as `a*pressure*(1 - b*strain)^2`
    - `source`: where it is from, as `my notes`
    - `units`: units that the expression is written in, by quantity; those of the model by default,
      as `{pressure: bar}`
    - `parameters`: its parameters; one without `bounds` must be one in which it is linear, as `{a:
      {unit: N/kPa}, b: {bounds: [0, 10]}}`
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]*$", max_length=60)]
    expression: Annotated[str, Field(max_length=2000)]
    source: Annotated[str, Field(max_length=500)] = ""
    units: dict[Quantity, str] = {}
    parameters: Annotated[dict[Quantity, FormulaParameter], Field(min_length=1)]

    def definition(self, units: Mapping[str, str]) -> str:
        """Return the formula in a model's `units` as a definition that needs no spec.

        Raises ExpressionError, SpecError, ValueError for an expression that is none, a unit that
        does not fit, or a parameter in which it is not linear.
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
            {name: one.bounds for name, one in self.parameters.items()},
            {name: one.unit for name, one in self.parameters.items() if one.unit is not None},
        )


@dataclass(frozen=True)
class Needs(Settings):
    """Specs of the runs that this one builds on.

    - `static`: the run whose model is subtracted to obtain the damping force, or is a part of the
      sum, as `static.yaml`
    - `damping`: the run whose model is added to it, as `damping.yaml`
    """

    static: SpecPath | None = None
    damping: SpecPath | None = None


@dataclass(frozen=True, kw_only=True)
class TendonSettings(Settings):
    """A tendon between a muscle and what is measured.

    - `stiffness`: force for each length that it is stretched by, as `2 kN/m`
    - `force`: what it carries where the length is zero, as `0.5 N`
    """

    stiffness: Annotated[float, Gt(0), always_in("N/m")]
    force: Annotated[float, always_in("N")] = 0.0


@dataclass(frozen=True, kw_only=True)
class Summand(Settings):
    """A part of a sum: the model of another run, or a formula.

    - `model`: the path of the run's spec, as `flexor.yaml`
    - `formula`: the name of a formula, as `sarosi`
    - `sign`: 1 or -1, as `-1`
    - `inputs`: what the part's inputs are called in this study, as expressions; one that two parts
      share by name must be renamed for both, as `{pressure: p1, strain: "-s"}`
    - `tendon`: what the model of a muscle is behind, as `{stiffness: 2 kN/m}`
    """

    model: SpecPath | None = None
    formula: str | None = None
    sign: Literal[1, -1] = 1
    inputs: Annotated[dict[Quantity, str], Field(json_schema_extra={"default": {}})] = field(
        default_factory=dict
    )
    tendon: TendonSettings | None = None

    def __post_init__(self) -> None:
        """Refuse both, and neither; and a formula behind a tendon."""
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
"""The parts: models of runs, or formulas that are fitted together."""


def refuse_mixed(parts: Sequence[Summand]) -> None:
    """Refuse parts of which some are fitted by runs of their own and others here."""
    if len({part.formula is None for part in parts}) > 1:
        raise Contradiction(
            "this sum mixes models and formulas",
            "fit each formula in a run of its own, and name its spec as `model`",
            "sum",
        )


_OWN_TYPES = ("mapmore", "literature", "auto")
if TYPE_CHECKING:
    ModelType = str
else:  # our words, and those of the kinds that add themselves
    ModelType = Literal[(*_OWN_TYPES, *sorted(plugins.entry_points("kinds")))]


@dataclass(frozen=True, kw_only=True)
class ModelSettings(Settings):
    """What kind of model the run builds.

    - `mapmore`: segment functions of the dictionary, on a backbone or alone.
    - `literature`: the formula `name` alone, or a `family`.
    - `auto`: the structure is searched on training data. It is the default without `dictionary` and
      `model`. The run folder holds the result as a spec, `found.yaml`.
    - `sum`: the static and the damping model that the spec needs (default for `dynamic`), or parts
      with signs and renamed inputs.
    - `state_space`: P's model of motion, linear sections along an input.

    - `type`: one of these, as `literature`
    - `budget`: computing time of each process of a search, as `5 min`
    - `prefer`: `short` ends a search with the first list of structures; by default longer ones are
      tried where a black box errs less by a tenth, as `short`
    - `inputs`: inputs of what is searched; all quantities that vary by default, as `[pressure,
      strain]`
    - `backbone`: formula whose residual the pieces explain; `auto` takes the formula, or none,
      whose fused model errs least on left-out training data (with three levels or fewer
      `sarosi_hinged`), as `sarosi`
    - `name`: the formula of `type: literature`, as `sarosi`
    - `sum`: the parts of a sum, as `[{model: flexor.yaml}, {model: extensor.yaml, sign: -1}]`
    - `family`: one formula for specimens that differ in a quantity, as `{of: rest_length}`
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
        """Refuse keys that the type lacks, or has no use for; a family is a formula."""
        if self.type not in (*_OWN_TYPES, *(kind.name for kind in kinds.kinds())):
            raise Contradiction(f"type `{self.type}` is not installed", "install it", "type")
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
        """Whether the type has models that run along recordings, whatever the dictionary."""
        return self.type in plugins.entry_points("kinds") and kinds.named(self.type).over_time


_TYPE_OF = {
    **dict.fromkeys(("budget", "prefer", "inputs"), "auto"),
    **{key.name: one.name for one in kinds.kinds() for key in fields(one.settings)},
    **{"name": "literature", "backbone": "mapmore", "sum": "sum"},
}
"""The keys that one type alone has."""

if TYPE_CHECKING:
    ModelChoice = ModelSettings
else:  # with the keys of the kinds that add themselves
    _ADDED = tuple(one.settings for one in kinds.kinds() if one.settings is not Settings)
    _ABOUT = {"__doc__": ModelSettings.__doc__, "__module__": __name__}
    ModelChoice = dataclass(frozen=True, kw_only=True)(
        type("ModelChoice", (ModelSettings, *_ADDED), _ABOUT)
    )
