"""What the spec's models are made of: the strict base, numbers that may carry a unit, unions told apart by the shape of the YAML value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, GetJsonSchemaHandler, Tag
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from mapmore_cli.spec.units import default_unit


class Section(BaseModel):
    """Base of every part of a spec: strict, closed and immutable."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True, populate_by_name=True)


PARTIAL = {"partial": True}
"""Context of the validation of what is left of a spec without its faulty parts: what is required may be among them."""


def contradiction(message: str, remedy: str, *near: str) -> PydanticCustomError:
    """An error about several keys of one section; it is shown at the first key of `near` that the section has, else at the section."""
    return PydanticCustomError("contradiction", "{message}", {"message": message, "remedy": remedy, "near": near})


# Unions ------------------------------------------------------------------------------------------------------------------------------


def shape(value: Any) -> str:
    """What a value is in YAML's terms, in words for messages."""
    match value:
        case None:
            return "<nothing>"
        case str():
            return "<text>"
        case bool():
            return "<true or false>"
        case int() | float():
            return "<a number>"
        case list() | tuple():
            return "<a list>"
        case _:
            return "<a mapping>"


by_shape = Discriminator(shape)
"""Chooses the member of a union, so that a mistake gives one message instead of one for every member."""


def by_word(word: str) -> Discriminator:
    """A number, or one `word` in its place; anything else is told as a number that it should be."""
    return Discriminator(lambda value: Text.tag if value == word else Number.tag)


def by_shape_or_key(key: str) -> Discriminator:
    """The same, where of two kinds of mappings one is told by a `key` of its own: its tag is `with_key(key)`."""

    def kind(value: Any) -> str:
        has = key in value if isinstance(value, dict) else hasattr(value, key)
        return with_key(key).tag if shape(value) == Keyed.tag and has else shape(value)

    return Discriminator(kind)


def with_key(key: str) -> Tag:
    """The tag of the mappings that have a `key`."""
    return Tag(f"<a mapping with `{key}`>")


Text, Number, Many, Keyed = Tag("<text>"), Tag("<a number>"), Tag("<a list>"), Tag("<a mapping>")
TrueFalse = Tag("<true or false>")


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
class WithUnit:
    """Marks a number that may be written with a unit; `unit` says which one the loader converts it to."""

    unit: Callable[[Surroundings], str | None]

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        """A number, or text that starts with one (or with a variable)."""
        return {"anyOf": [handler(schema), {"type": "string", "pattern": r"^\s*[-+]?[0-9.]|\$\{"}]}


@dataclass(frozen=True)
class RelativePath:
    """Marks a path that starts at the folder of the file that it is written in; `bare` names without a folder stay as they are."""

    bare: bool = False


LONGEST_NAME, LONGEST_PATH = 255, 4000


@dataclass(frozen=True)
class SettingsOf:
    """Marks a mapping with keys of a whole spec, as `data.files`; the spec's model is looked up late, since it holds the mapping."""

    model: Callable[[], type[BaseModel]]


def of_sibling(name: str) -> WithUnit:
    """A number in the unit of the quantity that another key of the section names."""
    return WithUnit(lambda around: around.unit_of(around.sibling(name)))


def _column_unit(around: Surroundings) -> str | None:
    unit = around.sibling("unit")
    return unit if isinstance(unit, str) else around.unit_of(around.key)


OF_TARGET = ("rmse", "normaliser", "max_abs_error")
"""Metrics in the unit of the target."""


def _metric_unit(around: Surroundings) -> str | None:
    return around.unit_of(around.target) if around.key in OF_TARGET else "1"


Metres = Annotated[float, Field(gt=0), WithUnit(lambda _: "m")]
Seconds = Annotated[float, Field(gt=0), WithUnit(lambda _: "s")]
Hertz = Annotated[float, Field(gt=0), WithUnit(lambda _: "Hz")]
SignedSeconds = Annotated[float, WithUnit(lambda _: "s")]
OfKey = Annotated[float, WithUnit(lambda around: around.unit_of(around.key))]
OfHeld = Annotated[float, WithUnit(lambda around: around.unit_of(around.level))]
OfTarget = Annotated[float, WithUnit(lambda around: around.unit_of(around.target))]
InColumnUnit = Annotated[float, WithUnit(_column_unit)]
Metric = Annotated[float, WithUnit(_metric_unit)]
Share = Annotated[float, WithUnit(lambda _: "1")]

Quantity = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100)]
"""The name of a quantity, as expressions spell it."""
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", max_length=100)]
"""The name of a run, which is a folder's as well."""
Positive = Annotated[float, Field(gt=0)]


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
