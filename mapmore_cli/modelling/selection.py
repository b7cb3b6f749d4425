"""How terms are chosen: the section `fit`, of segments and of models with memory alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Gt, Interval

from mapmore_cli.domain.declared import Contradiction, Either, InUnit, OfHeld, Settings

AUTO = "auto"  # what left-out training data choose: a backbone
LEAST_RIDGE = 1e-9  # a smaller ridge, but for zero, would drown in the rounding of the Gram matrix
# terms chosen forward for each that is kept, where pruning follows and nothing else is said
FORWARD = 3

Loss = Literal["squares", "huber", "bisquare"]
"""What a residual costs."""

Stop = Literal["tolerance", "bic", "aicc", "press", "free_run"]
"""When fewer terms than `max_terms` are enough."""


@dataclass(frozen=True, kw_only=True)
class Fit(Settings):
    """Term selection (M2 eq 2-7): how inputs are scaled, how many terms at most, and when to stop.

    - `scaling` is `none` with memory, `max_abs` for damping, else `unit_square`. `range` brings
      states to [0, 1] and clips them `margin`
      beyond.
    - `train_level` restricts the pieces to one training level, as M2 does (`highest`).
    - `tolerance` ends the choice where no larger fraction of the squares of the target is left; of
      those about its mean where the
      dictionary has a constant. It ends no other `stop` rule.
    - A `ridge`, a fraction of a candidate's variance or `auto`, selects `forward` terms (three
      times `max_terms`) and prunes them.
    - With delays of the output: `criterion: free_run` refines the coefficients on the simulation
      error. `stop: free_run` chooses the number of terms on the last quarter of each training
      recording.
    - A `loss` other than `squares` counts large residuals less, by reweighting: `huber` by their
      size, `bisquare` not at all beyond 4.685 `scale`. `scale: auto` is 1.4826 times the median
      absolute residual. Outliers are listed, and stay.
    - `weight: curve` counts alike, however many samples they have, all curves that are pooled, or
      all recordings of one.
    """

    scaling: Literal["unit_square", "max_abs", "none", "range"] = "unit_square"
    margin: Annotated[float, Interval(ge=0), InUnit(lambda _: "1")] = 0.15
    train_level: Annotated[Literal["all", "highest"] | OfHeld, Either()] = "all"
    max_terms: Annotated[int, Interval(ge=1)] = 1
    tolerance: Annotated[float, Interval(ge=0, lt=1)] = 1e-4
    stop: Stop = "tolerance"
    criterion: Literal["one_step", "free_run"] = "one_step"
    ridge: Annotated[Literal["auto"] | Annotated[float, Interval(ge=0)], Either()] = 0.0
    forward: Annotated[int, Interval(ge=1)] | None = None
    loss: Loss = "squares"
    scale: Annotated[
        Literal["auto"]
        | Annotated[float, Gt(0), InUnit(lambda place: place.unit_of(place.target))],
        Either(),
    ] = "auto"
    weight: Literal["sample", "curve"] = "sample"

    @property
    def known_scale(self) -> float | None:
        """The scale where it is given."""
        return None if isinstance(self.scale, str) else self.scale

    @property
    def forward_terms(self) -> int:
        """Terms that are chosen before pruning, where there is a ridge."""
        forward = FORWARD * self.max_terms if self.forward is None else self.forward
        return max(self.max_terms, forward)

    def __post_init__(self) -> None:
        """Refuse a ridge that is lost in rounding, and a scale of nothing."""
        if self.scale != "auto" and self.loss == "squares":
            raise Contradiction("squares have no scale", "remove it, or add `loss: huber`", "scale")
        if isinstance(self.ridge, float) and 0 < self.ridge < LEAST_RIDGE:
            raise Contradiction(
                f"a ridge of {self.ridge:g} is lost in rounding",
                f"write {LEAST_RIDGE:g} or more, 0 or `auto`",
                "ridge",
            )


@dataclass(frozen=True, kw_only=True)
class MemoryRecipe(Fit):
    """The choices of a model with memory: those of `Fit`, and what they act on.

    With a ridge candidates are centred and divided by their standard deviations, and the model has
    a constant of its own; without, a constant is a candidate like any other. `tolerance` is as in
    `Fit`; with a ridge it is a fraction of the variance.

    - `target`: the output.
    - `dictionary`: candidate terms as text, products of names of states.
    - `step`: time between samples, s.
    """

    target: str
    dictionary: tuple[str, ...]
    step: float
