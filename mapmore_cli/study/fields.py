"""Define what the sections of a spec have in common: their strict base class, numbers with units,
paths, and the information about the whole spec that validators of its parts use.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    SerializationInfo,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)

from mapmore_cli.domain.declared import Contradiction, Difference, Either, always_in
from mapmore_cli.domain.errors import SpecError
from mapmore_cli.domain.scores import OF_TARGET
from mapmore_cli.modelling.literature.own import is_definition
from mapmore_cli.study.tree import Loc, Node, Written, values_at, written
from mapmore_cli.study.units import (
    CANONICAL,
    default_unit,
    parse_quantity,
    split_quantity,
)
from mapmore_cli.study.variables import VARIABLES, expand, variable_in

TargetKind = Literal["static", "hysteresis", "damping", "dynamic"]
"""The part of the force that is modelled, if the target is no measured quantity."""


def as_target(value: object) -> object:
    """Return a target in the form in which a spec stores it. A text that is not a kind of target is
    the name of a column, and a list contains the names of several columns.
    """
    if isinstance(value, list) and value:
        return {"column": value[0], "also": value[1:]} if value[1:] else as_target(value[0])
    is_name = isinstance(value, str) and value not in get_args(TargetKind)
    return {"column": value} if is_name else value


Row = tuple[bool, str, str, *tuple[str, ...]]
"""A possible contradiction: True if it applies, the description of the mistake, the remedy, and the
keys at which the mistake is shown.
"""


class Section(BaseModel):
    """Base class of the sections of a spec. Types are checked strictly, unknown keys are refused,
    and values cannot be changed afterwards.
    """

    model_config = ConfigDict(
        extra="forbid", strict=True, allow_inf_nan=False, frozen=True, populate_by_name=True
    )

    @model_validator(mode="before")
    @classmethod
    def _noted(cls, value: object, info: ValidationInfo) -> object:
        """Report to the loader which keys this mapping may have. The loader lists them in messages
        about unknown keys.
        """
        if isinstance(info.context, Context) and isinstance(value, dict):
            keys = [field.alias or name for name, field in cls.model_fields.items()]
            info.context.note(value, keys)
        return value

    def _contradictions(self) -> Sequence[Row]:
        """Return the contradictions that are possible within the section, each with a condition.
        The message shows the first contradiction whose condition is True.
        """
        return ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for applies, fault, remedy, *near in self._contradictions():
            if applies:
                raise Contradiction(fault, remedy, *near)
        return self


# Context of validators


@dataclass(frozen=True)
class Context:
    """Information about a whole spec, for validators of its parts: its folder, its units, and its
    quantities.

    If `partial` is True, faulty parts were removed from the spec before validation, so that
    required keys may be missing.
    """

    folder: Path
    # units in the section `units` of the spec, by quantity
    units: Mapping[str, str] = field(default_factory=dict)
    quantities: frozenset[str] = frozenset(CANONICAL)
    target: str = "force"  # the quantity that is modelled
    level: str | None = None  # the quantity that is constant within a curve
    partial: bool = False
    known: dict[int, tuple[Mapping[str, Any], list[str]]] = field(default_factory=dict)
    paths: set[int] = field(default_factory=set)  # `id(node)` of each node that is a path

    @classmethod
    def of(cls, root: Node, partial: bool = False) -> Context:
        """Read the units and quantities of a spec. Parts of the spec that are malformed are
        ignored.
        """
        spec = written(root)
        spec["target"] = as_target(spec.get("target"))

        def texts(place: str, step: int = -1) -> dict[str, str]:
            values = values_at(spec, place)
            return {str(way[step]): str(text) for way, text in values if isinstance(text, str)}

        units, rates = texts("units.*"), texts("data.derive.*.rate_of", -2)
        places = ("data.derive.*", "data.columns.*", "data.join.*.columns.*", "data.files.*.set.*")
        names = (str(way[-1]) for place in places for way, _ in values_at(spec, place))
        return cls(
            folder=root.at.source.folder,
            units={**{name: default_unit(name, units, rates) for name in rates}, **units},
            quantities=frozenset({*CANONICAL, *units, *names}),
            target=texts("target.column").get("column", "force"),
            level=texts("data.levels.of").get("of"),
            partial=partial,
        )

    def note(self, value: Mapping[str, Any], keys: Iterable[str]) -> None:
        """Store the keys that a section may have, for messages about unknown keys."""
        self.known.setdefault(id(value), (value, []))[1].extend(keys)

    def keys_at(self, value: Any, loc: Loc) -> tuple[str, ...]:
        """Return the keys that the mapping at the path `loc` may have. If several sections were
        tried for this mapping, the keys of all of them are returned.
        """
        for step in loc:
            value = value[step]
        return tuple(dict.fromkeys(self.known.get(id(value), ({}, []))[1]))

    def converted(
        self, value: object, unit_of: Callable[[Place], str | None], difference: bool
    ) -> object:
        """Convert a text with a unit to a number, as a value or as a `difference` of two values.
        Anything else is returned unchanged.

        Raises Contradiction for a wrong unit. If the unit to convert to is unknown, because another
        key is faulty, the number is returned without conversion; the fault is reported at the other
        key.
        """
        if not isinstance(value, Written) or not value.is_quantity:
            return value
        unit = unit_of(Place(self, value))
        try:
            if unit is None:
                return split_quantity(value)[0]
            return parse_quantity(value, unit, difference=difference)
        except SpecError as error:
            raise Contradiction(error.message, error.remedy) from error


@dataclass(frozen=True)
class Place:
    """Place of a number in the spec. The unit of the number can depend on this place."""

    context: Context
    text: Written

    @property
    def siblings(self) -> Mapping[str, Any]:
        """The section of the spec that contains the number."""
        return self.text.around

    @property
    def key(self) -> str:
        """Name of the key whose value is the number, or a list that contains the number."""
        return next(str(step) for step in reversed(self.text.way) if isinstance(step, str))

    @property
    def quantity(self) -> str | None:
        """Name of the quantity that the number belongs to: the nearest key above the number that is
        a quantity, for example `pressure` in `set: {pressure: 2 bar}`; None if there is none.
        """
        for step in map(str, reversed(self.text.way)):
            base = step.removesuffix("_rate").removeprefix("step_")
            if {step, base} & self.context.quantities:
                return step
        return None

    def unit_of(self, quantity: object) -> str | None:
        """Return the unit of a quantity in the model; None if `quantity` is not a text."""
        return default_unit(quantity, self.context.units) if isinstance(quantity, str) else None


# Numbers with units
# --------------------------------------------------------------------------------------------------


def _column_unit(place: Place) -> str | None:
    unit = place.siblings.get("unit")
    return unit if isinstance(unit, str) else place.unit_of(place.quantity)


def _metric_unit(place: Place) -> str | None:
    """Return the unit of a limit in `validate.require`: the unit of the metric. If a metric has a
    limit for each target, the unit can differ between the targets.
    """
    if place.key in OF_TARGET:
        return place.unit_of(place.context.target)
    return place.unit_of(place.quantity) if place.text.way[-2] in OF_TARGET else "1"


Metres = Annotated[float, Field(gt=0), always_in("m")]
SignedSeconds = Annotated[float, always_in("s")]
InColumnUnit = Annotated[float, Difference(_column_unit, "that of the column")]
Metric = Annotated[float, Difference(_metric_unit, "that of the metric")]
Share = Annotated[float, always_in("1")]


def _share_of_value(value: object, info: ValidationInfo) -> object:
    """Leave a text such as `2 %` unconverted, because it is a share of the measured value. If the
    quantity is a plain number or is itself measured in per cent, the text is an ordinary number
    with a unit.
    """
    if not isinstance(value, Written) or not isinstance(info.context, Context):
        return value
    place = Place(info.context, value)
    is_value = place.unit_of(place.quantity) in ("1", "%")
    return str(value) if value.is_quantity and value.endswith("%") and not is_value else value


_Group = Annotated[str, Field(pattern=r"^[-+]?[0-9]*\.?[0-9]+$")]
_Value = Annotated[
    float,
    Difference(lambda place: place.unit_of(place.quantity), "that of the quantity"),
    Field(gt=0),
]
_Column = Annotated[str, WithJsonSchema({"type": "string", "pattern": "^[A-Za-z_]"})]
Uncertainty = Annotated[
    _Value | _Column | Annotated[dict[_Group, _Value], Field(min_length=1)],
    Either(),
    BeforeValidator(_share_of_value),
]
"""A standard deviation: a value, a share in per cent, the name of a column, or values by group."""

Quantity = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100)]
"""Name of a quantity, as it can stand in expressions."""


# Paths
# --------------------------------------------------------------------------------------------------

LONGEST_NAME, LONGEST_PATH = 255, 4000


def possible_path(path: str) -> str:
    """Return the path if a file system can use it, or if it is the definition of a formula. Raises
    ValueError for a name of more than 255 bytes, and for a zero byte.
    """
    if is_definition(path):
        return path
    longest = max(path.split("/"), key=len)
    if len(path) > LONGEST_PATH or len(longest.encode()) > LONGEST_NAME:
        raise ValueError(
            f"the path {longest[:40]!r}... has {len(path)} characters, more than a system allows"
        )
    if "\0" in path:
        raise ValueError(f"{path!r} contains a zero byte, which a path must not contain")
    return path


def read_path(value: object, info: ValidationInfo, bare: bool) -> object:
    """Expand the variables in a path, and return the path relative to the folder of the spec."""
    if not isinstance(value, Written) or not isinstance(info.context, Context):
        return value
    info.context.paths.add(id(value.node))
    try:
        path = expand(str(value.node.value))
    except ValueError as error:
        raise Contradiction(str(error), VARIABLES) from error
    return from_folder(path, value.node.at.source.folder, info.context.folder, bare)


def moved_path(path: str, info: SerializationInfo, bare: bool) -> str:
    """Rewrite a path for a spec in another folder. If the context does not name both folders, the
    path is returned unchanged.
    """
    if info.context is None:
        return path
    written_in, folder = info.context
    return from_folder(path, written_in, folder, bare)


def from_folder(path: str, written_in: Path, folder: Path, bare: bool) -> str:
    """Rewrite a path that is relative to the folder `written_in`, so that it is relative to
    `folder`. If `bare` is True, a name without a folder stays unchanged.
    """
    if written_in == folder or Path(path).is_absolute() or (bare and "/" not in path):
        return path
    return Path(os.path.relpath(written_in / path, folder)).as_posix()


SpecPath = Annotated[
    str,
    BeforeValidator(partial(read_path, bare=False)),
    AfterValidator(possible_path),
    PlainSerializer(partial(moved_path, bare=False)),
]
"""Path of a file, or a path with wildcards. A relative path starts at the folder of the file in
which it is written.
"""
PathOrName = Annotated[
    str,
    BeforeValidator(partial(read_path, bare=True)),
    AfterValidator(possible_path),
    PlainSerializer(partial(moved_path, bare=True)),
]
"""A path as in `SpecPath`, or a name without a folder, which stays unchanged."""


def stray_variables(root: Node, context: Context) -> Iterator[tuple[Node, str]]:
    """Yield each text that contains a variable although it is no path, together with a description
    of the mistake.
    """
    children = root.value.values() if isinstance(root.value, dict) else root.value
    if isinstance(children, str):
        if id(root) not in context.paths and (variable := variable_in(children)):
            fault = (
                "is in a text that is not a path: environment variables are replaced only in paths"
            )
            yield root, f"`{variable}` {fault}"
    elif isinstance(children, Iterable):
        for child in children:
            yield from stray_variables(child, context)
