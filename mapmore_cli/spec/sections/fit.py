"""The `fit` section: how terms are selected."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from mapmore_cli.spec.fields import Measured, Number, OfHeld, Section, Text, by_shape


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
