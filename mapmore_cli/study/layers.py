"""Merge the layers of a spec: the file that it extends, the file itself, and each `--set
key.path=value`. Also read the files in `formulas`, and add the units of columns to `units`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from mapmore_cli.domain.errors import SpecError, UsageError
from mapmore_cli.study.diagnostics import Mistake, fail
from mapmore_cli.study.fields import possible_path
from mapmore_cli.study.tree import (
    Node,
    SourceText,
    merged,
    nearest,
    values_at,
    with_child,
    without,
    written,
)
from mapmore_cli.study.units import default_unit, is_kept
from mapmore_cli.study.variables import expand
from mapmore_cli.study.yaml_loader import parse, read_source

DEEPEST = 20
"""Largest number of `extends` in a chain of files."""


def extended(
    source: SourceText, path: Path, problems: list[Mistake], heirs: tuple[Path, ...] = ()
) -> Node:
    """Return the tree of a spec file, merged with the files that it extends. `path` is the path of
    the file. `heirs` are the files that extend it, directly or through other files.
    """
    root = parse(source, problems)
    if root.value is None:
        raise SpecError(
            f"{source.name}: the file is empty",
            "write a spec: it needs at least `name`, `data` and `target`",
        )
    if not isinstance(root.value, dict):
        fail(
            root.at,
            "the top level of a spec must be a mapping",
            "write `key: value` lines, for example `name: my-study`",
        )
    document = without(root, ["extends"])
    reference = root.child("extends")
    if reference is None:
        return document
    if not isinstance(reference.value, str):
        fail(reference.at, "`extends` does not name a file", "write `extends: other.yaml`")
    if len(heirs) >= DEEPEST:
        fail(
            reference.at,
            f"more than {DEEPEST} files extend each other",
            "let this file extend the first file of the chain directly",
        )
    base = _file_at(reference, expand, path.parent, "write `extends: other.yaml`")
    chain = (*heirs, path.resolve())
    if base.resolve() in chain:
        circle = " -> ".join([heir.name for heir in chain] + [base.name])
        fail(
            reference.at,
            f"the files extend each other in a circle: {circle}",
            "remove one `extends`",
        )
    return merged(extended(read_source(base), base, problems, chain), document)


def _file_at(node: Node, spelt: Callable[[str], str], folder: Path, remedy: str) -> Path:
    try:
        path = Path(os.path.normpath(folder / possible_path(spelt(str(node.value)))))
    except ValueError as error:
        fail(node.at, str(error), remedy)
    if not path.is_file():
        fail(
            node.at,
            f"there is no file {path}",
            "paths are relative to the folder of the file in which they are written",
        )
    return path


def with_formulas(root: Node, problems: list[Mistake]) -> Node:
    """Return the tree in which each path in `formulas` is replaced by the contents of its file. The
    value of `formulas` may also be a single path or formula instead of a list.
    """
    listed = root.child("formulas")
    if listed is None:
        return root
    read = []
    for entry in listed.value if isinstance(listed.value, list) else [listed]:
        formula = entry
        if isinstance(entry.value, str):
            path = _file_at(
                entry, str, entry.at.source.folder, "write `formulas: [my_formula.yaml]`"
            )
            formula = parse(read_source(path), problems)
        read.append(formula)
    return with_child(root, "formulas", replace(listed, value=read))


def with_units(root: Node) -> Node:
    """Return the tree with further entries in `units`. If a quantity has no default unit and no
    entry in `units`, its unit is the unit of its column.

    This does not apply to a column in per cent: the values of its quantity are fractions, without a
    unit.
    """
    units = root.child("units") or Node({}, root.at)
    if not isinstance(units.value, dict):
        return root
    entries = dict(units.value)
    for place in ("data.columns.*.unit", "data.join.*.columns.*.unit"):
        for way, unit in values_at(written(root), place):
            name = str(way[-2])
            if name not in entries and default_unit(name) == "1" and is_kept(str(unit)):
                entries[name] = nearest(root, way)
    return with_child(root, "units", replace(units, value=entries)) if entries else root


# Overrides
# --------------------------------------------------------------------------------------------------


def with_overrides(root: Node, overrides: Sequence[str], problems: list[Mistake]) -> Node:
    """Return the tree after each override `key.path=value` was applied, one after the other. A
    number in the path is the index of a list item, from 0. The value `null` removes the key.
    """
    for override in overrides:
        path, equals, text = override.partition("=")
        steps = path.strip().split(".")
        if not equals or not all(steps):
            raise UsageError(
                f"--set {override}: not of the form KEY=VALUE",
                "write, for example, `--set fit.max_terms=2`",
            )
        source = SourceText(f"--set {override}", root.at.source.folder, text, numbered=False)
        root = _set(root, steps, parse(source, problems))
    return root


def _set(node: Node, steps: Sequence[str], value: Node) -> Node:
    """Return the tree in which the value at the path `steps` is replaced. If a mapping on this path
    does not exist, it is created.
    """
    if not steps:
        return replace(value, key_at=value.at)
    if len(steps) == 1 and value.value is None and isinstance(node.value, dict):
        return without(node, steps)
    if node.value is None:
        node = replace(node, value={}, at=value.at)
    step: str | int = steps[0]
    if not isinstance(node.value, dict):
        if not isinstance(node.value, list):
            fail(
                value.at,
                f"`{step}` does not exist: {node.value!r} is a plain value, without keys",
                "set that value itself",
            )
        if not (steps[0].isdecimal() and int(step) < len(node.value)):
            fail(
                value.at,
                f"there is no item `{step}` in a list of {len(node.value)} items",
                "count the items from 0, or set the whole list",
            )
        step = int(step)
    child = node.child(step) or Node(None, value.at, value.at)
    return with_child(node, step, _set(child, steps[1:], value))
