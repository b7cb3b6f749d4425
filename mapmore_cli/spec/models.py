"""The experiment spec as pydantic models: what a YAML file may say, with the defaults.

Units: every number here is already in the model's unit. The loader turns `250 kPa` into a number before validation, with the unit of
the quantity that the key belongs to (see `spec.units`).
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
Positive = Annotated[float, Field(gt=0)]
ExtrapolationWord = Literal["continue", "continue_linear", "saturate", "zero"]


class Section(BaseModel):
    """Base of every part of the spec: strict, closed and immutable."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, populate_by_name=True)


class Muscle(Section):
    """What was measured; recorded in the results, and used by formulas that need dimensions."""

    name: str | None = None
    kind: str | None = None
    length: Positive | None = None  # m
    diameter: Positive | None = None  # m


class FileEntry(Section):
    """A glob with quantities that no column holds."""

    path: str
    set: dict[str, float] = {}
    id: str | None = None


class Column(Section):
    """Where a quantity comes from: `value * scale + offset`, in `unit`."""

    column: str | int
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0  # in `unit`


class Rate(Section):
    """Time derivative by a Savitzky-Golay filter over `window` seconds."""

    rate_of: str
    window: Positive  # s
    order: Annotated[int, Field(ge=1, le=5)] = 3


class Keep(Section):
    """Samples to keep; exactly one condition."""

    quantity: str
    abs_below: Positive | None = None
    below: float | None = None
    above: float | None = None
    between: tuple[float, float] | None = None


class Cycles(Section):
    """Split load cycles into branches over one quantity and resample both on common values."""

    over: str
    samples: Annotated[int, Field(ge=2)] = 200


class Levels(Section):
    """The quantity held constant within one curve."""

    of: str
    at: list[float] | Literal["auto"] = "auto"
    within: Positive | None = None  # default: half the smallest distance between levels


class Between(Section):
    """Closed intervals of a quantity."""

    between: list[tuple[float, float]]


class Holdout(Section):
    """Which samples validate. `files` and `recordings` are globs; other keys of the YAML mapping are quantities."""

    files: list[str] | None = None
    recordings: list[str] | None = None
    last: Annotated[float, Field(gt=0, lt=1)] | None = None
    fraction: Annotated[float, Field(gt=0, lt=1)] | None = None
    seed: int | None = None
    quantities: dict[str, list[float] | Between] = {}


class Split(Section):
    """How training and validation data are separated; everything trains where nothing is said."""

    hold_out: Holdout | None = Field(default=None, alias="validate")
    leave_one_level_out: bool = False


class Data(Section):
    """The recordings, and how they become curves."""

    files: list[str | FileEntry]
    reader: Literal["csv"] = "csv"
    header: bool = True
    columns: dict[str, Column]
    derive: dict[str, str | Rate] = {}
    keep: list[Keep] = []
    missing: Literal["error", "drop"] = "error"
    repeated_time: Literal["error", "average", "spread"] = "error"
    cycles: Cycles | None = None
    levels: Levels | None = None
    split: Split = Split()


class TargetColumn(Section):
    """A canonical quantity as target."""

    column: str


class Cuts(Section):
    """How one variable is cut: `even` needs `count`, `breakpoints` needs `at`."""

    method: Literal["even", "breakpoints"]
    count: Annotated[int, Field(ge=1)] | None = None
    at: list[float] | None = None


class Polynomial(Section):
    """Every monomial of total degree up to `order`."""

    of: list[str]
    order: Annotated[int, Field(ge=1, le=20)]
    constant: bool = True


class DictionaryEntry(Section):
    """One family of candidate terms; exactly one key."""

    polynomial: Polynomial | None = None
    terms: list[str] | None = None


class ModelChoice(Section):
    """What kind of model the run builds."""

    type: Literal["mapmore", "literature"] = "mapmore"
    backbone: str | None = None  # mapmore: a formula whose residual the pieces explain
    name: str | None = None  # literature: the formula


class Fit(Section):
    """Term selection (M2 eq 2-7)."""

    scaling: Literal["unit_square", "max_abs", "none"] = "unit_square"
    max_terms: Annotated[int, Field(ge=1)] = 1
    tolerance: Annotated[float, Field(ge=0, lt=1)] = 1e-4
    stop: Literal["tolerance", "bic", "aicc", "press"] = "tolerance"


class BelowAbove(Section):
    """Extrapolation of one variable on each side: a word, or the value that the variable takes (M2 eq 12)."""

    below: ExtrapolationWord | float | None = None
    above: ExtrapolationWord | float | None = None


class Fuse(Section):
    """How pieces are joined (M2 eq 9-12). `extrapolation` None means: `continue` for one-term fits, else `saturate`."""

    transition: Literal["linear", "quadratic", "cubic"] = "linear"
    z_s: Annotated[float, Field(ge=0, le=0.5)] = 0.25
    extrapolation: ExtrapolationWord | dict[str, ExtrapolationWord | BelowAbove] | None = None


class Competitor(Section):
    """A literature model with settings of its own."""

    model: str
    method: Literal["variable_projection", "levenberg_marquardt"] | None = None
    as_: str | None = Field(default=None, alias="as")


class Validate(Section):
    """What the model is compared with, and the limits it must keep."""

    against: list[str | Competitor] = []
    require: dict[str, float] = {}


class Published(Section):
    """Numbers of a publication to show beside ours; never used in a computation."""

    source: str
    nrmse: dict[str, float] = {}  # by model, as fractions
    rmse: dict[str, float] = {}  # by model, in the target's unit


class Report(Section):
    """Figures and files of the report."""

    figures: list[Literal["data", "fit", "error", "nrmse", "segments", "terms"]] = ["data", "fit", "error", "nrmse", "segments", "terms"]
    formats: list[Literal["html", "csv", "svg"]] = ["html", "csv", "svg"]
    published: Published | None = None


class ExperimentSpec(Section):
    """One experiment: what was measured, how to cut it up, which terms may appear, how to join, what to compare with."""

    schema_version: Literal[1] = 1
    name: Name
    muscle: Muscle = Muscle()
    units: dict[str, str] = {}
    data: Data
    target: Literal["static", "hysteresis"] | TargetColumn
    segment: dict[str, Cuts | Literal["none", "levels"]] = {}
    dictionary: list[DictionaryEntry] = []
    model: ModelChoice = ModelChoice()
    fit: Fit = Fit()
    fuse: Fuse = Fuse()
    validation: Validate = Field(default=Validate(), alias="validate")
    report: Report = Report()

    @model_validator(mode="after")
    def _needs_terms(self) -> ExperimentSpec:
        if self.model.type == "mapmore" and not self.dictionary:
            raise ValueError("a `dictionary` of candidate terms is needed, or `model: {type: literature, name: ...}`")
        return self
