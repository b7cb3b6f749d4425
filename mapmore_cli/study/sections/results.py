"""Define the sections about results: competitors, validation and published scores."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

from pydantic import (
    BeforeValidator,
    Field,
    JsonValue,
    PlainSerializer,
    SerializationInfo,
    TypeAdapter,
    ValidationInfo,
)

from mapmore_cli.domain.declared import Either, Name, OfTarget
from mapmore_cli.domain.scores import Published
from mapmore_cli.modelling.validation.metrics import NORMALISERS
from mapmore_cli.study.fields import (
    Metric,
    PathOrName,
    Quantity,
    Row,
    Section,
    Share,
    SpecPath,
    moved_path,
    read_path,
)
from mapmore_cli.study.sections.model import FitMethod, Summands, refuse_mixed

OF_PATHS = ("needs.static", "needs.damping", "data.files")
"""Keys of a spec whose values are paths."""


def _with_paths(settings: Mapping[str, Any], change: Callable[[str], object]) -> dict[str, Any]:
    """Return settings of a spec in which each path `p` is replaced by `change(p)`."""

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
    """A competitor with settings of its own. Give exactly one of the keys `model`, `run`, `set` and
    `sum`, or give `static` together with `damping`.

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
    - `starts`: Starting values of `levenberg_marquardt`: those of the `published` formula, or those
      `printed` in the paper about the wrist joint, which uses other units. Example: `published`
    - `levels`: With `nominal`, a formula is fitted and scored with the nominal values of the level
      quantity instead of the measured ones. Example: `nominal`
    - `sum`: Formulas that are fitted together, with signs and renamed inputs. Example: `[{formula:
      sarosi}, {formula: linear_viscous, sign: -1}]`
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

    - `as`: For a model of the strain: the quantity that is scored in its place, for example the
      force. For each sample, the model is solved for this quantity. A competitor is solved in the
      same way if its target is another quantity and this study's target is one of its inputs.
      Example: `force`
    - `against`: Competitors, which are fitted to the same data. If the structure is searched and
      this key is missing, a formula and black boxes of the search are competitors; with an empty
      list, they are not. Example: `[sarosi, {run: other.yaml}]`
    - `simple`: If true, also compare with simple models that need no knowledge of muscles: `plane`,
      `quadratic` and `cubic` in the model's inputs, the `backbone` alone, and, if the model runs
      over time, `arx` in free run. Example: `false`
    - `normaliser`: What errors are divided by: `max` is the largest absolute value of the measured
      target (Veale et al. 2018, equation 13), `range` is the difference between its largest and
      smallest value. Both are taken from the held-out data or, if nothing is held out, from the
      training data. Example: `range`
    - `intervals`: If true, fit the model again without each part of the training data. `predict
      --interval` needs these fits. Example: `true`
    - `require`: Limits of metrics. If the run misses one, it ends with exit code 6. With several
      targets, a metric can have one limit for each: `rmse: {tip_x: 1 mm, tip_y: 2 mm}`. Example:
      `{nrmse: 0.05, r2: 0.9}`
    """

    as_: Quantity | None = Field(default=None, alias="as")
    against: Annotated[list[Annotated[str | Competitor, Either()]], Field(max_length=100)] = []
    simple: bool = True
    normaliser: Literal[tuple(NORMALISERS)] = "max"  # type: ignore[valid-type]
    intervals: bool = False
    require: dict[str, Annotated[Metric | dict[Quantity, Metric], Either()]] = {}


class PublishedScores(Section):
    """Errors on held-out data that a publication prints, by model. The report shows these numbers
    beside the scores, and never computes with them.

    - `source`: Where the numbers were printed. Example: `M2 table 5`
    - `nrmse`: NRMSE of each model, as fractions. Example: `{sarosi: 0.021}`
    - `rmse`: RMSE of each model. Example: `{sarosi: 12.5}`
    - `rmse_at_least`: Lower bound of the RMSE, for each model for which the publication prints only
      a bound. Example: `{sarosi: 10}`
    """

    source: str
    nrmse: dict[str, Share] = {}
    rmse: dict[str, OfTarget] = {}
    rmse_at_least: dict[str, OfTarget] = {}

    @property
    def numbers(self) -> Published:
        """The numbers as a `Published`, the type that the score tables use."""
        return Published(self.source, self.nrmse, self.rmse, self.rmse_at_least)
