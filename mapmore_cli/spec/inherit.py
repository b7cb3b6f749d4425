"""`extends: other.yaml`: a spec on top of another, which may extend a third."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.diagnostics import Problem, fail
from mapmore_cli.spec.tree import Node, merged
from mapmore_cli.spec.yaml_loader import parse, read_source


def read(path: Path, problems: list[Problem]) -> Node:
    """The tree of a spec with everything that it inherits; each value keeps the place in the file that it comes from.

    Raises
    ------
    SpecError
        A file that cannot be read or is no mapping, or files that extend each other in a circle.
    """
    return _read(path, problems, ())


def _read(path: Path, problems: list[Problem], heirs: tuple[Path, ...]) -> Node:
    source = read_source(path)
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


def _base(reference: Node, path: Path, problems: list[Problem], heirs: tuple[Path, ...]) -> Node:
    if not isinstance(reference.value, str):
        fail(reference.at, "`extends` names no file", "write `extends: other.yaml`")
    base = Path(os.path.normpath(path.parent / reference.value))
    chain = (*heirs, path.resolve())
    if base.resolve() in chain:
        circle = " -> ".join([heir.name for heir in chain] + [base.name])
        fail(reference.at, f"the files extend each other in a circle: {circle}", "remove one `extends`")
    if not base.is_file():
        fail(reference.at, f"there is no file {base}", "paths start at the folder of the file that they are written in")
    return _read(base, problems, chain)
