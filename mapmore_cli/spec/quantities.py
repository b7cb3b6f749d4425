"""Turns what was written into what the models hold: numbers in the model's units, paths from the spec's folder."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from mapmore_cli.domain.declared import InUnit
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.diagnostics import Mistake
from mapmore_cli.spec.fields import RelativePath, SettingsOf, Surroundings
from mapmore_cli.spec.tree import Kind, Node, below, is_free, plain
from mapmore_cli.spec.units import default_unit, is_quantity, parse_quantity, split_quantity
from mapmore_cli.spec.yaml_core import VARIABLES, expand, unescaped


def resolve(root: Node, model: type[BaseModel], problems: list[Mistake]) -> Node:
    """The tree with every `250 kPa` replaced by a number, and every inherited relative path by one from the root's folder.

    A wrong unit is added to `problems`; the number is then NaN, which validation refuses at the same place.
    """
    return _Resolver(root.at.source.folder, problems).node(root, [Kind(model)], _surroundings(plain(root)))


@dataclass(frozen=True)
class _Resolver:
    folder: Path
    problems: list[Mistake]

    def node(self, node: Node, kinds: Sequence[Kind], around: Surroundings) -> Node:
        """The same node, resolved, given what it may be."""
        match node.value:
            case dict() as children:
                inside = replace(around, siblings=plain(node))
                return replace(node, value={key: self._under(key, child, kinds, inside) for key, child in children.items()})
            case list() as items:
                return replace(node, value=[self._under(index, item, kinds, around) for index, item in enumerate(items)])
            case str() as text:
                return replace(node, value=self._text(node, text, [mark for kind in kinds for mark in kind.marks], around))
            case _:
                return node

    def _under(self, step: str | int, child: Node, kinds: Sequence[Kind], around: Surroundings) -> Node:
        if _settings(kinds) is not None:  # their quantities are resolved with the spec that they set
            return self._moved(child, _under(kinds, step))
        if isinstance(step, str) and any(is_free(kind, step) for kind in kinds):
            around = replace(around, key=step)
        return self.node(child, [found for kind in kinds for found in below(kind, step)], around)

    def _moved(self, node: Node, kinds: Sequence[Kind]) -> Node:
        """The same node with nothing resolved but its relative paths."""
        match node.value:
            case dict() as children:
                return replace(node, value={key: self._moved(child, _under(kinds, key)) for key, child in children.items()})
            case list() as items:
                return replace(node, value=[self._moved(item, _under(kinds, place)) for place, item in enumerate(items)])
            case str() as text:
                return replace(node, value=self._expanded(node, text, _marks_of_path(kinds)))
            case _:
                return node

    def _expanded(self, node: Node, text: str, marks_of_path: Sequence[Any]) -> str:
        """Return a path with its variables expanded, from the root's folder; any other text as it is."""
        try:
            if not marks_of_path:
                return unescaped(text)
            return _from_folder(expand(text), marks_of_path, node.at.source.folder, self.folder)
        except ValueError as error:
            self.problems.append(Mistake(node.at, str(error), VARIABLES))
            return text

    def _text(self, node: Node, text: str, marks: Sequence[Any], around: Surroundings) -> str | float:
        path = [mark for mark in marks if isinstance(mark, RelativePath)]
        text = self._expanded(node, text, path)
        if path:
            return text
        rule = next((mark for mark in marks if isinstance(mark, InUnit)), None)
        if rule is None or not is_quantity(text):
            return text
        unit = rule.unit(around)
        try:
            # Where no unit is known, another key is wrong, and is reported as such.
            return split_quantity(text)[0] if unit is None else parse_quantity(text, unit)
        except SpecError as error:
            self.problems.append(Mistake(node.at, error.message, error.remedy))
            return math.nan


def moved(document: Any, kinds: Sequence[Kind], folder: Path, to: Path) -> Any:
    """The values of a spec in `folder`, for a file in the folder `to`: relative paths start there."""
    match document:
        case dict():
            return {key: moved(value, _under(kinds, key), folder, to) for key, value in document.items()}
        case list():
            return [moved(value, _under(kinds, place), folder, to) for place, value in enumerate(document)]
        case str() if marks := _marks_of_path(kinds):
            return _from_folder(document, marks, folder, to)
        case _:
            return document


def _under(kinds: Sequence[Kind], step: str | int) -> list[Kind]:
    """What may stand under a key or list index; keys of settings, as `data.files`, lead from the root of a spec."""
    settings = _settings(kinds)
    if settings is None:
        return [found for kind in kinds for found in below(kind, step)]
    here = [Kind(settings.model())]
    for name in str(step).split("."):
        here = _under(here, int(name) if name.isdecimal() else name)
    return here


def _settings(kinds: Sequence[Kind]) -> SettingsOf | None:
    return next((mark for kind in kinds for mark in kind.marks if isinstance(mark, SettingsOf)), None)


def _marks_of_path(kinds: Sequence[Kind]) -> list[Any]:
    """The marks of what may be a relative path; none for other kinds."""
    marks = [mark for kind in kinds for mark in kind.marks]
    return marks if any(isinstance(mark, RelativePath) for mark in marks) else []


def _from_folder(path: str, marks: Sequence[Any], written_in: Path, folder: Path) -> str:
    bare = any(isinstance(mark, RelativePath) and mark.bare for mark in marks)
    if written_in == folder or Path(path).is_absolute() or (bare and "/" not in path):
        return path
    return Path(os.path.relpath(written_in / path, folder)).as_posix()


def _surroundings(root: Any) -> Surroundings:
    """What the root says about units and target, as far as it is well-formed."""
    units = {name: unit for name, unit in _mapping(root, "units").items() if isinstance(unit, str)}
    column = _mapping(root, "target").get("column")
    derived = {name: _mapping(rule).get("rate_of") for name, rule in _mapping(root, "data", "derive").items()}
    rates = {name: of for name, of in derived.items() if isinstance(of, str)}
    level = _mapping(root, "data", "levels").get("of")
    return Surroundings(
        units={**{name: default_unit(name, units, rates) for name in rates}, **units},
        target=column if isinstance(column, str) else "force",
        level=level if isinstance(level, str) else None,
    )


def _mapping(value: Any, *keys: str) -> dict[str, Any]:
    """The mapping under `keys`; empty where there is none."""
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}
