"""The sections about what comes out: `validate` and `report`."""

# ruff: noqa: RUF012 (pydantic copies the default of a field for every instance)

from __future__ import annotations

from collections.abc import Iterator
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from mapmore_cli.domain.declared import Contradiction, Either
from mapmore_cli.domain.scores import FIGURES, Published
from mapmore_cli.spec.fields import Metres, Metric, Name, OfTarget, Quantity, RelativePath, Section, SettingsOfSpec, Share, SpecPath
from mapmore_cli.spec.sections.model import Summands, refuse_mixed


class Competitor(Section):
    """A competitor with settings of its own: a literature `model`, or that of another `run` (the path of its spec) or of this one, changed.

    - `model` may be a frozen one (a path that ends in `.h5`), with `as`, or a black box: `gaussian_process`, `gradient_boosting`, `mlp`.
    - `set` has keys of this spec with other values. The run is called `<name>.<as>`.
    - `static` and `damping` name two formulas that are added up. `static: mapmore` is the static model that the spec needs.
    - `sum` adds formulas with signs and renamed inputs, and fits them together.
    - `method` says how a formula is fitted; `starts` where `levenberg_marquardt` starts (`published`, `printed`).
    - `errors_in` names an input whose error is minimised in place of the target's, as the strain under a weight.
    - `as` is the name in the scores.
    """

    model: Annotated[str, RelativePath(bare=True)] | None = None
    run: SpecPath | None = None
    set: Annotated[dict[str, Any], SettingsOfSpec()] | None = None
    static: str | None = None
    damping: str | None = None
    method: Literal["variable_projection", "levenberg_marquardt", "simplex"] | None = None
    starts: str | None = None
    errors_in: str | None = None
    sum: Summands | None = None
    as_: Name | None = Field(default=None, alias="as")

    def _contradictions(self) -> Iterator[ValueError]:
        kinds = (self.model, self.run, self.set, self.sum, self.static if self.static is not None else self.damping)
        if len([kind for kind in kinds if kind is not None]) != 1:
            remedy = "give one of the five, as `{model: sarosi}`"
            found = "a competitor is a `model`, a `run`, this spec with keys `set`, a `sum`, or `static` with `damping`"
            yield Contradiction(found, remedy, "model", "run", "set", "sum", "static")
        refuse_mixed(self.sum or ())
        if self.sum is not None and (self.as_ is None or self.sum[0].formula is None):
            yield Contradiction("a sum as competitor is of formulas, and has a name", "add it, as `as: pair`", "sum")
        if self.set is not None and self.as_ is None:
            yield Contradiction("changed settings need a name", "add it, as `{set: {fit.max_terms: 1}, as: one_term}`", "set")
        if (self.static is None) != (self.damping is None):
            remedy = "add the other, as `{static: sarosi, damping: reynolds}`; `damping: none` adds nothing"
            yield Contradiction("a composite needs `static` and `damping`", remedy, "static", "damping")
        if (self.run is not None or self.set is not None) and self.method is not None:
            yield Contradiction("another run has a fit of its own", "remove `method`", "method")
        if self.is_file and (self.as_ is None or self.method is not None):
            remedy = "write `{model: archive/NAME@TAG/model.h5, as: before}`"
            yield Contradiction("a frozen model needs a name for its scores, and is not fitted", remedy, "as", "method", "model")
        if self.starts is not None and (self.model is None or self.method != "levenberg_marquardt"):
            remedy = "write `{model: sarosi, method: levenberg_marquardt, starts: published}`"
            yield Contradiction("`starts` goes with a `model` and `method: levenberg_marquardt`", remedy, "starts")
        if self.errors_in is not None and (self.model is None or self.is_file):
            yield Contradiction("`errors_in` goes with a formula as `model`", "write `{model: sarosi, errors_in: strain}`", "errors_in")

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
    """What the model is compared with, what errors are divided by, and the limits that its scores must keep.

    - `normaliser: max` is the largest absolute value of the measured target (M2 eq 13), `range` its extent.
    - `intervals: true` fits the model anew without each part of the training data, for `predict --interval`.
    - `simple` adds competitors that need no muscle: `plane`, `quadratic`, `cubic` in the model's inputs, the `backbone` alone, and `arx` in
      free run.
    - `as: force` scores a model of the strain as one of the force, by inverting it. A competitor with another target, and this study's
      among its inputs, is inverted too.
    """

    as_: Quantity | None = Field(default=None, alias="as")
    against: list[Annotated[str | Competitor, Either()]] = []
    simple: bool = True
    normaliser: Literal["max", "range"] = "max"
    intervals: bool = False
    require: dict[str, Metric] = {}


if TYPE_CHECKING:
    FigureName = str
else:
    FigureName = Literal[tuple(FIGURES)]


class PublishedScores(Section):
    """Numbers of a publication to show beside ours, by model, all of held-out data. No computation uses them.

    `nrmse` are fractions, `rmse` in the target's unit; `rmse_at_least` are lower bounds, where no more was printed. `tables` are CSV files
    that the page shows as they are.
    """

    source: str
    nrmse: dict[str, Share] = {}
    rmse: dict[str, OfTarget] = {}
    rmse_at_least: dict[str, OfTarget] = {}
    tables: list[SpecPath] = []

    @property
    def numbers(self) -> Published:
        """The same as data."""
        return Published(self.source, self.nrmse, self.rmse, self.rmse_at_least)


class Style(Section):
    """How figures look: `width` of a panel that stands by itself, `font`, `size` of its labels in points (titles and ticks are 1 pt less).

    `labels` are axis labels by quantity, with their unit; formulas may stand between dollars. `palette` are the colours of the models,
    that of the run's own first.
    """

    width: Metres = 0.0889
    font: str | None = None
    size: Annotated[float, Field(ge=5, le=24)] = 8.0
    labels: dict[Quantity, str] = {}
    palette: list[Annotated[str, Field(pattern=r"^#[0-9A-Fa-f]{6}$")]] = []


class Report(Section):
    """Figures and files of the report; `units` are further units, by quantity, to print the equations in, as a publication does.

    `html` is the page, `svg` a file for each figure, `csv` and `tex` the tables. With `pdf`, `png` or `pgf`, every panel of every figure is
    a file of its own in `panels/`, beside the numbers that it was drawn from.
    """

    figures: list[FigureName] = list(FIGURES)
    formats: list[Literal["html", "csv", "tex", "svg", "pdf", "png", "pgf"]] = ["html", "csv", "svg"]
    style: Style = Style()
    published: PublishedScores | None = None
    units: dict[Quantity, str] = {}
