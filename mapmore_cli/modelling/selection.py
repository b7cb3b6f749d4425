"""Define the section `fit`: how terms are chosen, for segments and for models with memory."""

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
from mapmore_cli.modelling.frols.weighing import LOSSES

# The structure of a model (`model.type`), the backbone and the ridge are chosen by cross-validation
# if their setting has this value.
AUTO = "auto"
# smallest ridge except zero; a smaller ridge is lost in the rounding errors of the Gram matrix
LEAST_RIDGE = 1e-9
# default ratio of the number of terms before pruning to the number after pruning
FORWARD = 3

TERMS_OF_ONE_MODEL = 12
"""Default largest number of terms of one model for whole recordings, or for all curves together."""

Stop = Literal["tolerance", "bic", "aicc", "press", "free_run"]
"""Rule by which a fit may keep fewer terms than `max_terms`."""


@dataclass(frozen=True, kw_only=True)
class Fit(Settings):
    """Rules for choosing terms (M2 eq 2-7).

    - `scaling`: How inputs are scaled before they enter terms. `unit_square` shifts and
      divides each input, so that it is zero at one end of its training range and has the magnitude
      1 at the other end. Because of the shift, a product of two physical inputs is a sum of up to
      four terms of the scaled inputs. With `max_abs` (division by the largest magnitude) and
      `none`, nothing is shifted, and the product is one term. `range`, only with memory, maps
      states to [0, 1]. The default is `unit_square` for pieces, `none` with memory, and `max_abs`
      for damping. Example: `none`
    - `margin`: Only with memory: distance outside the training range at which states are clipped
      with `scaling: range`, as a fraction of the range. Example: `0.15`
    - `train_level`: The training level whose samples alone are used to fit the segments, as in M2,
      or `all`. Example: `highest`
    - `max_terms`: Largest number of terms of each segment (a curve that is not cut is one segment).
      With memory, or if one function is fitted to all curves together, it is the number of terms of
      the whole model; the default is then 12, and unless `tolerance` is given, `stop: bic` keeps as
      many terms as the data support. More terms fit the training data better, but overfit sooner.
      Example: `2`
    - `tolerance`: Stop when the unexplained fraction of the target's sum of squares is not larger
      than this. If the dictionary has a constant, the mean of the target is subtracted first. The
      key has no effect with any other `stop` rule. Example: `0.01`
    - `stop`: Rule by which a fit may keep fewer terms than `max_terms`. `free_run`, only with
      memory, chooses the number by simulation of the last quarter of each training recording. With
      memory, or if one function is fitted to all curves together, the default is `bic` unless
      `max_terms` or `tolerance` is given. Example: `bic`
    - `criterion`: Which error the coefficients make small in a model with lags of the output: the
      error one step ahead (`one_step`), or the error of a simulation (`free_run`). In any other
      model, `free_run` is refused. Example: `free_run`
    - `ridge`: Only with memory: regularisation as a fraction of a candidate's variance, or `auto`
      to choose it. More terms than wanted are then selected (see `forward`), and the least
      important ones are removed until `max_terms` remain. Example: `auto`
    - `forward`: Number of terms that are selected before some are removed, only with `ridge`; three
      times `max_terms` by default. Example: `30`
    - `loss`: Loss function for residuals. `huber` limits the influence of large residuals.
      `bisquare` ignores residuals larger than 4.685 times `scale`. Outliers are listed, and remain
      in the data. Only `squares` is possible with `shape`, with `sign` or `bounds` in the
      dictionary, and with memory if `ridge` or `free_run` is set. Example: `huber`
    - `scale`: Size of an ordinary residual, for `huber` and `bisquare`. `auto` takes 1.4826 times
      the median absolute residual. Example: `auto`
    - `weight`: With `curve`, all pooled curves (or all recordings of one curve) have the same total
      weight, however many samples they have. Only `sample` is possible with memory, and with
      `shape`, `sign` or `bounds`. Example: `curve`
    - `shape`: Known shape of the output along its inputs. With memory, it is the shape of the
      output at rest, and only `increasing` and `decreasing` are possible. The coefficients are
      fitted so that the output has this shape; the choice of terms does not consider it. No shape
      is required at inputs for which the training output is close to its minimum (see `slack`).
      Example: `{pressure: increasing, strain: [decreasing, convex]}`
    - `slack`: Fraction of the range of the training output. No shape is required if the training
      output is above its minimum by less than this. Example: `0.05`
    - `beyond`: Distance outside the training range up to which the shape must hold, as a fraction
      of the range. Example: `0.1`
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
    loss: Literal["squares", *LOSSES] = "squares"  # type: ignore[valid-type]
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
        """The value of `scale` if it is a number; None if it is `auto`."""
        return None if isinstance(self.scale, str) else self.scale

    @property
    def forward_terms(self) -> int:
        """Number of terms that are selected before pruning, if there is a ridge."""
        forward = FORWARD * self.max_terms if self.forward is None else self.forward
        return max(self.max_terms, forward)

    def __post_init__(self) -> None:
        """Raise an error for a ridge that is below the rounding errors, and for keys that would
        have no effect.
        """
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
    """Settings of a model with memory: all keys of the section `fit` (the class `Fit`), and the
    four settings below.

    With a ridge, candidates are centred and divided by their standard deviations, and the model has
    a separate constant. Without a ridge, the constant is a candidate like any other. `tolerance`
    has the same meaning as for segments, except that it is a fraction of the variance of the output
    if there is a ridge.

    - `target`: the output.
    - `dictionary`: candidate terms as texts. Each is a product of names of states.
    - `step`: time between samples, s.
    - `ordered`: True if the time steps are uneven. The model then uses the order of the samples
      only, and not the time between them.
    """

    target: str
    dictionary: tuple[str, ...]
    step: float
    ordered: bool
