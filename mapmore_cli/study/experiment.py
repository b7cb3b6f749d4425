"""Define the experiment spec as a pydantic model: its sections, and the rules between them.

Units: every number is in the unit of the model. The loader converts `250 kPa` into a number before
validation (see `study.fields`); the mark of the field names the unit.
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
    """The muscle that was measured. The results record it, and formulas with dimensions use it.

    - `name`: Name of the muscle on pages. Example: `DMSP-20-88N`
    - `kind`: Kind of muscle. Example: `mckibben`
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
    """A measured quantity as target. `target: tip` is short for `target: {column: tip}`, and
    `target: [tip_x, tip_y]` for `target: {column: tip_x, also: [tip_y]}`.

    - `column`: The quantity, which must be a key of `data.columns` or `data.derive`. Example: `tip`
    - `also`: Further quantities that are modelled with the same segments and terms. Example:
      `[tip_y]`
    """

    column: str
    also: Annotated[Sequence[Quantity], Len(1)] | None = None


# Results


OF_PATHS = ("needs.static", "needs.damping", "data.files")
"""Keys of a spec whose values are paths."""


def _with_paths(settings: Mapping[str, Any], change: Callable[[str], object]) -> dict[str, Any]:
    """Return settings of a spec with `change` applied to every value that is a path."""

    def changed(value: object) -> object:
        if isinstance(value, list):
            return [changed(entry) for entry in value]
        if isinstance(value, dict) and "path" in value:
            return {**value, "path": changed(value["path"])}
        return change(value) if isinstance(value, str) else value

    return {key: changed(value) if key in OF_PATHS else value for key, value in settings.items()}


def _read_settings(value: object, info: ValidationInfo) -> object:
    read = partial(read_path, info=info, bare=False)
    return _JSON.validate_python(_with_paths(value, read)) if isinstance(value, dict) else value


def _moved_settings(settings: Mapping[str, Any], info: SerializationInfo) -> dict[str, Any]:
    return _with_paths(settings, partial(moved_path, info=info, bare=False))


_JSON = TypeAdapter(JsonValue)

OtherSettings = Annotated[
    dict[str, Any], BeforeValidator(_read_settings), PlainSerializer(_moved_settings)
]
"""Keys of a spec, for example `fit.max_terms`, with other values. Numbers with units are converted
only in the spec that they change.
"""


class Competitor(Section):
    """A competitor with settings of its own. Give one of: a `model`, a `run`, this spec with other
    settings (`set`), a `sum`, or `static` with `damping`.

    - `model`: A formula of the literature, a black box (for example `gaussian_process`), or the
      path of a frozen model that ends in `.h5` (which also needs `as`). Example: `sarosi`
    - `run`: Path of a spec whose model is compared. Example: `other.yaml`
    - `set`: Keys of this spec with other values. They make a further run with the name
      `<name>.<as>`. Example: `{fit.max_terms: 1}`
    - `static`: A static formula to which `damping` is added, or `mapmore` for the static model in
      `needs`. Example: `sarosi`
    - `damping`: A formula for the damping force, or `none`. Example: `reynolds`
    - `method`: How a formula is fitted; by variable projection if nothing else is given. Example:
      `simplex`
    - `starts`: Starting values of `levenberg_marquardt`: those of the `published` formula, or as
      `printed` in the paper about the wrist joint, whose units differ. Example: `published`
    - `levels`: Values of the level quantity that a formula is fitted to and scored with, instead of
      the measured ones. Example: `nominal`
    - `sum`: Formulas that are fitted together, with signs and renamed inputs. Example: `[{formula:
      sarosi}, {formula: viscous, sign: -1}]`
    - `as`: Name of the competitor in the scores. Example: `one_term`
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
        """Return True if the competitor is a frozen model in a file."""
        return self.model is not None and self.model.endswith(".h5")

    @property
    def label(self) -> str:
        """Name of the competitor in the scores."""
        composite = f"{self.static}+{self.damping}" if self.static else None
        return self.as_ or self.model or composite or PurePosixPath(str(self.run)).stem


class Validate(Section):
    """Competitors of the model, the normaliser of errors, and limits that the scores must keep.

    - `as`: Quantity to score instead of the strain: the model of the strain is inverted for it. A
      competitor whose target is another quantity, and which has this study's target among its
      inputs, is inverted too. Example: `force`
    - `against`: Competitors, which are fitted to the same data. Example: `[sarosi, {run:
      other.yaml}]`
    - `simple`: If true, also compare with simple models that need no knowledge of muscles: `plane`,
      `quadratic` and `cubic` in the model's inputs, the `backbone` alone, and `arx` in free run.
      Example: `false`
    - `normaliser`: What errors are divided by: `max` is the largest absolute value of the measured
      target (Veale et al. 2018, equation 13), `range` is the difference between its largest and
      smallest value. Example: `range`
    - `intervals`: If true, fit the model again without each part of the training data. `predict
      --interval` needs these fits. Example: `true`
    - `require`: Limits of metrics. If the run misses one, it ends with exit code 6. With several
      targets, a metric can have one limit for each: `rmse: {tip_x: 1 mm, tip_y: 2 mm}`. Example:
      `{nrmse: 0.05, r2: 0.9}`
    """

    as_: Quantity | None = Field(default=None, alias="as")
    against: Annotated[list[Annotated[str | Competitor, Either()]], Field(max_length=100)] = []
    simple: bool = True
    normaliser: Literal["max", "range"] = "max"
    intervals: bool = False
    require: dict[str, Annotated[Metric | dict[Quantity, Metric], Either()]] = {}


class PublishedScores(Section):
    """Printed numbers of a publication that are shown beside the scores, by model, all for held-out
    data. They are never used in a computation.

    - `source`: Where the numbers were printed. Example: `M2 table 5`
    - `nrmse`: NRMSE of each model, as fractions. Example: `{sarosi: 0.021}`
    - `rmse`: RMSE of each model. Example: `{sarosi: 12.5}`
    - `rmse_at_least`: Lower bound of the RMSE, for models of which the publication prints no more
      than that. Example: `{sarosi: 10}`
    """

    source: str
    nrmse: dict[str, Share] = {}
    rmse: dict[str, OfTarget] = {}
    rmse_at_least: dict[str, OfTarget] = {}

    @property
    def numbers(self) -> Published:
        """The numbers as a `Published`, the type that the score tables use."""
        return Published(self.source, self.nrmse, self.rmse, self.rmse_at_least)


class Style(Section):
    """Appearance of the figures.

    - `width`: Width of a single panel. Example: `85 mm`
    - `font`: Font of all labels. Example: `Times New Roman`
    - `size` (pt): Font size of the labels; titles and ticks are 1 pt smaller. Example: `9`
    - `labels`: Axis labels by quantity. The unit is part of the label, and formulas may stand
      between dollar signs. Example: `{strain: "Contraction (–)"}`
    - `palette`: Colours of the models; the first is the colour of the run's own model. Example:
      `["#0072B2", "#D55E00"]`
    """

    width: Metres = 0.0889
    font: str | None = None
    size: Annotated[float, Field(ge=5, le=24)] = 8.0
    labels: dict[Quantity, str] = {}
    palette: list[Annotated[str, Field(pattern=r"^#[0-9A-Fa-f]{6}$")]] = []


class Report(Section):
    """Figures and files of the report.

    - `figures`: The figures, in their order on the page. Example: `[data, fit, error]`
    - `formats`: Files to write. `html` is the page with quick drawings of the figures. `csv` and
      `tex` are the tables. `svg` writes a file for each figure, drawn as for print, and shows it on
      the page. `pdf`, `png` and `pgf` write every panel to a file in `panels/`, together with the
      numbers from which it was drawn. Example: `[html, pdf]`
    - `style`: Appearance of the figures. Example: `{width: 85 mm, size: 9}`
    - `published`: Printed numbers of a publication to show beside the scores. Example: `{source: M2
      table 5, nrmse: {sarosi: 0.021}}`
    - `units`: Further units in which the equations are printed, by quantity, for example those of a
      publication. Example: `{pressure: bar}`
    - `over`: Axis of the figure of the fit. With `time`, recordings are drawn over time for every
      model. By default, only models with memory are drawn over time, and all others over an input.
      Example: `time`
    - `explore`: If false, the page does not compute the model in the browser, and is smaller
      because the scripts are left out. Example: `false`
    """

    figures: list[Literal[tuple(FIGURES)]] = list(FIGURES)  # type: ignore[valid-type]
    formats: list[Literal["html", "csv", "tex", "svg", "pdf", "png", "pgf"]] = ["html", "csv"]
    style: Style = Style()
    over: Literal["time"] | None = None
    explore: bool = True
    published: PublishedScores | None = None
    units: dict[Quantity, str] = {}


# The whole spec


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
    """Let the data choose the number of terms if the model has no segments and the spec does not
    set the number. One term is enough for a segment, but for all data it would often be the
    constant.
    """
    if "max_terms" not in fit:
        fit["max_terms"] = TERMS_OF_ONE_MODEL
        if "tolerance" not in fit:
            fit.setdefault("stop", "bic")


class ExperimentSpec(Section):
    """An experiment: what was measured, how the curves are cut, which terms may be chosen, how the
    pieces are joined, and what the model is compared with.

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
    - `dictionary`: Families of candidate terms, from which the fit chooses. Example: `[{polynomial:
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
        if isinstance(fit, dict) and _given_memory(dictionary, info):
            # states are not scaled, so that numbers of samples and widths stay in physical units
            fit.setdefault("scaling", "none")
            _sized_by_data(fit)
        elif isinstance(fit, dict) and dictionary and _pooled(value):
            _sized_by_data(fit)
        elif isinstance(fit, dict) and target == "damping":
            # products of powers remain products only if the origin is not shifted
            fit.setdefault("scaling", "max_abs")
        return value

    @property
    def own_formulas(self) -> dict[str, OwnFormula]:
        """Formulas that the spec defines, by name. The loader has read their files."""
        return {
            formula.name: formula for formula in self.formulas if isinstance(formula, OwnFormula)
        }

    @property
    def target_quantity(self) -> str:
        """Measured quantity that is modelled, or of which a part is modelled."""
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
        """The study of each single target; with one target, the study itself."""
        alone = [{"target": TargetColumn(column=name)} for name in self.targets if self.also]
        return tuple(self.model_copy(update=update) for update in alone) or (self,)

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of all quantities of the study: the quantities of its data, and `direction` if
        segments are separated by it.
        """
        cut = [name for name, how in self.segment.items() if isinstance(how, CutByDirection)]
        return tuple(dict.fromkeys((*self.data.quantities, *cut)))

    @property
    def has_memory(self) -> bool:
        """Return True if the run's own model has terms with memory."""
        return self.model.type == "mapmore" and remembers(self.dictionary)

    @property
    def runs_over_time(self) -> bool:
        """Return True if the run's own model runs along recordings."""
        return self.has_memory or self.model.over_time

    @model_validator(mode="after")
    def _structured(self, info: ValidationInfo) -> ExperimentSpec:
        """Require a dictionary or a formula, unless the structure is found by a search; in that
        case, refuse both.
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
