"""Walks the models' annotations along a way through the YAML tree: which types, marks and keys belong to a place."""

from __future__ import annotations

import functools
import types
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel

from mapmore_cli.spec.tree import Loc


@dataclass(frozen=True)
class Kind:
    """One type that a value may have, and the marks (`Annotated[...]`) around it."""

    type: Any
    marks: tuple[Any, ...] = ()

    @property
    def is_section(self) -> bool:
        """True for a model, whose keys are its fields."""
        return isinstance(self.type, type) and issubclass(self.type, BaseModel)


def kinds(annotation: Any, marks: tuple[Any, ...] = ()) -> tuple[Kind, ...]:
    """The members of an annotation, unions taken apart."""
    if get_origin(annotation) is Annotated:
        inner, *around = get_args(annotation)
        return kinds(inner, (*marks, *around))
    if get_origin(annotation) in (Union, types.UnionType):
        return tuple(kind for member in get_args(annotation) for kind in kinds(member, marks))
    return (Kind(annotation, marks),)


def below(kind: Kind, step: str | int) -> tuple[Kind, ...]:
    """What may stand under a key or list index of a value of this kind."""
    if kind.is_section and isinstance(step, str):
        fields, others = _fields(kind.type)
        return kinds(fields[step]) if step in fields else kinds(others) if others is not None else ()
    arguments = get_args(kind.type)
    match get_origin(kind.type):
        case container if container is dict and isinstance(step, str):
            return kinds(arguments[1])
        case container if container is list and isinstance(step, int):
            return kinds(arguments[0])
        case container if container is tuple and isinstance(step, int) and step < len(arguments):
            return kinds(arguments[step])
        case _:
            return ()


def is_free(kind: Kind, key: str) -> bool:
    """True where the user chose the key, as the name of a quantity, and it is no field of a section."""
    if not kind.is_section:
        return get_origin(kind.type) is dict
    fields, others = _fields(kind.type)
    return others is not None and key not in fields


def keys_at(model: type[BaseModel], loc: Loc) -> tuple[str, ...]:
    """The keys that the sections at `loc` know."""
    here: tuple[Kind, ...] = (Kind(model),)
    for step in loc:
        here = tuple(under for kind in here for under in below(kind, step))
    return tuple(dict.fromkeys(_keys(here)))


def _keys(here: tuple[Kind, ...]) -> Iterator[str]:
    for kind in here:
        if kind.is_section:
            yield from _fields(kind.type)[0]


@functools.cache
def _fields(model: type[BaseModel]) -> tuple[dict[str, Any], Any]:
    """Annotations by YAML key, and the annotation of keys that are no field (None where there may be none)."""
    hints = get_type_hints(model, include_extras=True)
    fields = {field.alias or name: hints[name] for name, field in model.model_fields.items()}
    return fields, get_args(hints["__pydantic_extra__"])[1] if model.model_config.get("extra") == "allow" else None
