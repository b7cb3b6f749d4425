"""A stored type is declared once, as a dataclass: writer, reader, checksum and documentation follow from its fields.

A setting that is added to a stored class, and a kind that is added, need no line in this folder. The first text in the `Annotated` of a
field is its description, the second its unit (without one 1 for numbers, - for all else). A default is what files without the field are
read as. What a type says beyond that stands in `LAYOUTS`.

Units in brackets name the quantity whose unit applies: `[target]` is the modelled quantity, `[variables.0]` the first segmented variable,
`[*]` the quantity that a part is named after, `[slopes]` one over the unit of each scaled variable.
"""

from __future__ import annotations

import re
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass, replace
from dataclasses import field as default
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import h5py
import numpy as np

from mapmore_cli.domain.fits import FormulaFit, Scaling, SegmentedCurve, SegmentFit, Selection
from mapmore_cli.domain.models import FoldError, Formula, Fusion, Model, MotionFit, Part, Pieces, SegmentFunction, Side
from mapmore_cli.domain.recording import Dataset, Signal
from mapmore_cli.domain.results import FitResult, Validation
from mapmore_cli.domain.scores import Score
from mapmore_cli.modelling import literature
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts import codecs
from mapmore_cli.storage.artefacts.codecs import NO_UNIT, Codec, Invalid, Label, Sink, stored_at

Sizes = dict[str, tuple[int, str]]
"""Lengths of the dimensions seen so far in an object, by their letters, and where each was seen first."""


@dataclass(frozen=True)
class Field:
    """A field of a stored type, under the name that it has in Python.

    A description that begins with letters in brackets declares the dimensions: within an object, and the objects inside of it, all that is
    called `(k)` has one length; `(k, M)` is a table, and `(k or 0)` may also be empty. `unit` may name quantities in brackets (see
    `Label`). A field with `derived` is computed for readers of the file and ignored when the object is read back.
    """

    name: str
    codec: Codec
    description: str
    unit: str = "1"
    derived: Callable[[Any], Any] | None = None

    def label(self, outer: Label) -> Label:
        """Return the attributes of this field, within an object that stands where `outer` says."""
        return replace(outer, description=self.description, unit=self.unit)

    def check(self, value: Any, where: str, sizes: Sizes) -> None:
        """Raise Invalid where a value is not as long as others that have the same dimension."""
        letters = dimensions(self.description)
        if not letters or value is None:
            return
        for part in value.values() if isinstance(value, Mapping) else [value]:
            shape = part.shape if isinstance(part, np.ndarray) else (len(part),)
            if shape == (0,) and letters[0].endswith(" or 0"):
                continue
            for length, letter in zip(shape, letters, strict=True):
                known, first = sizes.setdefault(letter.removesuffix(" or 0"), (length, where))
                if length != known:
                    raise Invalid(where, f"has {length} values, where {first} has {known}")


def dimensions(description: str) -> tuple[str, ...]:
    """Return the letters of the dimensions that a description declares; empty where it declares none."""
    match = re.match(r"\((\w+(?: or 0)?(?:, \w+)*)\) ", description)
    return tuple(match[1].split(", ")) if match else ()


@dataclass(frozen=True)
class Schema:
    """How a dataclass is stored in a group; `units` are those that an object knows, by the names used in brackets."""

    type: type
    fields: tuple[Field, ...]
    units: Callable[[Any], Mapping[str, str]]

    def store(self, sink: Sink, record: Any, label: Label) -> None:
        """Put every field of `record` into the open group of a file or a checksum."""
        inner = label.within(self.units(record)) if sink.whole else label
        for field in self.fields:
            if sink.whole or not field.derived:
                value = field.derived(record) if field.derived else getattr(record, field.name)
                field.codec.store(sink, field.name, value, field.label(inner))

    def read(self, group: h5py.Group) -> Any:
        """Return the record that is stored in a group; Invalid where it is of another form."""
        return self.type(**{field.name: field.codec.read(group, field.name) for field in self.fields if not field.derived})


def nested(type_: type) -> Codec:
    """One object, as a group of its own."""
    return Codec(
        _link(type_),
        lambda sink, name, value, label: schema_of(type_).store(sink.inner(name), value, label),
        lambda group, name: schema_of(type_).read(codecs.stored(group, name, "Group")),
        (type_,),
    )


def variant(kinds: Mapping[str, type]) -> Codec:
    """One object of one of several types, as a group of its own whose attribute `kind` names the type."""
    words = {type_: word for word, type_ in kinds.items()}

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        body = sink.inner(name)
        body.scalar("kind", words[type(value)], None)
        schema_of(type(value)).store(body, value, label)

    def read(group: h5py.Group, name: str) -> Any:
        body = codecs.stored(group, name, "Group")
        with stored_at(body.name):
            word = body.attrs.get("kind")
        if not isinstance(word, str) or word not in kinds:
            raise Invalid(body.name, f"is of the kind {str(word)[:60]!r}, which is none of {', '.join(kinds)}")
        return schema_of(kinds[word]).read(body)

    form = ", ".join(f"`{word}`: {_link(type_)}" for word, type_ in kinds.items())
    return Codec(form, store, read, tuple(kinds.values()))


def rows(type_: type) -> Codec:
    """Return a tuple of objects with scalar fields as a table: a group with one 1-D dataset for every field.

    A column that files of earlier versions lack is read as the default of its field, which no checksum counts.
    """
    columns = {field: COLUMNS[field.codec.form] for field in schema_of(type_).fields}
    defaults = {field.name: getattr(type_, field.name, None) for field in columns}

    def store(sink: Sink, name: str, value: Any, label: Label) -> None:
        table = sink.inner(name, len(value))
        if sink.whole:
            for field, column in columns.items():
                column.store(table, field.name, [getattr(row, field.name) for row in value], field.label(label))
            return
        for place, row in enumerate(value):
            for field in columns:
                cell, default = getattr(row, field.name), defaults[field.name]
                if cell != default and (cell == cell or default == default):  # NaN is the same as NaN
                    field.codec.store(table.inner(field.name), str(place), cell, label)

    def read(group: h5py.Group, name: str) -> tuple[Any, ...]:
        table = codecs.stored(group, name, "Group")
        there = {field.name: column for field, column in columns.items() if defaults[field.name] is None or field.name in table}
        cells = {key: codecs.plain(column.read(table, key)) for key, column in there.items()}
        lengths = {len(column) for column in cells.values()}
        if len(lengths) > 1:
            raise Invalid(table.name, f"has columns of {min(lengths)} and of {max(lengths)} rows")
        return tuple(type_(**dict(zip(cells, row, strict=True))) for row in zip(*cells.values(), strict=True))

    return Codec(f"table of {_link(type_)}", store, read, (type_,))


def _link(schema_type: type) -> str:
    return f"[{schema_type.__name__}](#{schema_type.__name__.lower()})"


TEXT, REAL, COUNT, TEXTS = codecs.scalar(str), codecs.scalar(float), codecs.scalar(int), codecs.texts()
REALS, INDICES = codecs.numbers("<f8"), codecs.numbers("<i8")
COLUMNS: Mapping[str, Codec] = {TEXT.form: TEXTS, REAL.form: REALS, COUNT.form: INDICES}
"""Lists of values of a form, as the columns of a table."""

PAIR = codecs.adapted(REALS, store=list, load=lambda array: tuple(array.tolist()))
PLAIN: Mapping[Any, Codec] = {
    str: TEXT,
    float: REAL,
    int: COUNT,
    bool: codecs.adapted(COUNT, store=int, load=bool),
    tuple[str, ...]: TEXTS,
    tuple[float, ...]: PAIR,
    tuple[float, float]: PAIR,
    tuple[int, ...]: codecs.adapted(INDICES, store=list, load=lambda array: tuple(array.tolist())),
    Mapping[str, float]: codecs.pairs(REALS),
    Mapping[str, int]: codecs.pairs(INDICES),
    Mapping[str, str]: codecs.pairs(TEXTS),
}
ARRAYS = {np.float64: "<f8", np.int64: "<i8", np.bool_: "|u1"}  # flags are not HDF5's enumeration, which MATLAB reads as text


def form_of(hint: Any, ndim: int = 1) -> Codec:
    """Return the form of the values of a type, arrays with `ndim` dimensions; raises TypeError for one that has none."""
    origin, arguments = get_origin(hint), get_args(hint)
    if hint in PLAIN:
        return PLAIN[hint]
    if origin is Annotated:
        return form_of(arguments[0], ndim)
    if origin is Literal:
        return TEXT
    if origin in (Union, types.UnionType) and len(arguments) == 2 and arguments[1] is type(None):
        return codecs.optional(form_of(arguments[0], ndim))
    if origin is np.ndarray:
        number_of = get_args(arguments[1])[0]
        return codecs.numbers(ARRAYS[number_of], ndim, "bool" if number_of is np.bool_ else None)
    if origin is tuple and arguments[1:] == (...,):
        return codecs.numbered(form_of(arguments[0]))
    if origin in (dict, Mapping):
        return codecs.named(form_of(arguments[1], ndim))
    if is_dataclass(hint):
        return nested(hint)  # type: ignore[arg-type]
    raise TypeError(f"values of {hint} cannot be stored")


@dataclass(frozen=True)
class Layout:
    """What is said of how a dataclass is stored, beyond its fields.

    - `codecs`: forms that do not follow from the types of fields.
    - `always`: fields that are stored and count in the checksum even where they have their default.
    - `first`: fields that are stored before the others, in this order.
    - `derived`: fields that are computed for readers of the file.
    - `units`: units that an object knows, by the names used in brackets.
    """

    codecs: Mapping[str, Codec] = default(default_factory=dict)
    always: tuple[str, ...] = ()
    first: tuple[str, ...] = ()
    derived: tuple[Field, ...] = ()
    units: Callable[[Any], Mapping[str, str]] = lambda _record: {}


LAYOUTS: dict[type, Layout] = {}
"""The types that have one."""


_schemas: dict[type, Schema] = {}


def schema_of(type_: type) -> Schema:
    """Return how a dataclass is stored."""
    if type_ not in _schemas:
        _schemas[type_] = _laid_out(type_)
    return _schemas[type_]


def _laid_out(type_: type) -> Schema:
    layout = LAYOUTS.get(type_, Layout())
    hints = get_type_hints(type_, include_extras=True)
    kept = {field.name: field for field in fields(type_) if field.metadata.get("stored", True)}
    found = [_field(kept[name], hints[name], layout) for name in dict.fromkeys((*layout.first, *kept))]
    return Schema(type_, (*found, *layout.derived), layout.units)


def _field(declared: Any, hint: Any, layout: Layout) -> Field:
    words = [mark for mark in getattr(hint, "__metadata__", ()) if isinstance(mark, str)]
    description = words[0] if words else declared.name.replace("_", " ")
    codec = layout.codecs.get(declared.name) or form_of(hint, len(dimensions(description)) or 1)
    otherwise = declared.default_factory() if declared.default_factory is not MISSING else declared.default
    if otherwise is not MISSING and otherwise is not None and declared.name not in layout.always:
        codec = codecs.added(codec, otherwise)
    unit = "1" if codec.form.startswith(("`float", "`int")) else NO_UNIT
    return Field(declared.name, codec, description, words[1] if words[1:] else unit)


def check_lengths(record: Any, where: str = "", sizes: Sizes | None = None) -> None:
    """Raise Invalid where arrays in a record, and in the records inside of it, that are declared to have one length do not."""
    known: Sizes = {} if sizes is None else sizes
    for field in schema_of(type(record)).fields:
        if not field.derived:
            value, place = getattr(record, field.name), f"{where}/{field.name}".lstrip("/")
            field.check(value, place, known)
            for name, part in _parts_of(value):
                check_lengths(part, f"{place}{name}", dict(known) if name else known)


def _parts_of(value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the records that a value is, or consists of, with how their places go on from its own."""
    if is_dataclass(value):
        yield "", value
    elif isinstance(value, Mapping):
        yield from ((f"/{codecs.escaped(key)}", part) for key, part in value.items() if is_dataclass(part))
    elif isinstance(value, tuple):
        yield from ((f"/{place:03d}", part) for place, part in enumerate(value) if is_dataclass(part))


# The stored types -----------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class SegmentationFile:
    """Where every training curve is cut."""

    curves: Annotated[tuple[SegmentedCurve, ...], "training curves"]


def _side(word: str) -> Side:
    try:
        return float(word)
    except ValueError:
        return word


def _defining(text: str) -> str:
    """Return the text; Invalid where it is not empty and defines no formula."""
    try:
        if text:
            literature.get(text)
    except (KeyError, ValueError) as fault:
        raise Invalid("definition", str(fault)) from fault
    return text


def _level_unit(of: Dataset | Formula) -> dict[str, str]:
    return {"level": f"[{of.level}]" if of.level else NO_UNIT}


def _variable_units(of: SegmentedCurve | Pieces) -> dict[str, str]:
    return {f"variables.{place}": f"[{name}]" for place, name in enumerate(of.variables)}


SIDES = codecs.adapted(
    TEXTS,
    store=lambda sides: [side if isinstance(side, str) else repr(float(side)) for side in sides],
    load=lambda words: tuple(map(_side, words)),
)
LAYOUTS |= {
    Dataset: Layout(
        always=("notes",),
        units=lambda dataset: {**{name: quantity.unit for name, quantity in dataset.quantities.items()}, **_level_unit(dataset)},
    ),
    SegmentedCurve: Layout(units=_variable_units),
    Scaling: Layout(units=lambda scaling: {"slopes": ", ".join(f"1/[{name}]" for name in scaling.variables) or NO_UNIT}),
    Selection: Layout(derived=(Field("err_sum", REALS, "(k) running sum of err", derived=lambda selection: np.cumsum(selection.err)),)),
    SegmentFit: Layout(
        derived=(Field("terms", TEXTS, "(k) names of the chosen terms, in the order of selection", NO_UNIT, derived=lambda fit: fit.terms),)
    ),
    FormulaFit: Layout({"definition": codecs.adapted(TEXT, store=str, load=_defining)}, always=("notes",)),
    MotionFit: Layout(always=("notes",)),
    FitResult: Layout(
        {"body": codecs.optional(variant({kind.name: kind.fit for kind in kinds() if kind.fit is not None}))}, always=("notes",)
    ),
    SegmentFunction: Layout(always=("limits",)),
    Fusion: Layout(
        {"extrapolation": codecs.named(SIDES)},
        always=("transition", "z_s", "levels", "shrink"),
        first=("transition", "z_s", "extrapolation", "levels", "aligned", "shrink", "hold", "domain"),
    ),
    Pieces: Layout(
        {"cross_validation": rows(FoldError)},
        always=("cross_validation",),
        units=lambda pieces: {
            **_variable_units(pieces),
            **_level_unit(pieces),
            "aligned": f"[{pieces.fusion.aligned}]" if pieces.fusion.aligned else NO_UNIT,
        },
    ),
    Formula: Layout(units=_level_unit),
    Part: Layout(always=("sign", "inputs")),
    Model: Layout(
        {"body": variant({kind.name: kind.body for kind in kinds()}), "signals": rows(Signal)},
        always=("signals", "notes"),
        units=lambda model: {**{quantity.name: quantity.unit for quantity in (*model.inputs, model.output)}, "target": model.output.unit},
    ),
    Validation: Layout({"scores": rows(Score)}, units=lambda of: of.units and {**of.units, "target": next(iter(of.units.values()))}),
}


def described() -> str:
    """Return a section for every stored type, parts before wholes; docs/file-format.md says what the short words mean."""
    head = "| name | stored as | unit | what it is |\n|---|---|---|---|\n"
    seen: dict[type, None] = {}

    def walk(type_: type) -> None:
        if type_ not in seen:
            seen[type_] = None
            for part in (part for field in schema_of(type_).fields for part in field.codec.types):
                walk(part)
            seen[type_] = seen.pop(type_)  # behind its parts

    for root in (Dataset, SegmentationFile, FitResult, Model, Validation):
        walk(root)
    sections = ((type_, "".join(map(_row, schema_of(type_).fields))) for type_ in seen)
    return "".join(f"### {type_.__name__}\n\n{str(type_.__doc__).partition(chr(10))[0]}\n\n{head}{rows}\n" for type_, rows in sections)


def _row(field: Field) -> str:
    unit = NO_UNIT if field.unit == NO_UNIT else f"`{field.unit}`"
    what = f"{field.description}{' (derived)' if field.derived else ''}".replace("|", "\\|")
    return f"| `{field.name}` | {field.codec.form} | {unit} | {what} |\n"
