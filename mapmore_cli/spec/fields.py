"""What the spec's models are made of: the strict base, numbers that may carry a unit, unions told apart by the shape of the YAML value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from mapmore_cli.domain.declared import InUnit
from mapmore_cli.spec.units import default_unit


class Section(BaseModel):
    """Base of every part of a spec: strict, closed and immutable."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, populate_by_name=True)


PARTIAL = {"partial": True}
"""Context of the validation of what is left of a spec without its faulty parts: what is required may be among them."""


# Numbers with units ------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Surroundings:
    """What the unit of a number can depend on."""

    units: Mapping[str, str]  # the spec's `units:`
    target: str  # the quantity that is modelled
    level: str | None = None  # the quantity that is constant within a curve
    key: str = ""  # the nearest key that the user chose, as `pressure` in `set: {pressure: 2 bar}`
    siblings: Mapping[str, Any] | None = None  # the section that the number stands in

    def unit_of(self, quantity: object) -> str | None:
        """The model's unit of a quantity; None where the spec does not name one."""
        return default_unit(quantity, self.units) if isinstance(quantity, str) else None

    def sibling(self, name: str) -> object:
        """Another value of the same section."""
        return (self.siblings or {}).get(name)


@dataclass(frozen=True)
class RelativePath:
    """Marks a path that starts at the folder of the file that it is written in; `bare` names without a folder stay as they are."""

    bare: bool = False


LONGEST_NAME, LONGEST_PATH = 255, 4000


@dataclass(frozen=True)
class SettingsOf:
    """Marks a mapping with keys of a whole spec, as `data.files`; the spec's model is looked up late, since it holds the mapping."""

    model: Callable[[], type[BaseModel]]


def _column_unit(around: Surroundings) -> str | None:
    unit = around.sibling("unit")
    return unit if isinstance(unit, str) else around.unit_of(around.key)


OF_TARGET = ("rmse", "normaliser", "max_abs_error")
"""Metrics in the unit of the target."""


def _metric_unit(around: Surroundings) -> str | None:
    return around.unit_of(around.target) if around.key in OF_TARGET else "1"


Metres = Annotated[float, Field(gt=0), InUnit(lambda _: "m")]
Hertz = Annotated[float, Field(gt=0), InUnit(lambda _: "Hz")]
SignedSeconds = Annotated[float, InUnit(lambda _: "s")]
OfTarget = Annotated[float, InUnit(lambda around: around.unit_of(around.target))]
InColumnUnit = Annotated[float, InUnit(_column_unit)]
Metric = Annotated[float, InUnit(_metric_unit)]
Share = Annotated[float, InUnit(lambda _: "1")]

Quantity = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100)]
"""The name of a quantity, as expressions spell it."""
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100)]
"""The name of a run, which is a folder's as well."""


def possible_path(path: str) -> str:
    """A path that a file system can take; ValueError for one with a name of more than 255 bytes, or a zero byte."""
    longest = max(path.split("/"), key=len)
    if len(path) > LONGEST_PATH or len(longest.encode()) > LONGEST_NAME:
        raise ValueError(f"no path is as long as {longest[:40]!r}..., {len(path)} characters")
    if "\0" in path:
        raise ValueError(f"{path!r} holds a zero byte, which no path does")
    return path


SpecPath = Annotated[str, AfterValidator(possible_path), RelativePath()]
"""The path of a file, or a glob; relative ones start at the folder of the file that they are written in."""
