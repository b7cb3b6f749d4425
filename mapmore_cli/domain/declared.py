"""Define the types by which the settings of a spec are declared. Each setting is declared once, as
a field of a frozen dataclass in the module that uses the setting.

    z_s: Annotated[float, Interval(ge=0, le=0.5)] = 0.25

The annotation of the field contains its type, its bounds (from the package `annotated_types`), and
its unit (`InUnit`). The default is its value, and the explanation is in the docstring of the class.
The spec is validated with these classes, and its JSON schema and `docs/spec.md` are made from them.
Pydantic calls special methods of these types by name, so pydantic is not imported here.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from inspect import cleandoc
from typing import Annotated, Any, ClassVar, Literal, Protocol, TypeVar, get_args, get_origin

from annotated_types import Gt, MaxLen

from mapmore_cli.domain.foreign import is_one_line

S = TypeVar("S")


def prose(docstring: str | None) -> str:
    """Return the text of a docstring in which every paragraph and every list item is one line."""
    return re.sub(r"(?<=\S)\n +(?=\S)|(?<=\S)\n(?![\s-])", " ", cleandoc(docstring or ""))


class Handler(Protocol):
    """Type of the function with which pydantic makes the schema of a type."""

    def __call__(self, source: object, /) -> dict[str, object]:
        """Return the schema that pydantic makes for the type by default."""

    def generate_schema(self, source: object, /) -> dict[str, object]:
        """Return the schema of any type, not only of the type that pydantic is handling."""


class Info(Protocol):
    """Pydantic's information about a value. `context` is the loader's `study.fields.Context`, or
    None.
    """

    context: Any


@dataclass(frozen=True)
class Settings:
    """Base class of dataclasses whose fields are the keys of a section. Types are checked strictly,
    and unknown keys are refused.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {
        "extra": "forbid",
        "strict": True,
        "allow_inf_nan": False,
    }

    @classmethod
    def __get_pydantic_core_schema__(cls, source: object, handler: Handler) -> object:
        """Return a schema that also accepts a mapping in place of an object of the class. The
        values in the mapping are still checked strictly.
        """
        schema = {**handler(source), "strict": False}
        ref = schema.pop("ref", None)
        noted = before(schema, cls._noted)
        return noted if ref is None else {**noted, "ref": ref}

    @classmethod
    def _noted(cls, value: object, info: Info) -> object:
        """Tell the loader which keys this mapping may have. The loader lists these keys in messages
        about unknown keys.
        """
        if info.context is not None and isinstance(value, Mapping):
            info.context.note(value, [key.name for key in fields(cls)])
        return value

    @property
    def changed(self) -> list[str]:
        """Names of the keys whose values differ from the defaults."""
        return [key.name for key in fields(self) if getattr(self, key.name) != key.default]


def before(schema: object, function: Callable[[Any, Any], object]) -> dict[str, object]:
    """Return a schema of pydantic that first applies `function` to the value and its `Info`, and
    then validates the result with `schema`.

    `info.context` is the loader's `study.fields.Context`, or None.
    """
    step = {"type": "with-info", "function": function}
    return {"type": "function-before", "function": step, "schema": schema}


class Contradiction(ValueError):
    """Error for settings that contradict each other, or for a value that its key does not allow.
    `near` holds names of keys of a section. The message points to the first of these keys that the
    section has. If the section has none of them, it points to the section. If `near` is empty, it
    points to the value.
    """

    def __init__(self, message: str, remedy: str | None, *near: str) -> None:
        super().__init__(message)
        self.message, self.remedy, self.near = message, remedy, near


def from_fields(of: type[S], settings: object, **overrides: object) -> S:
    """Return an object of the dataclass `of`. A field takes its value from `overrides` if
    `overrides` contains the name of the field, and otherwise from the attribute of `settings` with
    this name.
    """
    names = [field.name for field in fields(of)]  # type: ignore[arg-type]
    shared = {name: getattr(settings, name) for name in names if hasattr(settings, name)}
    return of(**{**shared, **overrides})


# Values that may have several forms
# --------------------------------------------------------------------------------------------------


_SHAPES: tuple[tuple[Any, str], ...] = (
    (type(None), "<nothing>"),
    (str, "<text>"),
    (bool, "<true or false>"),
    ((int, float), "<a number>"),
    (Sequence, "<a list>"),
)


def shape(value: object) -> str:
    """Return the YAML type of a value, for messages."""
    return _shape_of(type(value))


def _shape_of(type_: Any) -> str:
    origin, arguments = get_origin(type_), get_args(type_)
    if origin is Annotated:
        return _shape_of(arguments[0])
    if origin is Literal:
        return shape(arguments[0])
    return next(
        (name for types, name in _SHAPES if issubclass(origin or type_, types)), "<a mapping>"
    )


@dataclass(frozen=True)
class Either:
    """Annotation of a union type. The member of the union is chosen by the form of the value, for
    example a number, a text, a list or a mapping. A mistake then gives a single message, instead of
    a message for each member.

    If two members are mappings, the member that has the key `key` is chosen for a value that has
    this key.
    """

    key: str | None = None

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return a schema in which each member of the union has a tag. For a value, pydantic calls
        a function of this schema, which returns the tag of the member that fits the form of the
        value.
        """
        members = get_args(source)
        choices = {self._tag(member): handler.generate_schema(member) for member in members}
        has_unit = any(
            isinstance(mark, InUnit)
            for member in members
            for mark in getattr(member, "__metadata__", ())
        )

        def tag_of(value: object) -> str:
            is_number = has_unit and getattr(value, "is_quantity", False)
            return "<a number>" if is_number else self._told(value)

        return {"type": "tagged-union", "choices": choices, "discriminator": tag_of}

    def _tag(self, member: object) -> str:
        keys = getattr(member, "__dataclass_fields__", None) or getattr(member, "model_fields", {})
        return f"<a mapping with `{self.key}`>" if self.key in keys else _shape_of(member)

    def _told(self, value: object) -> str:
        form, key = shape(value), self.key or ""
        has = key in value if isinstance(value, Mapping) else hasattr(value, key)
        return f"<a mapping with `{key}`>" if has and form == "<a mapping>" else form


@dataclass(frozen=True)
class ListToo:
    """Annotation of a tuple that may be written as a list."""

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the schema of a tuple that also accepts a list. The elements are still checked
        strictly.
        """
        return {**handler(source), "strict": False}


Pair = Annotated[tuple[float, float], ListToo()]


@dataclass(frozen=True)
class Matching:
    """Annotation of a text that must match the regular expression `pattern`."""

    pattern: str

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the schema of a text that must match the pattern."""
        return {**handler(source), "pattern": self.pattern}


# Stored values ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ValueCondition:
    """Condition for a stored value. `holds(value)` returns True for a valid value; `words` is the
    end of the message for an invalid value, for example `is negative`.
    """

    words: str
    holds: Callable[[Any], Any]


def one_of(*words: str) -> ValueCondition:
    """Return the condition that a stored text is one of the given words."""
    return ValueCondition(f"is not one of {', '.join(words)}", words.__contains__)


def is_label(text: str) -> bool:
    """Return True if a text can be the name of a curve, a file or a unit."""
    return len(text) <= 1000 and is_one_line(text) and not {*'"`$<>\\'} & {*text}


Notes = Annotated[tuple[str, ...], "remarks for the reader"]

Count = Annotated[int, ValueCondition("is negative", lambda value: value >= 0)]

QuantityName = Annotated[
    str,
    ValueCondition(
        "is not a valid name of a quantity (a letter, then letters, digits and _)",
        re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}").fullmatch,
    ),
]
TermName = Annotated[
    str,
    ValueCondition(
        "is not a valid term: it is empty, longer than 10000 characters, or contains other "
        "characters than terms may contain",
        re.compile(r"[A-Za-z0-9_.,\[\]+\-^*/() ]{1,10000}").fullmatch,
    ),
]
Label = Annotated[
    str,
    ValueCondition(
        'is not a valid name: it must be one line of at most 1000 characters, without " ` $ < > \\',
        is_label,
    ),
]
"""Name of a curve, a file or a unit, in letters of any script."""


# Numbers with units
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class InUnit:
    """Annotation of a number that may be written with a unit. The number is converted to the unit
    that `unit(place)` returns, where `place` is the place of the number in the spec
    (`study.fields.Place`). `words` is a text that describes this unit to a reader.

    The number is a value of a quantity, for example a temperature. A width, a tolerance, an error
    or an offset is a `Difference` instead: a difference of 1 K equals a difference of 1 degC, but a
    temperature of 1 K is not a temperature of 1 degC.
    """

    unit: Callable[[Any], str | None]
    words: str

    is_difference: ClassVar[bool] = False

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the schema of the number. A text with a unit is converted first."""
        return before(handler(source), self._converted)

    def _converted(self, value: object, info: Info) -> object:
        if info.context is None:
            return value
        return info.context.converted(value, self.unit, self.is_difference)

    def __get_pydantic_json_schema__(self, schema: object, handler: Handler) -> object:
        """Return the JSON schema of a number that may also be written as a text. The text starts
        with a number, or contains a variable such as `${NAME}`.
        """
        written = {"type": "string", "pattern": r"^\s*[-+]?[0-9.]|\$\{"}
        unit = f"{self.words}, as a difference" if self.is_difference else self.words
        return {"anyOf": [handler(schema), written], "unit": unit}


@dataclass(frozen=True)
class Difference(InUnit):
    """Annotation of a number that is a difference of two values of a quantity. The number is
    converted with the factor of the unit, without the offset.
    """

    is_difference: ClassVar[bool] = True


def always_in(unit: str) -> InUnit:
    """Return the annotation of a number whose unit is always the same."""
    return InUnit(lambda _: unit, unit)


def of_sibling(name: str, mark: type[InUnit] = InUnit) -> InUnit:
    """Return the annotation of a number in the unit of a quantity. The quantity is the value of the
    key `name`, which stands in the same section as the number.
    """
    return mark(lambda place: place.unit_of(place.siblings.get(name)), f"that of `{name}`")


Seconds = Annotated[float, Gt(0), always_in("s")]
OfKey = Annotated[
    float, InUnit(lambda place: place.unit_of(place.quantity), "that of the quantity")
]
"""Number in the unit of the quantity that the key above it names."""
OfTarget = Annotated[
    float, Difference(lambda place: place.unit_of(place.context.target), "that of the target")
]
"""An error, a residual or a coefficient, in the unit of the target."""
OfHeld = Annotated[
    float, InUnit(lambda place: place.unit_of(place.context.level), "that of `levels.of`")
]
"""Number in the unit of the quantity that is constant within a curve."""


Name = Annotated[str, MaxLen(100), Matching(r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
"""Name of a run, which is also the name of its folder."""

Word = Literal["increasing", "decreasing", "convex", "concave", "positive"]
"""Known shape of the output along an input; `positive` is about the output itself."""

Beyond = Literal["continue", "continue_linear", "saturate", "zero"]
"""Behaviour outside a limit (M2 eq 12)."""
