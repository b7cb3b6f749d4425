"""A setting is declared once: a field of a frozen dataclass beside the mathematics that uses it.

    z_s: Annotated[float, Interval(ge=0, le=0.5)] = 0.25

Type and default are the field's own, bounds are `annotated_types`, a unit is an `InUnit`, the text
stands in the docstring of the class. The spec validates these classes, and its JSON schema and
`docs/spec.md` come from them. What pydantic asks of a type it asks by the names of methods, so that
nothing of it is imported here.
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
    """Return the text of a docstring with each paragraph and each item of a list in one line."""
    return re.sub(r"(?<=\S)\n +(?=\S)|(?<=\S)\n(?![\s-])", " ", cleandoc(docstring or ""))


class Handler(Protocol):
    """What pydantic hands over to make the schema of a type."""

    def __call__(self, source: object, /) -> dict[str, object]:
        """Return the schema that the type has without us."""

    def generate_schema(self, source: object, /) -> dict[str, object]:
        """Return the schema of another type."""


class Info(Protocol):
    """What pydantic knows of a value: `context` is the loader's `study.fields.Context`, or None."""

    context: Any


@dataclass(frozen=True)
class Settings:
    """Base of the dataclasses whose fields are keys of a section: the section is strict, and knows
    no other keys.
    """

    __pydantic_config__: ClassVar[dict[str, Any]] = {
        "extra": "forbid",
        "strict": True,
        "allow_inf_nan": False,
    }

    @classmethod
    def __get_pydantic_core_schema__(cls, source: object, handler: Handler) -> object:
        """Take mappings too, although the values in them are strict."""
        schema = {**handler(source), "strict": False}
        ref = schema.pop("ref", None)
        noted = before(schema, cls._noted)
        return noted if ref is None else {**noted, "ref": ref}

    @classmethod
    def _noted(cls, given: object, info: Info) -> object:
        """Tell the loader which keys a mapping may have."""
        if info.context is not None and isinstance(given, Mapping):
            info.context.note(given, [key.name for key in fields(cls)])
        return given

    @property
    def changed(self) -> list[str]:
        """Keys whose values differ from their defaults."""
        return [key.name for key in fields(self) if getattr(self, key.name) != key.default]


def before(schema: object, function: Callable[[Any, Any], object]) -> dict[str, object]:
    """Return a schema of pydantic with a function before it, of the value and what is known of it.

    `info.context` is the loader's `spec.fields.Context`, or None.
    """
    step = {"type": "with-info", "function": function}
    return {"type": "function-before", "function": step, "schema": schema}


class Contradiction(ValueError):
    """Settings that do not fit each other, or a value that does not fit its key; shown at the first
    key of `near` that the section has, else at the value.
    """

    def __init__(self, message: str, remedy: str | None, *near: str) -> None:
        super().__init__(message)
        self.message, self.remedy, self.near = message, remedy, near


def from_fields(of: type[S], settings: object, **own: object) -> S:
    """Return an `of` with the fields that it shares with `settings`, and with its `own`."""
    names = [field.name for field in fields(of)]  # type: ignore[arg-type]
    shared = {name: getattr(settings, name) for name in names if hasattr(settings, name)}
    return of(**{**shared, **own})


# Either of several forms
# --------------------------------------------------------------------------------------------------


_SHAPES: tuple[tuple[Any, str], ...] = (
    (type(None), "<nothing>"),
    (str, "<text>"),
    (bool, "<true or false>"),
    ((int, float), "<a number>"),
    (Sequence, "<a list>"),
)


def shape(value: object) -> str:
    """Return what a value is in YAML's terms, in words for messages."""
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
    """Marks a union in which the form of the value decides about the member, so that a mistake
    gives one message instead of one for each member.

    Of two mappings, the member with the key `key` is the one whose value has it.
    """

    key: str | None = None

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the members by their tags, and what tells the tag of a value."""
        members = get_args(source)
        choices = {self._tag(member): handler.generate_schema(member) for member in members}
        has_unit = any(
            isinstance(mark, InUnit)
            for member in members
            for mark in getattr(member, "__metadata__", ())
        )

        def told(value: object) -> str:
            is_number = has_unit and getattr(value, "is_quantity", False)
            return "<a number>" if is_number else self._told(value)

        return {"type": "tagged-union", "choices": choices, "discriminator": told}

    def _tag(self, member: object) -> str:
        keys = getattr(member, "__dataclass_fields__", None) or getattr(member, "model_fields", {})
        return f"<a mapping with `{self.key}`>" if self.key in keys else _shape_of(member)

    def _told(self, value: object) -> str:
        found, key = shape(value), self.key or ""
        has = key in value if isinstance(value, Mapping) else hasattr(value, key)
        return f"<a mapping with `{key}`>" if has and found == "<a mapping>" else found


@dataclass(frozen=True)
class ListToo:
    """Marks a tuple that may be written as a list."""

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the tuple's schema; its values stay strict."""
        return {**handler(source), "strict": False}


Pair = Annotated[tuple[float, float], ListToo()]


@dataclass(frozen=True)
class Matching:
    """Marks a text of which a pattern is true."""

    pattern: str

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the text's schema with the pattern."""
        return {**handler(source), "pattern": self.pattern}


# Stored values ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Checked:
    """Marks a stored value: `holds` is true of each that a file may hold; `words` say what is wrong
    with any other.
    """

    words: str
    holds: Callable[[Any], Any]


def one_of(*words: str) -> Checked:
    """Mark a text that is one of a few words."""
    return Checked(f"is none of {', '.join(words)}", words.__contains__)


def is_label(text: str) -> bool:
    """Whether a text can be the name of a curve, a file or a unit."""
    return len(text) <= 1000 and is_one_line(text) and not {*'"`$<>\\'} & {*text}


Count = Annotated[int, Checked("is negative", lambda found: found >= 0)]

QuantityName = Annotated[
    str,
    Checked(
        "is not a valid name of a quantity (a letter, then letters, digits and _)",
        re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}").fullmatch,
    ),
]
TermName = Annotated[
    str,
    Checked(
        "is not a valid term: it is empty, has other characters, or more than 10000 of them",
        re.compile(r"[A-Za-z0-9_.,\[\]+\-^*/() ]{1,10000}").fullmatch,
    ),
]
Label = Annotated[
    str,
    Checked(
        'is not a valid name: it must be one line of at most 1000 characters, without " ` $ < > \\',
        is_label,
    ),
]
"""The name of a curve, a file or a unit: letters of any script."""


# Numbers with units
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class InUnit:
    """Marks a number that may be written with a unit; `unit` says which one it is converted to,
    given the place of the number (`spec.fields.Place`), and `words` say it to a reader.

    The number is a value of its quantity. A width, a tolerance, an error or what is added is a
    `Difference` of two values: 1 K more is 1 degC more.
    """

    unit: Callable[[Any], str | None]
    words: str

    is_difference: ClassVar[bool] = False

    def __get_pydantic_core_schema__(self, source: object, handler: Handler) -> object:
        """Return the number's schema, and the conversion before it."""
        return before(handler(source), self._converted)

    def _converted(self, given: object, info: Info) -> object:
        if info.context is None:
            return given
        return info.context.converted(given, self.unit, self.is_difference)

    def __get_pydantic_json_schema__(self, schema: object, handler: Handler) -> object:
        """Return the schema of a number, or of text that starts with one (or with a variable)."""
        written = {"type": "string", "pattern": r"^\s*[-+]?[0-9.]|\$\{"}
        unit = f"{self.words}, as a difference" if self.is_difference else self.words
        return {"anyOf": [handler(schema), written], "unit": unit}


@dataclass(frozen=True)
class Difference(InUnit):
    """Marks a difference of two values of a quantity likewise; where the zero of its unit lies does
    not matter.
    """

    is_difference: ClassVar[bool] = True


def always_in(unit: str) -> InUnit:
    """Mark a number in a unit that is always the same."""
    return InUnit(lambda _: unit, unit)


def of_sibling(name: str, mark: type[InUnit] = InUnit) -> InUnit:
    """Mark a number in the unit of the quantity that another key of the section names."""
    return mark(lambda place: place.unit_of(place.siblings.get(name)), f"that of `{name}`")


Seconds = Annotated[float, Gt(0), always_in("s")]
OfKey = Annotated[
    float, InUnit(lambda place: place.unit_of(place.quantity), "that of the quantity")
]
"""In the unit of the quantity that the key above names."""
OfTarget = Annotated[
    float, Difference(lambda place: place.unit_of(place.target), "that of the target")
]
"""An error, a residual or a coefficient: what is added to the target."""
OfHeld = Annotated[float, InUnit(lambda place: place.unit_of(place.level), "that of `levels.of`")]
"""In the unit of the quantity that is constant within a curve."""


Name = Annotated[str, MaxLen(100), Matching(r"^[A-Za-z0-9][A-Za-z0-9._-]*$")]
"""The name of a run, which is a folder's as well."""

Word = Literal["increasing", "decreasing", "convex", "concave", "positive"]
"""What is known of the output along an input; `positive` of the output itself."""

Beyond = Literal["continue", "continue_linear", "saturate", "zero"]
"""What happens beyond a limit (M2 eq 12)."""
