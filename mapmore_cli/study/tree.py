"""What was read from YAML, as a tree in which every value knows the place that it comes from."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mapmore_cli.study.units import is_quantity

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


class Written(str):
    """A text of a spec that knows where it stands: its node, its way from the root, and the mapping
    around it.

    As a text it has no `$${` any more; `node.value` is what was written.
    """

    __slots__ = ("around", "node", "way")
    node: Node
    way: Loc
    around: Mapping[str, Any]

    @property
    def is_quantity(self) -> bool:
        """Whether it is a number with a unit."""
        return is_quantity(self)


def written(node: Node, way: Loc = (), around: Mapping[str, Any] = MappingProxyType({})) -> Any:
    """Return the bare value: dicts, lists, scalars; texts know where they stand."""
    if isinstance(node.value, dict):
        inside: dict[str, Any] = {}
        for key, child in node.value.items():
            inside[key] = written(child, (*way, key), inside)
        return inside
    if isinstance(node.value, list):
        return [written(child, (*way, place), around) for place, child in enumerate(node.value)]
    if isinstance(node.value, str):
        text = Written(node.value.replace("$${", "${"))
        text.node, text.way, text.around = node, way, around
        return text
    return node.value


def quoted(names: Iterable[object], between: str = ", ") -> str:
    """Return names as a list for a message."""
    return between.join(f"`{name}`" for name in names)


def values_at(
    tree: object, place: str, way: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Yield the bare values at a place, as `data.columns.*.unit`, each after its way; `*` is every
    key or item.
    """
    step, _, rest = place.partition(".")
    items = enumerate(tree) if isinstance(tree, list) else ()
    for key, child in tree.items() if isinstance(tree, dict) else items:
        if step in ("*", key):
            yield from values_at(child, rest, (*way, key)) if rest else [((*way, key), child)]


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
    """Return `over` on top of `base`: mappings merge deeply, other values replace, and an empty one
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
    step, *rest = loc
    below = root.child(step)
    if below is None:
        return root
    if rest:
        return with_child(root, step, without(below, rest))
    if isinstance(root.value, dict):
        return replace(root, value={key: one for key, one in root.value.items() if key != step})
    assert isinstance(root.value, list)
    return replace(root, value=[one for place, one in enumerate(root.value) if place != step])


def with_child(node: Node, step: str | int, child: Node) -> Node:
    """Return a copy of a mapping or list with `child` under `step`."""
    if isinstance(node.value, dict):
        return replace(node, value={**node.value, str(step): child})
    assert isinstance(node.value, list)
    return replace(
        node, value=[child if i == step else other for i, other in enumerate(node.value)]
    )
