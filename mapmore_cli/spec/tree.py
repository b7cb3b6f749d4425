"""What was read from YAML, as a tree in which every value knows the place that it comes from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

Loc = Sequence[str | int]
"""The way from the root to a value: keys and list indices."""


@dataclass(frozen=True, eq=False)
class Source:
    """A text that values are read from: a file, or one `--set` of the command line (which has no lines to number)."""

    name: str
    folder: Path  # where relative paths start
    text: str
    numbered: bool = True


@dataclass(frozen=True)
class Position:
    """A place in a source; line and column count from 1."""

    source: Source
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.source.name}:{self.line}:{self.column}" if self.source.numbered else self.source.name


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
        """The value under a key or a list index; None where there is none."""
        if isinstance(self.value, dict):
            return self.value.get(step) if isinstance(step, str) else None
        if isinstance(self.value, list) and isinstance(step, int) and 0 <= step < len(self.value):
            return self.value[step]
        return None


def plain(node: Node) -> Any:
    """The bare value: dicts, lists, scalars."""
    if isinstance(node.value, dict):
        return {key: plain(child) for key, child in node.value.items()}
    if isinstance(node.value, list):
        return [plain(child) for child in node.value]
    return node.value


def nearest(root: Node, loc: Loc) -> Node:
    """The node at `loc`, or its closest ancestor that the sources hold."""
    node = root
    for step in loc:
        below = node.child(step)
        if below is None:
            break
        node = below
    return node


def merged(base: Node, over: Node) -> Node:
    """`over` on top of `base`: mappings merge deeply, other values replace."""
    if not (isinstance(base.value, dict) and isinstance(over.value, dict)):
        return over
    value = dict(base.value)
    for key, child in over.value.items():
        value[key] = merged(value[key], child) if key in value else child
    return replace(over, value=value)


def without(root: Node, loc: Loc) -> Node:
    """The tree without the value at `loc`."""
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
    """A copy of a mapping or list with `child` under `step`."""
    if isinstance(node.value, dict) and isinstance(step, str):
        return replace(node, value={**node.value, step: child})
    if isinstance(node.value, list) and isinstance(step, int):
        return replace(node, value=[child if i == step else other for i, other in enumerate(node.value)])
    raise TypeError(f"{type(node.value).__name__} has no child {step!r}")
