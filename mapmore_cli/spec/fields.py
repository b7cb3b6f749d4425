"""What the spec's models are made of: the strict base, numbers that may carry a unit, unions told
apart by the shape of the YAML value.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from mapmore_cli.domain.declared import InUnit
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.spec.diagnostics import Mistake
from mapmore_cli.spec.tree import Kind, Node, below, is_free, plain
from mapmore_cli.spec.units import default_unit, is_quantity, parse_quantity, split_quantity
from mapmore_cli.spec.yaml_loader import VARIABLES, expand, unescaped

M = TypeVar("M")


class Section(BaseModel):
    """Base of every part of a spec: strict, closed and immutable."""

    model_config = ConfigDict(
        extra="forbid", strict=True, allow_inf_nan=False, frozen=True, populate_by_name=True
    )

    def _contradictions(self) -> Iterator[ValueError]:
        """Yield what does not fit each other within the section; the first is told."""
        yield from ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for contradiction in self._contradictions():
            raise contradiction
        return self


PARTIAL = {"partial": True}
"""Context of the validation of what is left of a spec without its faulty parts: what is required
may be among them.
"""


# Numbers with units
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Surroundings:
    """What the unit of a number can depend on."""

    units: Mapping[str, str]  # the spec's `units:`
    target: str  # the quantity that is modelled
    level: str | None = None  # the quantity that is constant within a curve
    key: str = ""  # the nearest key that the user chose, as `pressure` in `set: {pressure: 2 bar}`
    siblings: Mapping[str, Any] = field(
        default_factory=dict
    )  # the section that the number stands in

    def unit_of(self, quantity: object) -> str | None:
        """Return the model's unit of a quantity; None where the spec does not name one."""
        return default_unit(quantity, self.units) if isinstance(quantity, str) else None


def _column_unit(around: Surroundings) -> str | None:
    unit = around.siblings.get("unit")
    return unit if isinstance(unit, str) else around.unit_of(around.key)


OF_TARGET = ("rmse", "normaliser", "max_abs_error")
"""Metrics in the unit of the target."""

Metres = Annotated[float, Field(gt=0), InUnit(lambda _: "m")]
SignedSeconds = Annotated[float, InUnit(lambda _: "s")]
OfTarget = Annotated[float, InUnit(lambda around: around.unit_of(around.target))]
InColumnUnit = Annotated[float, InUnit(_column_unit)]
Metric = Annotated[
    float, InUnit(lambda around: around.unit_of(around.target) if around.key in OF_TARGET else "1")
]
Share = Annotated[float, InUnit(lambda _: "1")]

Quantity = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100)]
"""The name of a quantity, as expressions spell it."""


# Paths and settings
# --------------------------------------------------------------------------------------------------

LONGEST_NAME, LONGEST_PATH = 255, 4000


@dataclass(frozen=True)
class RelativePath:
    """Marks a path that starts at the folder of the file that it is written in; `bare` names
    without a folder stay as they are.
    """

    bare: bool = False


@dataclass(frozen=True)
class SettingsOfSpec:
    """Marks a mapping with keys of a whole spec, as `data.files`; `spec` names its model, which may
    be declared below the mark.
    """

    spec: Callable[[], type[BaseModel]]


def possible_path(path: str) -> str:
    """Return a path that a file system can take; ValueError for one with a name of more than 255
    bytes, or a zero byte.
    """
    longest = max(path.split("/"), key=len)
    if len(path) > LONGEST_PATH or len(longest.encode()) > LONGEST_NAME:
        raise ValueError(f"no path is as long as {longest[:40]!r}..., {len(path)} characters")
    if "\0" in path:
        raise ValueError(f"{path!r} holds a zero byte, which no path does")
    return path


SpecPath = Annotated[str, AfterValidator(possible_path), RelativePath()]
"""The path of a file, or a glob; relative ones start at the folder of the file that they are
written in.
"""


# Values as they are resolved
# --------------------------------------------------------------------------------------------------


def resolve(root: Node, model: type[BaseModel], problems: list[Mistake]) -> Node:
    """Return the tree with every `250 kPa` replaced by a number, and every inherited relative path
    by one from the root's folder.

    A wrong unit is added to `problems`; the number is then NaN, which validation refuses at the
    same place.
    """
    return _Resolver(root.at.source.folder, problems).node(
        root, [Kind(model)], _surroundings(plain(root))
    )


@dataclass(frozen=True)
class _Resolver:
    folder: Path
    problems: list[Mistake]

    def node(self, node: Node, kinds: Sequence[Kind], around: Surroundings | None) -> Node:
        """Return the same node, resolved, given what it may be; quantities stay as they are where
        nothing is known `around` them.
        """
        match node.value:
            case dict() as children:
                inside = around and replace(around, siblings=plain(node))
                return replace(
                    node,
                    value={
                        key: self._under(key, child, kinds, inside)
                        for key, child in children.items()
                    },
                )
            case list() as items:
                return replace(
                    node,
                    value=[
                        self._under(index, item, kinds, around) for index, item in enumerate(items)
                    ],
                )
            case str() as text:
                return replace(node, value=self._text(node, text, kinds, around))
            case _:
                return node

    def _under(
        self, step: str | int, child: Node, kinds: Sequence[Kind], around: Surroundings | None
    ) -> Node:
        if _mark(
            kinds, SettingsOfSpec
        ):  # their quantities are resolved with the spec that they set
            around = None
        elif around and isinstance(step, str) and any(is_free(kind, step) for kind in kinds):
            around = replace(around, key=step)
        return self.node(child, _under(kinds, step), around)

    def _text(
        self, node: Node, text: str, kinds: Sequence[Kind], around: Surroundings | None
    ) -> str | float:
        path, rule = _mark(kinds, RelativePath), _mark(kinds, InUnit)
        try:
            if path:
                return _from_folder(expand(text), path, node.at.source.folder, self.folder)
            text = unescaped(text)
        except ValueError as error:
            self.problems.append(Mistake(node.at, str(error), VARIABLES))
            return text
        if rule is None or around is None or not is_quantity(text):
            return text
        unit = rule.unit(around)
        try:
            # Where no unit is known, another key is wrong, and is reported as such.
            return split_quantity(text)[0] if unit is None else parse_quantity(text, unit)
        except SpecError as error:
            self.problems.append(Mistake(node.at, error.message, error.remedy))
            return math.nan


def moved(document: Any, kinds: Sequence[Kind], folder: Path, to: Path) -> Any:
    """Return the values of a spec in `folder`, for a file in the folder `to`: relative paths start
    there.
    """
    match document:
        case dict():
            return {
                key: moved(value, _under(kinds, key), folder, to) for key, value in document.items()
            }
        case list():
            return [
                moved(value, _under(kinds, place), folder, to)
                for place, value in enumerate(document)
            ]
        case str() if path := _mark(kinds, RelativePath):
            return _from_folder(document, path, folder, to)
        case _:
            return document


def _under(kinds: Sequence[Kind], step: str | int) -> list[Kind]:
    """Return what may stand under a key or list index; keys of settings, as `data.files`, lead from
    the root of a spec.
    """
    settings = _mark(kinds, SettingsOfSpec)
    if settings is None:
        return [found for kind in kinds for found in below(kind, step)]
    here = [Kind(settings.spec())]
    for name in str(step).split("."):
        here = _under(here, int(name) if name.isdecimal() else name)
    return here


def _mark(kinds: Sequence[Kind], of: type[M]) -> M | None:
    return next((mark for kind in kinds for mark in kind.marks if isinstance(mark, of)), None)


def _from_folder(path: str, mark: RelativePath, written_in: Path, folder: Path) -> str:
    if written_in == folder or Path(path).is_absolute() or (mark.bare and "/" not in path):
        return path
    return Path(os.path.relpath(written_in / path, folder)).as_posix()


def _surroundings(root: Any) -> Surroundings:
    """Return what the root says about units and target, as far as it is well-formed."""
    units = {name: unit for name, unit in _mapping(root, "units").items() if isinstance(unit, str)}
    column = _mapping(root, "target").get("column")
    derived = {
        name: _mapping(rule).get("rate_of")
        for name, rule in _mapping(root, "data", "derive").items()
    }
    rates = {name: of for name, of in derived.items() if isinstance(of, str)}
    level = _mapping(root, "data", "levels").get("of")
    return Surroundings(
        units={**{name: default_unit(name, units, rates) for name in rates}, **units},
        target=column if isinstance(column, str) else "force",
        level=level if isinstance(level, str) else None,
    )


def _mapping(value: Any, *keys: str) -> dict[str, Any]:
    """Return the mapping under `keys`; empty where there is none."""
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}
