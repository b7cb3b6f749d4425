"""How terms are chosen: the section `fit`, of segments and of models with memory alike."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Gt, Interval, Len

from mapmore_cli.domain.declared import (
    Contradiction,
    Either,
    OfHeld,
    OfTarget,
    Settings,
    Word,
    always_in,
)

AUTO = "auto"  # what left-out training data choose: a backbone
LEAST_RIDGE = 1e-9  # a smaller ridge, but for zero, would drown in the rounding of the Gram matrix
# terms chosen forward for each that is kept, where pruning follows and nothing else is said
FORWARD = 3

TERMS_OF_ONE_MODEL = 12
"""Terms of one model of whole records, or of all curves, at most, where nothing else is said."""

Loss = Literal["squares", "huber", "bisquare"]
"""What a residual costs."""

Stop = Literal["tolerance", "bic", "aicc", "press", "free_run"]
"""When fewer terms than `max_terms` are enough."""


@dataclass(frozen=True, kw_only=True)
class Fit(Settings):
    """How terms are chosen (M2 eq 2-7).

    - `scaling`: how inputs are scaled: `none` by default with memory, `max_abs` for damping;
      `range` brings states to [0, 1]; `unit_square` puts the origin into a corner of the data, so
      that a product of two of many inputs needs four terms: `max_abs` then finds it with one, as
      `none`
    - `margin`: how far beyond `range` states are clipped, as a fraction of it, as `0.15`
    - `train_level`: the one training level whose samples the pieces are fitted to, as M2 does, as
      `highest`
    - `max_terms`: terms of a segment, or of one model of whole records or of all curves, at most;
      such a model has up to 12 by default, of which `stop: bic` keeps as many as the data support,
      as `2`
    - `tolerance`: ends the choice where no larger fraction of the squares of the target is left, of
      those about its mean where the dictionary has a constant; it ends no other `stop` rule, as
      `0.01`
    - `stop`: when fewer terms than `max_terms` are enough; `free_run` chooses the number on the
      last quarter of each training recording, as `bic`
    - `criterion`: with delays of the output, `free_run` refines the coefficients on the simulation
      error, as `free_run`
    - `ridge`: a fraction of a candidate's variance, or `auto`: `forward` terms are selected and
      pruned to `max_terms`, as `auto`
    - `forward`: terms that are selected before pruning; three times `max_terms` by default, as `30`
    - `loss`: what a residual costs: `huber` counts large ones by their size, `bisquare` not at all
      beyond 4.685 `scale`; outliers are listed, and stay, as `huber`
    - `scale`: size of an ordinary residual; `auto` is 1.4826 times the median absolute one, as
      `auto`
    - `weight`: `curve` counts alike, however many samples they have, all curves that are pooled, or
      all recordings of one, as `curve`
    - `shape`: what is known of the output along its inputs, where the training output stands clear
      of its least, or, with memory, of the output at rest; coefficients follow it, the choice of
      terms does not, as `{pressure: increasing,
      strain: [decreasing, convex]}`
    - `slack`: the share of the range of the training output above its least, below which no shape
      is asked for, as `0.05`
    - `beyond`: how far beyond the training range the shape holds, as a share of it, as `0.1`
    """

    scaling: Literal["unit_square", "max_abs", "none", "range"] = "unit_square"
    margin: Annotated[float, Interval(ge=0), always_in("1")] = 0.15
    train_level: Annotated[Literal["all", "highest"] | OfHeld, Either()] = "all"
    max_terms: Annotated[int, Interval(ge=1)] = 1
    tolerance: Annotated[float, Interval(ge=0, lt=1)] = 1e-4
    stop: Stop = "tolerance"
    criterion: Literal["one_step", "free_run"] = "one_step"
    ridge: Annotated[Literal["auto"] | Annotated[float, Interval(ge=0)], Either()] = 0.0
    forward: Annotated[int, Interval(ge=1)] | None = None
    loss: Loss = "squares"
    scale: Annotated[Literal["auto"] | Annotated[OfTarget, Gt(0)], Either()] = "auto"
    weight: Literal["sample", "curve"] = "sample"
    shape: (
        Annotated[dict[str, Annotated[Word | Annotated[Sequence[Word], Len(1)], Either()]], Len(1)]
        | None
    ) = None
    slack: Annotated[float, Interval(ge=0, lt=1), always_in("1")] = 0.05
    beyond: Annotated[float, Interval(ge=0, le=10), always_in("1")] = 0.0

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
            raise Contradiction(
                "`scale` has no effect with `loss: squares`",
                "remove it, or add `loss: huber`",
                "scale",
            )
        if isinstance(self.ridge, float) and 0 < self.ridge < LEAST_RIDGE:
            raise Contradiction(
                f"a ridge of {self.ridge:g} is smaller than rounding errors, so that it has "
                "no effect",
                f"write {LEAST_RIDGE:g} or more, 0 or `auto`",
                "ridge",
            )
        for key in ("slack", "beyond"):
            if self.shape is None and key in self.changed:
                raise Contradiction(
                    f"`{key}` has no effect without `shape`", f"remove `{key}`", key
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
    - `ordered`: whether that is uneven, and the order of samples alone counts.
    """

    target: str
    dictionary: tuple[str, ...]
    step: float
    ordered: bool = False
