"""`--set key.path=value`: single values on top of the files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import UsageError
from mapmore_cli.spec.diagnostics import Problem, fail
from mapmore_cli.spec.environment import escaped
from mapmore_cli.spec.tree import Node, Source, with_child
from mapmore_cli.spec.yaml_loader import parse


def apply(root: Node, overrides: Sequence[str], problems: list[Problem]) -> Node:
    """The tree with each `key.path=value` set, in this order; a step of the path that is a number counts the items of a list from 0.

    Values are YAML (`[80, 150]`, `250 kPa`, `null`). A key that no section knows is left to validation, as if it stood in the file.

    Raises
    ------
    UsageError
        An override without `=` or with an empty step.
    SpecError
        A value that is no YAML, or a path that leads into a list or a scalar where it cannot.
    """
    for override in overrides:
        path, equals, text = override.partition("=")
        steps = path.strip().split(".")
        if not equals or not all(steps):
            raise UsageError(f"--set {override}: not of the form key.path=value", "write, for example, `--set fit.max_terms=2`")
        root = _set(root, steps, parse(_source(override, text, root.at.source.folder), problems))
    return root


def as_overrides(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Settings by key path (`{"fit.max_terms": 2}`) as `--set` has them."""
    return tuple(f"{key}={json.dumps(escaped(value), ensure_ascii=False)}" for key, value in settings.items())


def _source(override: str, text: str, folder: Path) -> Source:
    return Source(f"--set {override}", folder, text, numbered=False)


def _set(node: Node, steps: Sequence[str], value: Node) -> Node:
    """`value` at the end of `steps`; mappings on the way are made where there are none."""
    if not steps:
        return replace(value, key_at=value.at)
    if node.value is None:
        node = replace(node, value={}, at=value.at)
    step = _step(node, steps[0], value)
    child = node.child(step) or Node(None, value.at, value.at)
    return with_child(node, step, _set(child, steps[1:], value))


def _step(node: Node, step: str, value: Node) -> str | int:
    """The key or the list index that a step of the path means."""
    if isinstance(node.value, dict):
        return step
    if not isinstance(node.value, list):
        fail(value.at, f"`{step}` leads into a value that has no keys: {node.value!r}", "set the value itself")
    if not (step.isdecimal() and int(step) < len(node.value)):
        fail(value.at, f"there is no item `{step}` in a list of {len(node.value)}", "count the items from 0, or set the whole list")
    return int(step)
