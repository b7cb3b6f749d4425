"""How a dataclass is stored, as far as nothing else is said: the form of a field follows from its type.

A setting that is added to a stored class, and a kind that is added, need no line in this folder. The first text in the `Annotated` of a
field is its description, the second its unit (without one 1 for numbers, - for all else). A default is what files without the field are
read as.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass, replace
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from annotated_types import Interval

from mapmore_cli.domain.arrays import Array
from mapmore_cli.modelling.expressions import ExpressionError, parse
from mapmore_cli.storage.artefacts.codecs import (
    Codec,
    adapted,
    added,
    named,
    number,
    numbered,
    numbers,
    optional,
    pairs,
    shown,
    text,
    texts,
)
from mapmore_cli.storage.artefacts.integrity import Invalid
from mapmore_cli.storage.artefacts.label import NO_UNIT
from mapmore_cli.storage.artefacts.schema import Fault, Field, Schema, nested

TEXT, REAL, COUNT = text(), number(float), number(int, least=0)
NAME = text(pattern=r"[A-Za-z_][A-Za-z0-9_]*")
ANY_REAL = number(float, may_be_nan=True)
SHARE = number(float, least=0, most=1)
OPTIONAL_TEXT = optional(TEXT)
TEXTS = texts()
REALS, ANY_REALS, ANY_TABLE, TABLE = (
    numbers("<f8"),
    numbers("<f8", may_be_nan=True),
    numbers("<f8", ndim=2, may_be_nan=True),
    numbers("<f8", ndim=2),
)
ASCENDING = numbers("<f8", ascending=True)
INDICES = numbers("<i8", least=0)
FLAGS = numbers("|u1", load_dtype="bool")  # not HDF5's enumeration, which MATLAB reads as text
FLAG = adapted(COUNT, store=int, load=bool)
CELL = adapted(numbers("<i8", least=1), store=list, load=lambda array: tuple(array.tolist()))


def _is_pair(pair: tuple[float, ...], where: str) -> None:
    if len(pair) != 2:
        raise Invalid(where, f"has {len(pair)} values, where two belong")


def _is_span(span: tuple[float, ...], where: str) -> None:
    if len(span) != 2 or span[0] > span[1]:
        raise Invalid(where, "is not a least and a greatest value")


def _are_cuts(boundaries: Array, where: str) -> None:
    if len(boundaries) != 2 or boundaries[0] > boundaries[1]:  # a curve that was measured at one place has one segment, from there to there
        ASCENDING.check(boundaries, where, {})


SPAN = adapted(REALS, store=list, load=lambda array: tuple(array.tolist()), check=_is_span)
PAIR = adapted(REALS, store=list, load=lambda array: tuple(array.tolist()), check=_is_pair)
CUTS = adapted(REALS, store=np.asarray, load=np.asarray, check=_are_cuts)
LIMITS = named(SPAN)


def expression_faults(field: str, expressions: Iterable[str], known: Iterable[str]) -> Iterator[Fault]:
    """Yield what is wrong with texts that are to be expressions of `known` names."""
    names = frozenset(known)
    for expression in expressions:
        try:
            strange = sorted(parse(expression).names - names)
        except ExpressionError as error:
            yield field, f"has {shown(expression)}, which is no term: {error}"
        else:
            if strange:
                yield field, f"has {shown(expression)}, but nothing is known of {shown(strange[0])}"


LAYOUTS: dict[type, Schema] = {}
"""The layout of each stored type that has one of its own."""

PLAIN: Mapping[Any, Codec] = {
    str: TEXT,
    float: REAL,
    int: COUNT,
    bool: FLAG,
    tuple[str, ...]: TEXTS,
    tuple[float, float]: PAIR,
    Mapping[str, tuple[float, float]]: LIMITS,
}
ARRAYS: Mapping[Any, Codec] = {np.float64: ANY_REALS, np.int64: INDICES, np.bool_: FLAGS}


def completed(schema: Schema, codecs: Mapping[str, Codec] = {}) -> Schema:
    """Return a layout with the fields that it does not list, each by its own of `codecs` or by its type; from now on that of its type."""
    hints, listed = get_type_hints(schema.type, include_extras=True), {field.name for field in schema.fields}
    rest = [
        _field(field, hints[field.name], codecs.get(field.name))
        for field in fields(schema.type)
        if field.name not in listed and field.metadata.get("stored", True)
    ]
    LAYOUTS[schema.type] = replace(schema, fields=(*schema.fields, *rest))
    return LAYOUTS[schema.type]


def stored(type_: type, codecs: Mapping[str, Codec] = {}, derived: tuple[Field, ...] = (), **more: Any) -> Schema:
    """Return the layout of a dataclass by its fields, whose form may be one of `codecs`; `more` are `units` and `rule` of the `Schema`."""
    assert type_ not in LAYOUTS, f"{type_.__name__} was laid out before"
    laid = completed(Schema(type_, str(type_.__doc__).partition("\n")[0], (), **more), codecs)
    LAYOUTS[type_] = replace(laid, fields=(*laid.fields, *derived))
    return LAYOUTS[type_]


def schema_of(type_: type) -> Schema:
    """Return the layout of a dataclass: its own, or that of its fields by their types."""
    return LAYOUTS.get(type_) or stored(type_)


def _field(declared: Any, hint: Any, given: Codec | None) -> Field:
    """Return a field whose form is `given` or follows from its type; files that lack it are read as if it had its default."""
    codec = given or codec_of(hint)
    default = declared.default_factory() if declared.default_factory is not MISSING else declared.default
    if given is None and default is not MISSING and default is not None:
        codec = added(codec, default)
    texts = [mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, str)]
    unit = "1" if codec.form.startswith(("float", "int")) else NO_UNIT
    description = texts[0] if texts else declared.name.replace("_", " ")
    return Field(declared.name, codec, description, texts[1] if texts[1:] else unit)


def codec_of(hint: Any) -> Codec:
    """Return the form of the values of a type; raises TypeError for one that has none."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint in PLAIN:
        return PLAIN[hint]
    if origin is Annotated:
        bounds = next((mark for mark in arguments[1:] if isinstance(mark, Interval)), None)
        least, most = (bounds.ge, bounds.le) if bounds is not None and arguments[0] in (int, float) else (None, None)
        return codec_of(arguments[0]) if bounds is None else number(arguments[0], least=least, most=most)  # type: ignore[arg-type]
    if origin is Literal:
        return text(words=arguments)
    if origin in (Union, types.UnionType) and len(arguments) == 2 and arguments[1] is type(None):
        return optional(codec_of(arguments[0]))
    if origin is np.ndarray:
        return ARRAYS[get_args(arguments[1])[0]]
    if origin is tuple and arguments[1:] == (...,):
        return REALS if arguments[0] is float else numbered(codec_of(arguments[0]))
    if origin in (dict, Mapping, types.MappingProxyType) and arguments[1] in (float, str, int):
        return pairs({float: REALS, str: TEXTS, int: INDICES}[arguments[1]])
    if origin in (dict, Mapping):
        return named(codec_of(arguments[1]))
    if is_dataclass(hint):
        return nested(hint, lambda: schema_of(hint))  # type: ignore[arg-type]  # a layout of its own may follow
    raise TypeError(f"values of {hint} cannot be stored")
