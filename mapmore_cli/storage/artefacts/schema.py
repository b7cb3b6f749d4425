"""A stored type is declared once: its fields with form, unit and description. Writer, reader, checks and documentation follow from that."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from mapmore_cli.storage.artefacts.codecs import Codec, Sizes, place_of, plain, shown, stored
from mapmore_cli.storage.artefacts.integrity import Digest, Invalid, stored_at
from mapmore_cli.storage.artefacts.label import Label

_DIMENSIONS = re.compile(r"\((\w+(?: or 0)?(?:, \w+)*)\) ")


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

    def value_of(self, record: Any) -> Any:
        """Return what to store for this field."""
        return self.derived(record) if self.derived else getattr(record, self.name)

    def label(self, outer: Label) -> Label:
        """Return the attributes of this field, within an object that stands where `outer` says."""
        return outer.of_field(self.description, self.unit)

    @property
    def dimensions(self) -> tuple[str, ...]:
        """The letters of the dimensions; empty where none are declared."""
        match = _DIMENSIONS.match(self.description)
        return tuple(match[1].split(", ")) if match else ()

    def check(self, value: Any, where: str, sizes: Sizes) -> None:
        """Raise Invalid where a value is not what this field may hold, or not as long as others beside it."""
        self.codec.check(value, where, sizes)
        if self.dimensions and value is not None:
            for part in value.values() if isinstance(value, Mapping) else [value]:
                self._check_lengths(np.shape(part) if isinstance(part, np.ndarray) else (len(part),), where, sizes)

    def _check_lengths(self, shape: tuple[int, ...], where: str, sizes: Sizes) -> None:
        if shape == (0,) and self.dimensions[0].endswith(" or 0"):
            return
        for length, letter in zip(shape, (dimension.removesuffix(" or 0") for dimension in self.dimensions), strict=True):
            known, first = sizes.setdefault(letter, (length, where))
            if length != known:
                raise Invalid(where, f"has {length} values, where {first} has {known}")


Fault = tuple[str, str]
"""A field, and what is wrong with it."""


@dataclass(frozen=True)
class Schema:
    """How a dataclass is stored in a group.

    `units` gives the units that an object knows, by the names used in brackets. `rule` tells what is wrong with an object whose fields
    are all right by themselves: the field, and what is wrong with it in view of the others.
    """

    type: type
    summary: str
    fields: tuple[Field, ...]
    units: Callable[[Any], Mapping[str, str]] = lambda _record: {}
    rule: Callable[[Any], Iterable[Fault]] = lambda _record: ()

    def write_into(self, group: h5py.Group, record: Any, label: Label) -> None:
        """Write every field of `record` into `group`."""
        inner = label.within(self.units(record))
        for field in self.fields:
            field.codec.write(group, field.name, field.value_of(record), field.label(inner))

    def read_from(self, group: h5py.Group) -> Any:
        """Return the record that `write_into` stored; Invalid where it is of another form."""
        return self.type(**{field.name: field.codec.read(group, field.name) for field in self.fields if not field.derived})

    def check(self, record: Any, where: str, sizes: Sizes) -> None:
        """Raise Invalid for a record that cannot be, although each of its values has the right form."""
        own = [field for field in self.fields if not field.derived]
        for field in own:
            field.check(getattr(record, field.name), f"{where}/{field.name}".lstrip("/"), sizes)
        for name, what in self.rule(record):
            raise Invalid(f"{where}/{name}", what)

    def feed(self, digest: Digest, where: str, record: Any) -> None:
        """Add every value of a record to a checksum."""
        for field in self.fields:
            if not field.derived:
                field.codec.feed(digest, f"{where}/{field.name}", getattr(record, field.name))


def _link(schema_type: type) -> str:
    return f"[{schema_type.__name__}](#{schema_type.__name__.lower()})"


def record(schema: Schema) -> Codec:
    """One object, as a group of its own."""
    return nested(schema.type, lambda: schema)


def nested(type_: type, schema: Callable[[], Schema]) -> Codec:
    """Return the same for a type with parts of its own type, whose schema is not known before it is used. Such parts may lie too deep."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        schema().write_into(group.create_group(name), value, label)

    def read(group: h5py.Group, name: str) -> Any:
        return schema().read_from(stored(group, name, "Group"))

    def feed(digest: Digest, where: str, value: Any) -> None:
        schema().feed(digest, where, value)

    def check(value: Any, where: str, sizes: Sizes) -> None:
        schema().check(value, where, sizes)

    return Codec(_link(type_), write, read, feed, check)


def variant(bodies: Mapping[str, Schema]) -> Codec:
    """One object of one of several types, as a group of its own whose attribute `kind` names the type."""

    def of(value: Any) -> tuple[str, Schema]:
        return next((word, schema) for word, schema in bodies.items() if type(value) is schema.type)

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        word, schema = of(value)
        body = group.create_group(name)
        body.attrs["kind"] = word
        schema.write_into(body, value, label)

    def read(group: h5py.Group, name: str) -> Any:
        body, where = stored(group, name, "Group"), place_of(group, name)
        with stored_at(where):
            word = body.attrs.get("kind")
        if not isinstance(word, str) or word not in bodies:
            raise Invalid(where, f"is of the kind {shown(str(word))}, which is none of {', '.join(bodies)}")
        return bodies[word].read_from(body)

    def feed(digest: Digest, where: str, value: Any) -> None:
        word, schema = of(value)
        digest.add(f"{where}/kind", word, None)
        schema.feed(digest, where, value)

    def check(value: Any, where: str, sizes: Sizes) -> None:
        of(value)[1].check(value, where, sizes)

    form = ", ".join(f"`{word}`: {_link(schema.type)}" for word, schema in bodies.items())
    return Codec(f"group with the attribute `kind`; {form}", write, read, feed, check)


def rows(schema: Schema) -> Codec:
    """Return a tuple of objects with scalar fields as a table: a group with one 1-D dataset for every field.

    A column that files of earlier versions lack is read as the default of its field, which no checksum counts.
    """
    columns = {field: field.codec.column for field in schema.fields}
    defaults = {field.name: getattr(schema.type, field.name, None) for field in schema.fields}

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        table = group.create_group(name)
        for field, column in columns.items():
            assert column is not None
            column.write(table, field.name, [field.value_of(row) for row in value], field.label(label))

    def read(group: h5py.Group, name: str) -> tuple[Any, ...]:
        table, where = stored(group, name, "Group"), place_of(group, name)
        known = {
            field: column for field, column in columns.items() if column is not None and (not _has_default(field) or field.name in table)
        }
        cells = {field.name: plain(column.read(table, field.name)) for field, column in known.items()}
        lengths = {len(column) for column in cells.values()}
        if len(lengths) > 1:
            raise Invalid(where, f"has columns of {min(lengths)} and of {max(lengths)} rows")
        return made_of(cells)

    def made_of(cells: Mapping[str, Any]) -> tuple[Any, ...]:
        return tuple(schema.type(**dict(zip(cells, row, strict=True))) for row in zip(*cells.values(), strict=True))

    def _has_default(field: Field) -> bool:
        return defaults[field.name] is not None

    def feed(digest: Digest, where: str, value: Any) -> None:
        digest.add(where, len(value), "<i8")
        for place, row in enumerate(value):
            for field in schema.fields:
                if not same(field.value_of(row), defaults[field.name]):
                    field.codec.feed(digest, f"{where}/{field.name}/{place}", field.value_of(row))

    def check(value: Any, where: str, sizes: Sizes) -> None:
        for place, row in enumerate(value):
            schema.check(row, f"{where}/{place}", dict(sizes))

    return Codec(f"table of {_link(schema.type)}, a dataset for every column", write, read, feed, check)


def same(value: Any, default: Any) -> bool:
    """Whether a scalar is its default, NaN included."""
    return bool(value == default or (value != value and default != default))
