"""The experiment spec as a pydantic model: its sections, and what holds between them.

Units: every number is already in the model's unit; the loader turns `250 kPa` into a number before
validation (see `spec.fields`), in the unit that the field's mark names.
"""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from annotated_types import Len
from pydantic import (
    BeforeValidator,
    Field,
    JsonValue,
    PlainSerializer,
    PrivateAttr,
    SerializationInfo,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from mapmore_cli.domain.declared import Contradiction, Either, Name, OfTarget, Settings
from mapmore_cli.domain.scores import Published
from mapmore_cli.modelling.pieces.recipe import CutByDirection, Fuse, Segmented
from mapmore_cli.modelling.selection import TERMS_OF_ONE_MODEL, Fit
from mapmore_cli.reporting.order import FIGURES
from mapmore_cli.study.fields import (
    Context,
    Metres,
    Metric,
    PathOrName,
    Quantity,
    Row,
    Section,
    Share,
    SpecPath,
    TargetKind,
    as_target,
    moved_path,
    read_path,
)
from mapmore_cli.study.sections.data import Data
from mapmore_cli.study.sections.dictionary import DictionaryEntry, remembers
from mapmore_cli.study.sections.model import (
    FitMethod,
    ModelChoice,
    Needs,
    OwnFormula,
    Summands,
    refuse_mixed,
)


@dataclass(frozen=True)
class Muscle(Settings):
    """What was measured; recorded in the results, and used by formulas that need dimensions.

    - `name`: what it is called on pages, as `DMSP-20-88N`
    - `kind`: what kind of muscle it is, as `mckibben`
    - `length`: active length at rest, as `88 mm`
    - `diameter`: inner diameter at rest, as `20 mm`
    """

    name: str | None = None
    kind: str | None = None
    length: Metres | None = None
    diameter: Metres | None = None

    @property
    def lengths(self) -> dict[str, float | None]:
        """The dimensions by name, m; None if nothing is said."""
        return {"length": self.length, "diameter": self.diameter}


@dataclass(frozen=True)
class TargetColumn(Settings):
    """A measured quantity as target; `target: tip` is short for `target: {column: tip}`, and
    `target: [tip_x, tip_y]` for `target: {column: tip_x, also: [tip_y]}`.

    - `column`: the quantity, a key of `data.columns` or `data.derive`, as `tip`
    - `also`: others that share its segments and terms, as `[tip_y]`
    """

    column: str
    also: Annotated[Sequence[Quantity], Len(1)] | None = None


# What comes out
# --------------------------------------------------------------------------------------------------


OF_PATHS = ("needs.static", "needs.damping", "data.files")
"""Keys of a spec whose values are paths."""


def _with_paths(settings: Mapping[str, Any], change: Callable[[str], object]) -> dict[str, Any]:
    """Return keys of a spec with every path in their values changed."""

    def changed(value: object) -> object:
        if isinstance(value, list):
            return [changed(entry) for entry in value]
        if isinstance(value, dict) and "path" in value:
            return {**value, "path": changed(value["path"])}
        return change(value) if isinstance(value, str) else value

    return {key: changed(value) if key in OF_PATHS else value for key, value in settings.items()}


def _read_settings(given: object, info: ValidationInfo) -> object:
    read = partial(read_path, info=info, bare=False)
    return _JSON.validate_python(_with_paths(given, read)) if isinstance(given, dict) else given


def _moved_settings(settings: Mapping[str, Any], info: SerializationInfo) -> dict[str, Any]:
    return _with_paths(settings, partial(moved_path, info=info, bare=False))


_JSON = TypeAdapter(JsonValue)

OtherSettings = Annotated[
    dict[str, Any], BeforeValidator(_read_settings), PlainSerializer(_moved_settings)
]
"""Keys of a spec, as `fit.max_terms`, with other values; quantities wait for the spec that they
set.
"""


class Competitor(Section):
    """A competitor with settings of its own: a `model`, a `run`, this spec with other settings
    (`set`), a `sum`, or `static` with `damping`.

    - `model`: a formula of the literature, a black box (`gaussian_process` and others), or a frozen
      model (a path that ends in `.h5`, with `as`), as `sarosi`
    - `run`: the path of the spec whose model is compared, as `other.yaml`
    - `set`: keys of this spec with other values, in a run called `<name>.<as>`, as `{fit.max_terms:
      1}`
    - `static`: a formula to which `damping` is added, or `mapmore` for the static model that the
      spec needs, as `sarosi`
    - `damping`: a formula of the damping force, or `none`, as `reynolds`
    - `method`: how a formula is fitted (variable projection by default), as `simplex`
    - `starts`: where `levenberg_marquardt` starts: `published` or `printed`, as `published`
    - `levels`: the values of the level quantity that a formula is fitted to and scored at, in place
      of the measured ones, as `nominal`
    - `sum`: formulas with signs and renamed inputs, which are fitted together, as `[{formula:
      sarosi}, {formula: viscous, sign: -1}]`
    - `as`: its name in the scores, as `one_term`
    """

    model: PathOrName | None = None
    run: SpecPath | None = None
    set: OtherSettings | None = None
    static: str | None = None
    damping: str | None = None
    method: FitMethod | None = None
    starts: str | None = None
    levels: Literal["nominal"] | None = None
    sum: Summands | None = None
    as_: Name | None = Field(default=None, alias="as")

    def _contradictions(self) -> Sequence[Row]:
        parts, frees = self.static or self.damping, self.method != "levenberg_marquardt"
        kinds = (self.model, self.run, self.set, self.sum, parts)
        has_name, first = self.as_ is not None, (self.sum or (None,))[0]
        refuse_mixed(self.sum or ())
        return [
            (
                sum(kind is not None for kind in kinds) != 1,
                (
                    "a competitor is one of: `model`, `run`, `set` (this spec with other "
                    "settings), `sum`, or `static` with `damping`"
                ),
                "give one of these, for example `{model: sarosi}`",
                *("model", "run", "set", "sum", "static"),
            ),
            (
                first is not None and (not has_name or first.formula is None),
                "a sum as a competitor consists of formulas, and needs a name",
                "add the name: `as: pair`",
                "sum",
            ),
            (
                self.set is not None and not has_name,
                "a competitor with other settings needs a name",
                "add it: `{set: {fit.max_terms: 1}, as: one_term}`",
                "set",
            ),
            (
                (self.static is None) != (self.damping is None),
                "a composite needs both `static` and `damping`",
                (
                    "add the other: `{static: sarosi, damping: reynolds}`; `damping: none` "
                    "adds nothing"
                ),
                "static",
                "damping",
            ),
            (
                (self.run is not None or self.set is not None) and self.method is not None,
                "another run is compared as it is, and not fitted here",
                "remove `method`",
                "method",
            ),
            (
                self.is_file and (not has_name or self.method is not None),
                "a frozen model is not fitted here, and needs a name for the table of scores",
                "write `{model: archive/NAME@TAG/model.h5, as: before}`",
                *("as", "method", "model"),
            ),
            (
                self.starts is not None and (self.model is None or frees),
                "`starts` needs a `model` and `method: levenberg_marquardt`",
                "write `{model: sarosi, method: levenberg_marquardt, starts: published}`",
                "starts",
            ),
            (
                self.levels is not None and (self.model is None or self.is_file),
                "`levels` needs the formula of a `model`",
                "write `{model: polynomial_5, levels: nominal, as: at_levels}`",
                "levels",
            ),
        ]

    @property
    def is_file(self) -> bool:
        """Whether it is a frozen model: a file, in place of the name of a formula."""
        return self.model is not None and self.model.endswith(".h5")

    @property
    def label(self) -> str:
        """The name of its scores."""
        composite = f"{self.static}+{self.damping}" if self.static else None
        return self.as_ or self.model or composite or PurePosixPath(str(self.run)).stem


class Validate(Section):
    """What the model is compared with, what errors are divided by, and the limits that its scores
    must keep.

    - `as`: the quantity that a model of the strain is scored as, by inverting it; so is a
      competitor with another target and this study's among its inputs, as `force`
    - `against`: competitors, fitted to the same data, as `[sarosi, {run: other.yaml}]`
    - `simple`: whether competitors that need no muscle stand beside: `plane`, `quadratic`, `cubic`
      in the model's inputs, the `backbone` alone, and `arx` in free run, as `false`
    - `normaliser`: what errors are divided by: the largest absolute value of the measured target
      (`max`, M2 eq 13) or its `range`, as `range`
    - `intervals`: whether the model is fitted again without each part of the training data, for
      `predict --interval`, as `true`
    - `require`: limits of metrics, which a run must keep (exit 6), as `{nrmse: 0.05, r2: 0.9}`; of
      several targets also one for each, as `rmse: {tip_x: 1 mm, tip_y: 2 mm}`
    """

    as_: Quantity | None = Field(default=None, alias="as")
    against: Annotated[list[Annotated[str | Competitor, Either()]], Field(max_length=100)] = []
    simple: bool = True
    normaliser: Literal["max", "range"] = "max"
    intervals: bool = False
    require: dict[str, Annotated[Metric | dict[Quantity, Metric], Either()]] = {}


class PublishedScores(Section):
    """Numbers of a publication to show beside ours, by model, all of held-out data. No computation
    uses them.

    - `source`: where they were printed, as `M2 table 5`
    - `nrmse`: NRMSE, as fractions, as `{sarosi: 0.021}`
    - `rmse`: RMSE, as `{sarosi: 12.5}`
    - `rmse_at_least`: lower bounds, where no more was printed, as `{sarosi: 10}`
    """

    source: str
    nrmse: dict[str, Share] = {}
    rmse: dict[str, OfTarget] = {}
    rmse_at_least: dict[str, OfTarget] = {}

    @property
    def numbers(self) -> Published:
        """The same as data."""
        return Published(self.source, self.nrmse, self.rmse, self.rmse_at_least)


class Style(Section):
    """How figures look.

    - `width`: width of a panel that stands by itself, as `85 mm`
    - `font`: font of all labels, as `Times New Roman`
    - `size` (pt): size of labels; titles and ticks are 1 pt less, as `9`
    - `labels`: axis labels by quantity, with their unit; formulas may stand between dollars, as
      `{strain: "Contraction (–)"}`
    - `palette`: colours of the models, that of the run's own first, as `["#0072B2", "#D55E00"]`
    """

    width: Metres = 0.0889
    font: str | None = None
    size: Annotated[float, Field(ge=5, le=24)] = 8.0
    labels: dict[Quantity, str] = {}
    palette: list[Annotated[str, Field(pattern=r"^#[0-9A-Fa-f]{6}$")]] = []


class Report(Section):
    """Figures and files of the report.

    - `figures`: the figures, in their order, as `[data, fit, error]`
    - `formats`: `html` is the page, with quick drawings of the figures; `csv` and `tex` are the
      tables; `svg` is a file for each figure, drawn as for print, also on the page; with `pdf`,
      `png` or `pgf` every panel is a file of its own in `panels/`, beside the numbers that
      it was drawn from, as `[html, pdf]`
    - `style`: how figures look, as `{width: 85 mm, size: 9}`
    - `published`: numbers of a publication to show beside, as `{source: M2 table 5, nrmse: {sarosi:
      0.021}}`
    - `units`: further units, by quantity, to print the equations in, as a publication does, as
      `{pressure: bar}`
    - `over`: `time` draws the fit of recordings over time whatever the model; by default models
      without memory are drawn over an input, as `time`
    - `explore`: whether the page computes the model in the browser; `false` leaves its scripts out,
      as `false`
    """

    figures: list[Literal[tuple(FIGURES)]] = list(FIGURES)  # type: ignore[valid-type]
    formats: list[Literal["html", "csv", "tex", "svg", "pdf", "png", "pgf"]] = ["html", "csv"]
    style: Style = Style()
    over: Literal["time"] | None = None
    explore: bool = True
    published: PublishedScores | None = None
    units: dict[Quantity, str] = {}


# The whole
# --------------------------------------------------------------------------------------------------


def _given_memory(dictionary: object, info: ValidationInfo) -> bool:
    """Return whether a dictionary that is not validated yet has terms with memory; False if its
    form is wrong, which is reported elsewhere.
    """
    try:
        return isinstance(dictionary, list) and remembers(
            [DictionaryEntry.model_validate(entry, context=info.context) for entry in dictionary]
        )
    except ValidationError:
        return False


def _pooled(given: Mapping[str, Any]) -> bool:
    """Return whether a spec that is not validated yet has one segment of all its curves."""
    data, segment = given.get("data"), given.get("segment") or {}
    levels = data.get("levels") if isinstance(data, dict) else None
    whole = isinstance(segment, dict) and all(cut == "none" for cut in segment.values())
    return whole and (levels is None or bool(segment))


def _sized_by_data(fit: dict[str, Any]) -> None:
    """Let the data choose the number of terms of a model without segments if the spec does not set
    it. A single term is enough for a segment, but for the whole data it would often be the
    constant.
    """
    if "max_terms" not in fit:
        fit["max_terms"] = TERMS_OF_ONE_MODEL
        if "tolerance" not in fit:
            fit.setdefault("stop", "bic")


class ExperimentSpec(Section):
    """One experiment: what was measured, how to cut it up, which terms may appear, how to join,
    what to compare with.

    - `schema_version`: version of this format, as `1`
    - `name`: name of the run and of its folder, as `my-muscle`
    - `muscle`: what was measured, as `{length: 88 mm, diameter: 20 mm}`
    - `units`: units of quantities in the model and on pages, as `{pressure: bar}`
    - `data`: the recordings, and how they become curves, as `{files: ["cycle_*.csv"], columns:
      {force: {column: F, unit: N}}}`
    - `needs`: specs of the runs that this one builds on, as `{static: static.yaml}`
    - `target`: what is modelled: `static`, `hysteresis`, `damping` or `dynamic` force, or a
      quantity, or several that share segments and terms, as `static`
    - `segment`: how each variable is cut into segments; `none` pools the curves of the levels, as
      `{strain: {method: even, count: 4}}`
    - `dictionary`: families of candidate terms, as `[{polynomial: {of: [strain], order: 4}}]`
    - `formulas`: formulas of your own, each a file or written out, to be named like those of the
      literature, as `[my_formula.yaml]`
    - `model`: which kind of model, and what the pieces stand on, as `{backbone: sarosi}`
    - `fit`: how terms are chosen, and how many, as `{max_terms: 2}`
    - `fuse`: how pieces are joined, and what happens beyond the data, as `{transition: linear, z_s:
      0.25}`
    - `validate`: competitors, metrics and limits, as `{against: [sarosi], require: {nrmse: 0.05}}`
    - `report`: figures and files of the report, as `{formats: [html, pdf]}`
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
        """The guesses of `init` that nobody has confirmed: the file's comments that begin with
        `CHECK`.
        """
        return self._unconfirmed

    @model_validator(mode="before")
    @classmethod
    def _by_choice(cls, given: object, info: ValidationInfo) -> object:
        """Fill in defaults that depend on the target, on the terms, and on the parts of a sum."""
        if not isinstance(given, dict):
            return given
        if "campaign" in given:
            raise Contradiction(
                "this is a campaign of several runs, not an experiment",
                "run it with `mapmore batch`",
                "campaign",
            )
        target, dictionary, model = (given.get(key) for key in ("target", "dictionary", "model"))
        adds, fit = target == "dynamic" and not dictionary, given.setdefault("fit", {})
        if isinstance(model, dict) and (adds or model.get("sum") is not None):
            model.setdefault("type", "sum")
        elif model is None and (adds or dictionary is None):
            given["model"] = {"type": "sum" if adds else "auto"}
        if isinstance(fit, dict) and _given_memory(dictionary, info):
            # numbers of steps and widths in physical units stay readable
            fit.setdefault("scaling", "none")
            _sized_by_data(fit)
        elif isinstance(fit, dict) and dictionary and _pooled(given):
            _sized_by_data(fit)
        elif isinstance(fit, dict) and target == "damping":
            # pure products, which no shifted origin leaves so
            fit.setdefault("scaling", "max_abs")
        return given

    @property
    def own_formulas(self) -> dict[str, OwnFormula]:
        """The formulas that the spec defines, by name; the loader has read their files."""
        return {
            formula.name: formula for formula in self.formulas if isinstance(formula, OwnFormula)
        }

    @property
    def target_quantity(self) -> str:
        """The measured quantity that is modelled, or whose component is."""
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
        """The study of each target alone; itself where there is one."""
        alone = [{"target": TargetColumn(column=name)} for name in self.targets if self.also]
        return tuple(self.model_copy(update=update) for update in alone) or (self,)

    @property
    def quantities(self) -> tuple[str, ...]:
        """All quantities of the study: those of its data, and `direction` if segments are cut by
        it.
        """
        cut = [name for name, how in self.segment.items() if isinstance(how, CutByDirection)]
        return tuple(dict.fromkeys((*self.data.quantities, *cut)))

    @property
    def has_memory(self) -> bool:
        """Whether the run's own model has terms with memory."""
        return self.model.type == "mapmore" and remembers(self.dictionary)

    @property
    def runs_over_time(self) -> bool:
        """Whether the run's own model runs along recordings."""
        return self.has_memory or self.model.over_time

    @model_validator(mode="after")
    def _structured(self, info: ValidationInfo) -> ExperimentSpec:
        """Require a structure where none is searched, and none if one is."""
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
                f"`{parts[0]}` belongs to the structure that `model: {{type: auto}}` searches",
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
                f"add a `dictionary`, as {example}",
                "dictionary",
                "model",
                "name",
            )
        return self
