"""Represent YAML as a tree in which every value knows its place in the source."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mapmore_cli.study.units import is_quantity

Loc = Sequence[str | int]
"""Path from the root to a value: keys and list indices."""


@dataclass(frozen=True)
class SourceText:
    """A text from which values are read: a file, or one `--set` option, which has no line
    numbers.
    """

    name: str
    folder: Path  # folder at which relative paths in the text start
    text: str
    numbered: bool = True


@dataclass(frozen=True)
class Position:
    """A position in a source. Line and column count from 1."""

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
    """A value with its position in the source. If the value belongs to a key, the position of the
    key is also given.
    """

    value: dict[str, Node] | list[Node] | str | int | float | bool | None
    at: Position
    key_at: Position | None = None

    @property
    def start(self) -> Position:
        """Position of the key, or of the value if there is no key."""
        return self.key_at or self.at

    def child(self, step: str | int) -> Node | None:
        """Return the value at a key or a list index, or None."""
        if isinstance(self.value, dict):
            return self.value.get(step) if isinstance(step, str) else None
        if isinstance(self.value, list) and isinstance(step, int) and 0 <= step < len(self.value):
            return self.value[step]
        return None


class Written(str):
    """A text of a spec that knows its place: its node, its path from the root, and the mapping
    around it.

    In the text, `$${` is already replaced by `${`; `node.value` is the original.
    """

    __slots__ = ("around", "node", "way")
    node: Node
    way: Loc
    around: Mapping[str, Any]

    @property
    def is_quantity(self) -> bool:
        """Return True if the text is a number with a unit."""
        return is_quantity(self)


def written(node: Node, way: Loc = (), around: Mapping[str, Any] = MappingProxyType({})) -> Any:
    """Return the plain value of a node: dicts, lists and scalars. Texts keep their place (see
    `Written`).
    """
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
    """Return names as a list for a message, each in backticks."""
    return between.join(f"`{name}`" for name in names)


def values_at(
    tree: object, place: str, way: tuple[str | int, ...] = ()
) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Yield the plain values at a place such as `data.columns.*.unit`, each with its path. `*`
    stands for every key or item.
    """
    step, _, rest = place.partition(".")
    items = enumerate(tree) if isinstance(tree, list) else ()
    for key, child in tree.items() if isinstance(tree, dict) else items:
        if step in ("*", key):
            yield from values_at(child, rest, (*way, key)) if rest else [((*way, key), child)]


def nearest(root: Node, loc: Loc) -> Node:
    """Return the node at `loc`, or its nearest ancestor in the tree."""
    node = root
    for step in loc:
        below = node.child(step)
        if below is None:
            return node
        node = below
    return node


def merged(base: Node, over: Node) -> Node:
    """Return `over` on top of `base`. Mappings are merged at all depths. Any other value in `over`
    replaces the value in `base`, and an empty value (`null`) removes it.
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
        return replace(root, value={key: child for key, child in root.value.items() if key != step})
    assert isinstance(root.value, list)
    return replace(root, value=[child for place, child in enumerate(root.value) if place != step])


def renamed(root: Node, loc: Loc, key: str | int) -> Node:
    """Return the tree in which the value at `loc` has another key, in the same mapping. If the
    mapping has this key already, the value is removed.
    """
    step, *rest = loc
    below = root.child(step)
    if below is None:
        return root
    if rest:
        return with_child(root, step, renamed(below, rest, key))
    others = without(root, loc)
    return others if others.child(key) else with_child(others, key, below)


def with_child(node: Node, step: str | int, child: Node) -> Node:
    """Return a copy of a mapping or list with `child` under `step`."""
    if isinstance(node.value, dict):
        return replace(node, value={**node.value, str(step): child})
    assert isinstance(node.value, list)
    return replace(
        node, value=[child if i == step else other for i, other in enumerate(node.value)]
    )
