"""What was read from YAML, as a tree in which every value knows the place that it comes from, and
what the models expect at a place.
"""

from __future__ import annotations

import dataclasses
import functools
import types
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel

from mapmore_cli.domain.declared import Settings

Loc = Sequence[str | int]
"""The way from the root to a value: keys and list indices."""


@dataclass(frozen=True)
class SourceText:
    """A text that values are read from: a file, or one `--set` of the command line (which has no
    lines to number).
    """

    name: str
    folder: Path  # where relative paths start
    text: str
    numbered: bool = True


@dataclass(frozen=True)
class Position:
    """A place in a source; line and column count from 1."""

    source: SourceText
    line: int
    column: int

    def __str__(self) -> str:
        return (
            f"{self.source.name}:{self.line}:{self.column}"
            if self.source.numbered
            else self.source.name
        )


@dataclass(frozen=True)
class Node:
    """A value with its place, and the place of its key where it has one."""

    value: dict[str, Node] | list[Node] | str | int | float | bool | None
    at: Position
    key_at: Position | None = None

    @property
    def start(self) -> Position:
        """Place of the key, else of the value."""
        return self.key_at or self.at

    def child(self, step: str | int) -> Node | None:
        """Return the value at a key or a list index, or None."""
        if isinstance(self.value, dict):
            return self.value.get(step) if isinstance(step, str) else None
        if isinstance(self.value, list) and isinstance(step, int) and 0 <= step < len(self.value):
            return self.value[step]
        return None


def plain(node: Node) -> Any:
    """Return the bare value: dicts, lists, scalars."""
    if isinstance(node.value, dict):
        return {key: plain(child) for key, child in node.value.items()}
    if isinstance(node.value, list):
        return [plain(child) for child in node.value]
    return node.value


def nearest(root: Node, loc: Loc) -> Node:
    """Return the node at `loc`, or its closest ancestor that the sources hold."""
    node = root
    for step in loc:
        below = node.child(step)
        if below is None:
            return node
        node = below
    return node


def merged(base: Node, over: Node) -> Node:
    """`over` on top of `base`: mappings merge deeply, other values replace, and an empty one
    (`null`) removes what it stands on.
    """
    if not (isinstance(base.value, dict) and isinstance(over.value, dict)):
        return over
    value = dict(base.value)
    for key, child in over.value.items():
        if key in value and child.value is None:
            del value[key]
        else:
            value[key] = merged(value[key], child) if key in value else child
    return replace(over, value=value)


def without(root: Node, loc: Loc) -> Node:
    """Return the tree without the value at `loc`."""
    *way, last = loc
    if way:
        below = root.child(way[0])
        return root if below is None else with_child(root, way[0], without(below, loc[1:]))
    if isinstance(root.value, dict):
        return replace(root, value={key: child for key, child in root.value.items() if key != last})
    if isinstance(root.value, list):
        return replace(root, value=[child for i, child in enumerate(root.value) if i != last])
    return root


def with_child(node: Node, step: str | int, child: Node) -> Node:
    """Return a copy of a mapping or list with `child` under `step`."""
    if isinstance(node.value, dict):
        return replace(node, value={**node.value, str(step): child})
    assert isinstance(node.value, list)
    return replace(
        node, value=[child if i == step else other for i, other in enumerate(node.value)]
    )


# What the models expect at a place
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kind:
    """One type that a value may have, and the marks (`...`) around it."""

    type: Any
    marks: tuple[Any, ...] = ()

    @property
    def is_section(self) -> bool:
        """True for settings, whose keys are their fields."""
        return isinstance(self.type, type) and issubclass(self.type, BaseModel | Settings)


def kinds(annotation: Any, marks: tuple[Any, ...] = ()) -> tuple[Kind, ...]:
    """Return the members of an annotation, unions taken apart."""
    if get_origin(annotation) is Annotated:
        inner, *around = get_args(annotation)
        return kinds(inner, (*marks, *around))
    if get_origin(annotation) in (Union, types.UnionType):
        return tuple(kind for member in get_args(annotation) for kind in kinds(member, marks))
    return (Kind(annotation, marks),)


def below(kind: Kind, step: str | int) -> tuple[Kind, ...]:
    """Return what may stand under a key or list index of a value of this kind."""
    if kind.is_section and isinstance(step, str):
        fields, others = fields_of(kind.type)
        return (
            kinds(fields[step]) if step in fields else kinds(others) if others is not None else ()
        )
    arguments, container = get_args(kind.type), get_origin(kind.type)
    if container is dict and isinstance(step, str):
        return kinds(arguments[1])
    if container in (list, Sequence) and isinstance(step, int):
        return kinds(arguments[0])
    if container is tuple and isinstance(step, int) and step < len(arguments):
        return kinds(arguments[step])
    return ()


def is_free(kind: Kind, key: str) -> bool:
    """Return True where the user chose the key, as the name of a quantity, and it is no field of a
    section.
    """
    if not kind.is_section:
        return get_origin(kind.type) is dict
    fields, others = fields_of(kind.type)
    return others is not None and key not in fields


def keys_at(model: type[BaseModel], loc: Loc) -> tuple[str, ...]:
    """Return the keys that the sections at `loc` know."""
    here: tuple[Kind, ...] = (Kind(model),)
    for step in loc:
        here = tuple(under for kind in here for under in below(kind, step))
    return tuple(
        dict.fromkeys(key for kind in here if kind.is_section for key in fields_of(kind.type)[0])
    )


@functools.cache
def fields_of(model: type[BaseModel | Settings]) -> tuple[dict[str, Any], Any]:
    """Return annotations by YAML key, and the annotation of keys that are no field (None where
    there may be none).
    """
    hints = get_type_hints(model, include_extras=True)
    if issubclass(model, Settings):
        return {field.name: hints[field.name] for field in dataclasses.fields(model)}, None
    fields = {field.alias or name: hints[name] for name, field in model.model_fields.items()}
    return fields, get_args(hints["__pydantic_extra__"])[1] if model.model_config.get(
        "extra"
    ) == "allow" else None
