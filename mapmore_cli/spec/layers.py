"""A spec in layers: the file that it `extends`, the file itself, and each `--set key.path=value` on top."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.spec.diagnostics import Mistake, fail
from mapmore_cli.spec.fields import possible_path
from mapmore_cli.spec.tree import Node, SourceText, merged, with_child, without
from mapmore_cli.spec.units import default_unit, has_dimension
from mapmore_cli.spec.yaml_loader import escaped, expand, parse, read_source

DEEPEST = 20
"""Files that may extend each other, one the next."""


def read(path: Path, problems: list[Mistake]) -> Node:
    """Return the tree of a spec with everything that it inherits; each value keeps the place in the file that it comes from.

    Raises SpecError for a file that cannot be read or is no mapping, or files that extend each other in a circle.
    """
    return _read(path, problems, ())


def read_text(text: str, name: str, folder: Path, problems: list[Mistake]) -> Node:
    """Return the tree of a spec that no file holds: messages call it `name`, relative paths start at `folder`. Raises as `read`."""
    return _extended(SourceText(name, folder, text, numbered=False), folder / name, problems, ())


def _read(path: Path, problems: list[Mistake], heirs: tuple[Path, ...]) -> Node:
    return _extended(read_source(path), path, problems, heirs)


def _extended(source: SourceText, path: Path, problems: list[Mistake], heirs: tuple[Path, ...]) -> Node:
    """Return the tree of a text with what it inherits; `path` is where it lies."""
    root = parse(source, problems)
    if root.value is None:
        raise SpecError(f"{source.name}: the file is empty", "a spec needs at least `name`, `data`, `target` and `dictionary`")
    if not isinstance(root.value, dict):
        fail(root.at, "the top level is no mapping", "write `key: value` lines, as `name: my-study`")
    children = dict(root.value)
    reference = children.pop("extends", None)
    own = replace(root, value=children)
    if reference is None:
        return own
    return merged(_base(reference, path, problems, heirs), own)


def _base(reference: Node, path: Path, problems: list[Mistake], heirs: tuple[Path, ...]) -> Node:
    if not isinstance(reference.value, str):
        fail(reference.at, "`extends` names no file", "write `extends: other.yaml`")
    if len(heirs) >= DEEPEST:
        fail(reference.at, f"more than {DEEPEST} files extend each other", "extend the file at their beginning itself")
    try:
        base = Path(os.path.normpath(path.parent / possible_path(expand(reference.value))))
    except ValueError as error:
        fail(reference.at, str(error), "write `extends: other.yaml`")
    chain = (*heirs, path.resolve())
    if base.resolve() in chain:
        circle = " -> ".join([heir.name for heir in chain] + [base.name])
        fail(reference.at, f"the files extend each other in a circle: {circle}", "remove one `extends`")
    if not base.is_file():
        fail(reference.at, f"there is no file {base}", "paths start at the folder of the file that they are written in")
    return _read(base, problems, chain)


def with_formulas(root: Node, problems: list[Mistake]) -> Node:
    """Return the tree with the files of `formulas` read, each in the place of its path; a single one may stand without a list.

    Raises SpecError for a file that cannot be read, or is no YAML.
    """
    listed = root.child("formulas")
    if listed is None:
        return root
    entries = listed.value if isinstance(listed.value, list) else [listed]
    return with_child(root, "formulas", replace(listed, value=[_formula(entry, problems) for entry in entries]))


def _formula(entry: Node, problems: list[Mistake]) -> Node:
    """Return the file of a formula, where the entry is its path."""
    if not isinstance(entry.value, str):
        return entry
    try:
        path = entry.at.source.folder / possible_path(entry.value)
    except ValueError as error:
        fail(entry.at, str(error), "write `formulas: [my_formula.yaml]`")
    if not path.is_file():
        fail(entry.at, f"there is no file {path}", "paths start at the folder of the file that they are written in")
    return parse(read_source(path), problems)


def with_units(root: Node) -> Node:
    """Return the tree whose `units` name the unit of every column that has no canonical name: a model is in the unit of its column.

    Per cent and angles are plain numbers where `units` does not name them.
    """
    units = root.child("units") or Node({}, root.at)
    data = root.child("data")
    if data is None or not isinstance(units.value, dict):
        return root
    joined = data.child("join")
    tables = (data, *(joined.value if joined is not None and isinstance(joined.value, list) else ()))
    found = dict(units.value)
    for columns in (table.child("columns") for table in tables):
        for name, column in columns.value.items() if columns is not None and isinstance(columns.value, dict) else ():
            unit = column.child("unit")
            if name not in found and default_unit(name) == "1" and unit is not None and has_dimension(str(unit.value)):
                found[name] = unit
    return with_child(root, "units", replace(units, value=found)) if len(found) > len(units.value) else root


def apply(root: Node, overrides: Sequence[str], problems: list[Mistake]) -> Node:
    """Return the tree with each `key.path=value` set, in this order; a step of the path that is a number counts the items of a list from 0.

    Values are YAML (`[80, 150]`, `250 kPa`); `null` removes the key. One that no section knows is left to validation, as if it stood in
    the file.

    Raises UsageError for an override without `=` or with an empty step; SpecError for a value that is no YAML, or a path that leads into a
    list or a scalar where it cannot.
    """
    for override in overrides:
        path, equals, text = override.partition("=")
        steps = path.strip().split(".")
        if not equals or not all(steps):
            raise UsageError(f"--set {override}: not of the form key.path=value", "write, for example, `--set fit.max_terms=2`")
        root = _set(root, steps, parse(_source(override, text, root.at.source.folder), problems))
    return root


def as_overrides(settings: Mapping[str, Any]) -> tuple[str, ...]:
    """Return settings by key path (`{"fit.max_terms": 2}`) as `--set` has them."""
    return tuple(f"{key}={json.dumps(escaped(value), ensure_ascii=False)}" for key, value in settings.items())


def _source(override: str, text: str, folder: Path) -> SourceText:
    return SourceText(f"--set {override}", folder, text, numbered=False)


def _set(node: Node, steps: Sequence[str], value: Node) -> Node:
    """`value` at the end of `steps`; mappings on the way are made where there are none."""
    if not steps:
        return replace(value, key_at=value.at)
    if len(steps) == 1 and value.value is None and isinstance(node.value, dict):
        return without(node, steps)
    if node.value is None:
        node = replace(node, value={}, at=value.at)
    step = _step(node, steps[0], value)
    child = node.child(step) or Node(None, value.at, value.at)
    return with_child(node, step, _set(child, steps[1:], value))


def _step(node: Node, step: str, value: Node) -> str | int:
    """Return the key or the list index that a step of the path means."""
    if isinstance(node.value, dict):
        return step
    if not isinstance(node.value, list):
        fail(value.at, f"`{step}` leads into a value that has no keys: {node.value!r}", "set the value itself")
    if not (step.isdecimal() and int(step) < len(node.value)):
        fail(value.at, f"there is no item `{step}` in a list of {len(node.value)}", "count the items from 0, or set the whole list")
    return int(step)
