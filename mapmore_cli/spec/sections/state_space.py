"""The keys of `model: {type: state_space}`, P's model of motion."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from mapmore_cli.spec.fields import Many, Number, Seconds, Section, by_shape, contradiction, of_sibling

Ends = Annotated[tuple[float, float], Field(strict=False)]


class Bounds(Section):
    """Where `solver: swarm` looks for P1, P2, P3; without `p3`, four times the spans' ratio, either sign."""

    p1: Ends = (-1.0, 1.0)
    p2: Ends = (-2.0, 2.0)
    p3: Ends | None = None

    @model_validator(mode="after")
    def _upright(self) -> Bounds:
        for name in ("p1", "p2", "p3"):
            ends = getattr(self, name)
            if ends is not None and ends[0] >= ends[1]:
                raise contradiction(f"`{name}` goes from {ends[0]:g} to {ends[1]:g}", "put the lower bound first", name)
        return self


class StateSpaceKeys(Section):
    """What `type: state_space` takes beside the type; the section `model` tells what the keys do."""

    input: str | None = None
    sections: Annotated[
        Annotated[list[Annotated[float, of_sibling("input")]], Field(min_length=1), Many] | Annotated[Annotated[int, Field(ge=1)], Number],
        by_shape,
    ] = 1
    direction: bool = False
    switching: Literal["hard", "carried", "bumpless"] = "hard"
    start: Literal["rest", "zero"] = "rest"
    mask: Literal["input", "displacement"] = "input"
    dead_band: Annotated[float, Field(ge=0), of_sibling("input")] = 0.0
    offset: bool = False
    load: str | None = None
    solver: Literal["least_squares", "differential_evolution", "swarm", "swarm_projected"] = "least_squares"
    polish: bool = False
    particles: Annotated[int, Field(ge=2)] = 50
    iterations: Annotated[int, Field(ge=1)] = 20
    seed: Annotated[int, Field(ge=0)] = 1
    slowest: Seconds | None = None
    bounds: Bounds | None = None
    begin: Bounds | None = None

    @property
    def foreign(self) -> str | None:
        """The first of these keys that is not at its default: other types have no use for it."""
        return next((key for key, field in StateSpaceKeys.model_fields.items() if getattr(self, key) != field.default), None)
