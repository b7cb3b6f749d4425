"""The sections that say what kind of model the run builds, and of which runs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import model_validator

from mapmore_cli.spec.fields import RelativePath, Section, contradiction


class Needs(Section):
    """Specs of the runs that this one builds on: the `static` model that a damping force is left by, the `damping` model added to it."""

    static: Annotated[str, RelativePath()] | None = None
    damping: Annotated[str, RelativePath()] | None = None


class ModelChoice(Section):
    """What kind of model the run builds.

    `mapmore` with a `backbone` explains by pieces what that formula leaves; `literature` fits the formula `name` alone; `sum` adds the
    static and the damping model that the spec needs, and is the default for the target `dynamic`.
    """

    type: Literal["mapmore", "literature", "sum"] = "mapmore"
    backbone: str | None = None
    name: str | None = None

    @model_validator(mode="after")
    def _fits_type(self) -> ModelChoice:
        if self.type == "literature" and self.name is None:
            raise contradiction("type `literature` needs the `name` of a formula", "add it, as `name: sarosi`", "type")
        if self.type == "literature" and self.backbone is not None:
            raise contradiction("type `literature` has no `backbone`", "remove it, or use `type: mapmore`", "backbone")
        if self.type != "literature" and self.name is not None:
            raise contradiction(f"type `{self.type}` has no `name`", "use `backbone`, or `type: literature`", "name")
        if self.type == "sum" and self.backbone is not None:
            raise contradiction("type `sum` has no `backbone`", "remove it: both models have their own", "backbone")
        return self
