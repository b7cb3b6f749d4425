"""The experiment spec as pydantic models: what a YAML file may say, with the defaults.

Units: every number here is already in the model's unit; the loader turns `250 kPa` into a number before validation (see
`spec.quantities`), in the unit that the field's mark names.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from itertools import pairwise
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter, ValidationError, ValidationInfo, model_validator

from mapmore_cli.spec.data_section import (
    Between,
    Cycles,
    Data,
    Direction,
    Gaps,
    Holdout,
    Levels,
    Rate,
    Split,
)
from mapmore_cli.spec.dictionary_section import DictionaryEntry, Polynomial, remembers
from mapmore_cli.spec.fields import (
    PARTIAL,
    Keyed,
    Measured,
    Metres,
    Metric,
    Name,
    Number,
    OfHeld,
    OfKey,
    OfTarget,
    Positive,
    Quantity,
    RelativePath,
    Section,
    Share,
    Text,
    by_shape,
    by_shape_or_key,
    contradiction,
    of_sibling,
    with_key,
)
from mapmore_cli.spec.keep import Keep
from mapmore_cli.spec.table_section import Column, FileEntry, Join, Table

__all__ = [
    "BelowAbove",
    "Between",
    "Column",
    "Competitor",
    "Cuts",
    "Cycles",
    "Data",
    "DictionaryEntry",
    "Direction",
    "Directions",
    "ExperimentSpec",
    "ExtrapolationWord",
    "FileEntry",
    "Fit",
    "Fuse",
    "Gaps",
    "Holdout",
    "Join",
    "Keep",
    "Levels",
    "ModelChoice",
    "Muscle",
    "Name",
    "Needs",
    "Polynomial",
    "Positive",
    "Published",
    "Rate",
    "Report",
    "Section",
    "Split",
    "Table",
    "TargetColumn",
    "Validate",
]

ExtrapolationWord = Literal["continue", "continue_linear", "saturate", "zero"]
"""What happens beyond a limit (M2 eq 12)."""
FigureName = Literal["data", "fit", "error", "nrmse", "segments", "terms"]
WordOrValue = Annotated[Annotated[ExtrapolationWord, Text] | Annotated[OfKey, Number], by_shape]


class Muscle(Section):
    """What was measured, with dimensions in metres; recorded in the results, and used by formulas that need dimensions."""

    name: str | None = None
    kind: str | None = None
    length: Metres | None = None
    diameter: Metres | None = None


class TargetColumn(Section):
    """A canonical quantity as target."""

    column: str


class Cuts(Section):
    """How one variable is cut into segments.

    `even` needs `count`; `breakpoints` needs the inner boundaries, `at`; `gradient` puts `count - 1` boundaries where the slope of the
    target changes most, seen through a `window` (a tenth of each curve's range) and `separation` apart (the window); `optimal` puts them
    where the fits of the segments leave the least, on a `grid` of equal cells (20) with `min_samples` in each segment (10).
    """

    method: Literal["even", "breakpoints", "gradient", "optimal"]
    count: Annotated[int, Field(ge=1)] | None = None
    at: Annotated[list[OfKey], Field(min_length=1)] | None = None
    window: Annotated[OfKey, Field(gt=0)] | None = None
    separation: Annotated[OfKey, Field(gt=0)] | None = None
    grid: Annotated[int, Field(ge=1, le=200)] | None = None
    min_samples: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _whole(self) -> Cuts:
        needed = "at" if self.method == "breakpoints" else "count"
        if getattr(self, needed) is None:
            example = "count: 4" if needed == "count" else "at: [0.05, 0.1]"
            raise contradiction(f"method `{self.method}` needs `{needed}`", f"add it, as `{example}`", "method")
        useful = {"gradient": {"window", "separation"}, "optimal": {"grid", "min_samples"}}.get(self.method, set()) | {"method", needed}
        for other in type(self).model_fields:
            if other not in useful and getattr(self, other) is not None:
                raise contradiction(f"method `{self.method}` has no use for `{other}`", f"remove `{other}`", other)
        if self.at is not None and any(after <= before for before, after in pairwise(self.at)):
            raise contradiction("the breakpoints do not increase", f"write `at: {sorted(set(self.at))}`", "at")
        if self.method == "optimal" and self.count is not None and self.count > (self.grid or self.count):
            raise contradiction(
                f"{self.count} segments do not fit on a grid of {self.grid} cells", "raise `grid`, or lower `count`", "grid"
            )
        return self


class Directions(Section):
    """Segments for rise and fall: by the sign of the rate `of` a quantity, with a `dead_band` in which the last direction holds."""

    of: str
    dead_band: Annotated[float, Field(gt=0), of_sibling("of")]


class Needs(Section):
    """Specs of the runs that this one builds on: the `static` model that a damping force is left by, the `damping` model added to it."""

    static: Annotated[str, RelativePath()] | None = None
    damping: Annotated[str, RelativePath()] | None = None


class ModelChoice(Section):
    """What kind of model the run builds.

    `mapmore` with a `backbone` explains by pieces what that formula leaves; `literature` fits the formula `name` alone; `sum` adds the
    static and the damping model that the spec needs, and is the default for the target `dynamic`.
    """

    type: Literal["mapmore", "literature", "sum"] = "mapmore"
    backbone: str | None = None
    name: str | None = None

    @model_validator(mode="after")
    def _fits_type(self) -> ModelChoice:
        if self.type == "literature" and self.name is None:
            raise contradiction("type `literature` needs the `name` of a formula", "add it, as `name: sarosi`", "type")
        if self.type == "literature" and self.backbone is not None:
            raise contradiction("type `literature` has no `backbone`", "remove it, or use `type: mapmore`", "backbone")
        if self.type != "literature" and self.name is not None:
            raise contradiction(f"type `{self.type}` has no `name`", "use `backbone`, or `type: literature`", "name")
        if self.type == "sum" and self.backbone is not None:
            raise contradiction("type `sum` has no `backbone`", "remove it: both models have their own", "backbone")
        return self


class Fit(Section):
    """Term selection (M2 eq 2-7): how inputs are scaled, how many terms at most, and when to stop.

    `scaling` is `none` for terms with memory and `max_abs` for damping where nothing is said, else `unit_square`. `train_level` restricts
    the pieces to one training level, as M2 does (`highest`); formulas are fitted to all of them.

    With memory: `scaling: range` brings every state to [0, 1] on the training samples and clips it `margin` beyond; a `ridge`, as a
    fraction of a candidate's variance, or `auto`, selects `forward` terms (three times `max_terms`) and prunes them; `stop: free_run`
    keeps as many terms as run best over the last quarter of the training samples.
    """

    scaling: Literal["unit_square", "max_abs", "none", "range"] = "unit_square"
    margin: Annotated[float, Field(ge=0), Measured(lambda _: "1")] = 0.15
    train_level: Annotated[Annotated[Literal["all", "highest"], Text] | Annotated[OfHeld, Number], by_shape] = "all"
    max_terms: Annotated[int, Field(ge=1)] = 1
    tolerance: Annotated[float, Field(ge=0, lt=1)] = 1e-4
    stop: Literal["tolerance", "bic", "aicc", "press", "free_run"] = "tolerance"
    ridge: Annotated[Annotated[Literal["auto"], Text] | Annotated[Annotated[float, Field(ge=0)], Number], by_shape] = 0.0
    forward: Annotated[int, Field(ge=1)] | None = None


class BelowAbove(Section):
    """Extrapolation of one variable on each side: a word, or the value that the variable takes (M2 eq 12)."""

    below: WordOrValue | None = None
    above: WordOrValue | None = None


Sides = Annotated[Annotated[ExtrapolationWord, Text] | Annotated[BelowAbove, Keyed], by_shape]


class Fuse(Section):
    """How pieces are joined (M2 eq 9-12).

    Transition zones reach `z_s` of a segment's width to each side of a boundary. Between levels, curves are interpolated by triangles
    (`levels: linear`) or keeping their shape (`pchip`), and with `align: threshold` between places that lie alike relative to their
    thresholds. `shrink` is the share of the residual on a backbone that is carried to the middle between two levels: `auto` asks left-out
    training levels, 1 carries all of it, 0 leaves the backbone alone there. `extrapolation` is a word for all variables, or a mapping from
    variable to word or `{below, above}`; without it, `continue` for one-term fits, else `saturate`.
    """

    transition: Literal["linear", "quadratic", "cubic"] = "linear"
    z_s: Annotated[float, Field(ge=0, le=0.5)] = 0.25
    levels: Literal["linear", "pchip"] = "linear"
    align: Literal["none", "threshold"] = "none"
    shrink: Annotated[Annotated[Literal["auto"], Text] | Annotated[Annotated[float, Field(ge=0, le=1)], Number], by_shape] = "auto"
    extrapolation: Annotated[Annotated[ExtrapolationWord, Text] | Annotated[dict[str, Sides], Keyed], by_shape] | None = None


class Competitor(Section):
    """A competitor with settings of its own: a literature `model`, or that of another `run` (the path of its spec) or of this one, changed.

    `set` has keys of this spec with other values, as `--set` takes them; the run is called `<name>.<as>`. A composite of a `static` and a
    `damping` formula stands against damping and dynamic models; `static: mapmore` is the static model that the spec needs. `method` says
    how a literature model is fitted, `as` is the name of the scores; a run's is else the name of its file.
    """

    model: str | None = None
    run: Annotated[str, RelativePath()] | None = None
    set: dict[str, Any] | None = None
    static: str | None = None
    damping: str | None = None
    method: Literal["variable_projection", "levenberg_marquardt"] | None = None
    as_: Name | None = Field(default=None, alias="as")

    @model_validator(mode="after")
    def _one_model(self) -> Competitor:
        kinds = (self.model, self.run, self.set, self.static if self.static is not None else self.damping)
        if sum(kind is not None for kind in kinds) != 1:
            remedy = "give one of the four, as `{model: sarosi}`"
            found = "a competitor is a `model`, a `run`, this spec with keys `set`, or `static` with `damping`"
            raise contradiction(found, remedy, "model", "run", "set", "static")
        if self.set is not None and self.as_ is None:
            raise contradiction("changed settings need a name", "add it, as `{set: {fit.max_terms: 1}, as: one_term}`", "set")
        if (self.static is None) != (self.damping is None):
            remedy = "add the other, as `{static: sarosi, damping: reynolds}`; `damping: none` adds nothing"
            raise contradiction("a composite needs `static` and `damping`", remedy, "static", "damping")
        if (self.run is not None or self.set is not None) and self.method is not None:
            raise contradiction("another run has a fit of its own", "remove `method`", "method")
        return self

    @property
    def label(self) -> str:
        """The name of its scores."""
        composite = f"{self.static}+{self.damping}" if self.static else None
        return self.as_ or self.model or composite or PurePosixPath(str(self.run)).stem


class Validate(Section):
    """What the model is compared with, what errors are divided by, and the limits that its scores must keep.

    `normaliser: max` is the largest absolute value of the measured target (M2 eq 13), `range` its extent, where its zero is arbitrary.
    """

    against: list[Annotated[Annotated[str, Text] | Annotated[Competitor, Keyed], by_shape]] = []
    normaliser: Literal["max", "range"] = "max"
    require: dict[str, Metric] = {}


class Published(Section):
    """Numbers of a publication to show beside ours, by model: `nrmse` as fractions, `rmse` in the target's unit. Never computed with."""

    source: str
    nrmse: dict[str, Share] = {}
    rmse: dict[str, OfTarget] = {}


class Report(Section):
    """Figures and files of the report; `units` are further units, by quantity, to print the equations in, as a publication does."""

    figures: list[FigureName] = ["data", "fit", "error", "nrmse", "segments", "terms"]
    formats: list[Literal["html", "csv", "svg"]] = ["html", "csv", "svg"]
    published: Published | None = None
    units: dict[Quantity, str] = {}


_DEFAULTS_OF_TARGET: dict[str, tuple[str, dict[str, str]]] = {
    "damping": ("fit", {"scaling": "max_abs"}),  # M2's damping terms are pure products, which a shifted origin would not leave so
    "dynamic": ("model", {"type": "sum"}),
}


def _given_memory(dictionary: Any) -> bool:
    """Whether a dictionary that is not validated yet has terms with memory; False where its form is wrong, which is reported elsewhere."""
    try:
        return remembers(TypeAdapter(list[DictionaryEntry]).validate_python(dictionary))
    except ValidationError:
        return False


class ExperimentSpec(Section):
    """One experiment: what was measured, how to cut it up, which terms may appear, how to join, what to compare with."""

    schema_version: Literal[1] = 1
    name: Name
    muscle: Muscle = Muscle()
    units: dict[Quantity, str] = {}
    data: Data
    needs: Needs = Needs()
    target: Annotated[Annotated[Literal["static", "hysteresis", "damping", "dynamic"], Text] | Annotated[TargetColumn, Keyed], by_shape]
    segment: dict[
        str,
        Annotated[
            Annotated[Cuts, Keyed] | Annotated[Directions, with_key("dead_band")] | Annotated[Literal["none", "levels"], Text],
            by_shape_or_key("dead_band"),
        ],
    ] = {}
    dictionary: list[DictionaryEntry] = []
    model: ModelChoice = ModelChoice()
    fit: Fit = Fit()
    fuse: Fuse = Fuse()
    validation: Validate = Field(default=Validate(), alias="validate")
    report: Report = Report()

    @model_validator(mode="before")
    @classmethod
    def _no_campaign(cls, given: Any) -> Any:
        if isinstance(given, dict) and "campaign" in given:
            raise contradiction("this is a campaign of several runs, not an experiment", "run it with `mapmore batch`", "campaign")
        return given

    @model_validator(mode="before")
    @classmethod
    def _by_choice(cls, given: Any) -> Any:
        """Defaults that depend on the target and on the terms."""
        if not isinstance(given, dict):
            return given
        section, defaults = _DEFAULTS_OF_TARGET.get(str(given.get("target")), ("", {}))
        if _given_memory(given.get("dictionary")):
            section, defaults = "fit", {"scaling": "none"}  # numbers of steps and widths in physical units stay readable
        said = given.get(section, {})
        if not isinstance(said, dict) or not defaults or (section == "model" and given.get("dictionary")):
            return given
        return {**given, section: {**defaults, **said}}

    @property
    def target_quantity(self) -> str:
        """The measured quantity that is modelled, or whose component is."""
        return self.target.column if isinstance(self.target, TargetColumn) else "force"

    @property
    def quantities(self) -> tuple[str, ...]:
        """Every quantity of the study: of its data, and the `direction` where segments are cut by it."""
        cut = [name for name, how in self.segment.items() if isinstance(how, Directions)]
        return tuple(dict.fromkeys((*self.data.quantities, *cut)))

    @property
    def has_memory(self) -> bool:
        """Whether the run's own model has terms with memory."""
        return self.model.type == "mapmore" and remembers(self.dictionary)

    @model_validator(mode="after")
    def _needs_terms(self, info: ValidationInfo) -> ExperimentSpec:
        if self.model.type == "mapmore" and not self.dictionary and info.context is not PARTIAL:
            raise contradiction(
                "there are no candidate terms",
                "add a `dictionary`, as `[{polynomial: {of: [strain], order: 4}}]`, or `model: {type: literature, name: sarosi}`",
                "dictionary",
                "model",
                "name",
            )
        return self
