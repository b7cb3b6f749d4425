"""The sections that say how a model is made: `needs`, `segment`, `model`, `fit` and `fuse`."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from mapmore_cli.domain.words import Between, Hold, Transition
from mapmore_cli.spec.fields import (
    Keyed,
    Number,
    OfHeld,
    OfKey,
    Quantity,
    Section,
    SpecPath,
    Text,
    WithUnit,
    by_shape,
    by_word,
    contradiction,
    of_sibling,
)
from mapmore_cli.spec.sections.state_space import StateSpaceKeys

USUAL_GRID = 20
"""Cells of the grid of `optimal` where nothing is said."""
LEAST_RIDGE = 1e-9
"""Below which rounding decides."""


AUTO = "auto"
"""What left-out training data choose: a backbone, or a number of terms."""

USUAL_TERMS = 3
"""Terms at most where their number is not chosen yet: cuts that fits decide, and a backbone, are chosen with so many."""


class Cuts(Section):
    """How one variable is cut into segments.

    - `even` needs `count`; `breakpoints` needs the inner boundaries, `at`. Neighbours are joined until each segment holds `min_samples`, so
      that curves of few samples have fewer segments. Where several variables are cut, as of a table of scattered points, cells are joined;
      cells that belong together have one function.
    - `gradient` puts `count - 1` boundaries where the slope of the target changes most, seen through a `window` (a tenth of each curve's
      range) and `separation` apart (the window).
    - `optimal` puts them where the fits of the segments leave the least, on a `grid` of equal cells (20) with `min_samples` in each segment
      (10).
    """

    method: Literal["even", "breakpoints", "gradient", "optimal"]
    count: Annotated[int, Field(ge=1, le=1000)] | None = None
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
        useful = {"gradient": {"window", "separation"}, "optimal": {"grid", "min_samples"}}.get(self.method, {"min_samples"}) | {
            "method",
            needed,
        }
        for other in type(self).model_fields:
            if other not in useful and getattr(self, other) is not None:
                raise contradiction(f"method `{self.method}` has no use for `{other}`", f"remove `{other}`", other)
        if self.at is not None and any(after <= before for before, after in pairwise(self.at)):
            raise contradiction("the breakpoints do not increase", f"write `at: {sorted(set(self.at))}`", "at")
        if self.method == "optimal" and self.count is not None and self.count > (self.grid or USUAL_GRID):
            raise contradiction(
                f"{self.count} segments do not fit on a grid of {self.grid or USUAL_GRID} cells", "raise `grid`, or lower `count`", "grid"
            )
        return self


class CutByDirection(Section):
    """Segments for rise and fall: by the sign of the rate `of` a quantity, with a `dead_band` in which the last direction holds."""

    of: str
    dead_band: Annotated[float, Field(gt=0), of_sibling("of")]


class Needs(Section):
    """Specs of the runs that this one builds on: the `static` model is subtracted to obtain the damping force; `damping` is added to it."""

    static: SpecPath | None = None
    damping: SpecPath | None = None


class Summand(Section):
    """A part of a sum: the model of another run (the path of its spec), or a `formula`; `sign` is 1 or -1.

    `inputs` says what the part's inputs are called in this study, as expressions: `{pressure: p1, strain: "-s"}`. An input that two parts
    share by name must be renamed for both.
    """

    model: SpecPath | None = None
    formula: str | None = None
    sign: Literal[1, -1] = 1
    inputs: dict[Quantity, str] = {}  # noqa: RUF012 (pydantic copies it)

    @model_validator(mode="after")
    def _one(self) -> Summand:
        if (self.model is None) == (self.formula is None):
            raise contradiction("a part of a sum is a `model` or a `formula`", "give one, as `{model: flexor.yaml}`", "model", "formula")
        return self


def one_kind(summands: list[Summand]) -> list[Summand]:
    """The parts, refused where some are fitted by runs of their own and others here."""
    if len({summand.formula is None for summand in summands}) > 1:
        raise contradiction("a sum is of models or of formulas", "make a run of each formula, and name its spec as `model`")
    return summands


Summands = Annotated[list[Summand], Field(min_length=2), AfterValidator(one_kind)]
"""At least two parts; formulas are fitted together."""


class ModelChoice(StateSpaceKeys):
    """What kind of model the run builds.

    - `mapmore`: with a `backbone`, the pieces explain what that formula leaves. `backbone: auto` takes the static formula, or none, whose
      fused model errs least on left-out inner levels of the training data (with three levels or fewer: `sarosi_hinged`), or on left-out
      inner blocks where all samples are one surface.
    - `literature` fits the formula `name` alone, by the `method`, from the `starts` and with the `errors_in` that a competitor may have.
    - `sum` adds the static and the damping model that the spec needs; it is the default for the target `dynamic`. With `sum: [...]` it adds
      these parts, with signs and renamed inputs.

    `state_space` is P's model of motion: linear sections of second order along an `input`. `sections` are the boundaries between them, or
    how many with equal shares of the samples; `direction` gives rise and fall sections of their own. With `switching: hard` every section
    runs on the whole input and the active one's output is taken; with `carried` the state passes from section to section; with `bumpless`
    they also meet at their boundaries, and the direction changes once the input has turned back by more than `dead_band`. A run begins at
    `start`: at `rest` under its first input, or at `zero`. `mask` says whose direction tells training samples of rise and fall apart.
    Sections may have an `offset`, and may depend on a `load`. `solver` is `least_squares`, `differential_evolution`, the `swarm` as
    published (`particles`, `iterations`, `seed`, within `bounds`, its particles beginning within `begin`) or the same over frequency and
    damping, `swarm_projected`; `polish` goes on by least squares. `slowest` is the longest time constant (a quarter of the longest piece of
    a training record).
    """

    type: Literal["mapmore", "literature", "sum", "state_space"] = "mapmore"
    backbone: str | None = None
    name: str | None = None
    method: Literal["variable_projection", "levenberg_marquardt", "simplex"] | None = None
    starts: str | None = None
    errors_in: str | None = None
    sum: Summands | None = None

    @model_validator(mode="before")
    @classmethod
    def _type_of_sum(cls, given: Any) -> Any:
        """A list of parts makes it a sum."""
        return {"type": "sum", **given} if isinstance(given, dict) and given.get("sum") is not None else given

    @model_validator(mode="after")
    def _state_space(self) -> ModelChoice:
        if self.type != "state_space" and self.foreign is not None:
            raise contradiction(f"type `{self.type}` has no `{self.foreign}`", "remove it, or use `type: state_space`", self.foreign)
        if self.type == "state_space" and self.input is None:
            raise contradiction("type `state_space` needs the `input`", "add it, as `input: pressure`", "type")
        if self.type == "state_space" and self.backbone is not None:
            raise contradiction("type `state_space` has no `backbone`", "remove it", "backbone")
        return self

    @model_validator(mode="after")
    def _fits_type(self) -> ModelChoice:
        if self.type == "literature" and self.name is None:
            raise contradiction("type `literature` needs the `name` of a formula", "add it, as `name: sarosi`", "type")
        if self.type == "literature" and self.backbone is not None:
            raise contradiction("type `literature` has no `backbone`", "remove it, or use `type: mapmore`", "backbone")
        if self.type != "literature" and self.name is not None:
            raise contradiction(f"type `{self.type}` has no `name`", "use `backbone`, or `type: literature`", "name")
        if self.type != "literature" and (self.method or self.starts or self.errors_in):
            found = f"type `{self.type}` has no `method`, no `starts` and no `errors_in`"
            raise contradiction(found, "use `type: literature`", "method", "starts", "errors_in")
        if self.type != "sum" and self.sum is not None:
            raise contradiction(f"type `{self.type}` adds nothing up", "remove `type`, or `sum`", "sum")
        if self.type == "sum" and self.backbone is not None:
            raise contradiction("type `sum` has no `backbone`", "remove it: both models have their own", "backbone")
        return self


class Fit(Section):
    """Term selection (M2 eq 2-7): how inputs are scaled, how many terms at most, and when to stop.

    Default of `scaling`: `none` with memory, `max_abs` for damping, otherwise `unit_square`. `train_level` restricts
    the pieces to one training level, as M2 does (`highest`); formulas are fitted to all of them.

    `max_terms: auto` tries several numbers of terms on training data that are left out in turn, as `mapmore tune` does, and takes the least
    number whose error is within one standard error of the best.

    With memory: `scaling: range` brings every state to [0, 1] on the training samples and clips it `margin` beyond; a `ridge`, as a
    fraction of a candidate's variance, or `auto`, selects `forward` terms (three times `max_terms`) and prunes them.

    With delays of the output among the terms, a model may be judged in free run, as it is scored. `criterion: free_run` refines the
    coefficients of the chosen terms by least squares on the simulation error. `stop: free_run` fits models of every size to the first three
    quarters of each recording's training samples, keeps the terms of the one that runs best over the last quarter, and fits them to all.
    `select: free_run` also tries the best few candidates of every step in free run, and carries the best three models of each size on.
    """

    scaling: Literal["unit_square", "max_abs", "none", "range"] = "unit_square"
    margin: Annotated[float, Field(ge=0), WithUnit(lambda _: "1")] = 0.15
    train_level: Annotated[Annotated[Literal["all", "highest"], Text] | Annotated[OfHeld, Number], by_shape] = "all"
    max_terms: Annotated[Annotated[Literal["auto"], Text] | Annotated[Annotated[int, Field(ge=1)], Number], by_word(AUTO)] = 1
    tolerance: Annotated[float, Field(ge=0, lt=1)] = 1e-4
    stop: Literal["tolerance", "bic", "aicc", "press", "free_run"] = "tolerance"
    criterion: Literal["one_step", "free_run"] = "one_step"
    select: Literal["one_step", "free_run"] = "one_step"
    ridge: Annotated[Annotated[Literal["auto"], Text] | Annotated[Annotated[float, Field(ge=0)], Number], by_shape] = 0.0
    forward: Annotated[int, Field(ge=1)] | None = None

    @property
    def most_terms(self) -> int:
        """`max_terms`, or the usual number where left-out data have not chosen one yet."""
        return USUAL_TERMS if self.max_terms == AUTO else int(self.max_terms)

    @model_validator(mode="after")
    def _one_chooser(self) -> Fit:
        if self.max_terms == AUTO and self.stop == "free_run":
            remedy = "give `max_terms` a number, or take another `stop`"
            raise contradiction("`max_terms: auto` and `stop: free_run` both choose the number of terms", remedy, "max_terms", "stop")
        return self

    @model_validator(mode="after")
    def _some_ridge(self) -> Fit:
        if isinstance(self.ridge, float) and 0 < self.ridge < LEAST_RIDGE:
            raise contradiction(f"a ridge of {self.ridge:g} is lost in rounding", f"write {LEAST_RIDGE:g} or more, 0 or `auto`", "ridge")
        return self


ExtrapolationWord = Literal["continue", "continue_linear", "saturate", "zero"]
"""What happens beyond a limit (M2 eq 12)."""
WordOrValue = Annotated[Annotated[ExtrapolationWord, Text] | Annotated[OfKey, Number], by_shape]


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
    training levels, 1 carries all of it, 0 leaves the backbone alone there; where all samples are one surface, it is the share that counts
    everywhere, and `auto` asks left-out blocks. `extrapolation` is a word for all variables, or a mapping from variable to word or
    `{below, above}`; without it, `continue` for one-term fits, else `saturate`. It begins at each curve's own ends
    (`limits: curve`), or at those of the whole training domain (`domain`: M2 eq 12 as printed). `hold: samples` holds a segment function
    where a transition zone reaches beyond its samples by more than `z_s` of their width; `none` is M2 eq 9-11 to the letter.
    """

    transition: Transition = "linear"
    z_s: Annotated[float, Field(ge=0, le=0.5)] = 0.25
    levels: Between = "linear"
    align: Literal["none", "threshold"] = "none"
    hold: Hold = "samples"
    limits: Literal["curve", "domain"] = "curve"
    shrink: Annotated[Annotated[Literal["auto"], Text] | Annotated[Annotated[float, Field(ge=0, le=1)], Number], by_shape] = "auto"
    extrapolation: Annotated[Annotated[ExtrapolationWord, Text] | Annotated[dict[str, Sides], Keyed], by_shape] | None = None
