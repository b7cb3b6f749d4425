"""A stored type is declared once: its fields with form, unit and description. Writer, reader and documentation follow from that."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from mapmore_cli.storage.artefacts.codecs import Codec
from mapmore_cli.storage.artefacts.label import Label

if TYPE_CHECKING:
    import h5py


@dataclass(frozen=True)
class Field:
    """A field of a stored type, under the name that it has in Python.

    `unit` may name quantities in brackets (see `Label`). A field with `derived` is computed for readers of the file and ignored when the
    object is read back.
    """

    name: str
    codec: Codec
    description: str
    unit: str = "1"
    derived: Callable[[Any], Any] | None = None

    def value_of(self, record: Any) -> Any:
        """What to store for this field."""
        return self.derived(record) if self.derived else getattr(record, self.name)

    def label(self, outer: Label) -> Label:
        """The attributes of this field, within an object that stands where `outer` says."""
        return outer.of_field(self.description, self.unit)


@dataclass(frozen=True)
class Schema:
    """How a dataclass is stored in a group; `units` gives the units that an object knows, by the names used in brackets."""

    type: type
    summary: str
    fields: tuple[Field, ...]
    units: Callable[[Any], Mapping[str, str]] = lambda _record: {}

    def write_into(self, group: h5py.Group, record: Any, label: Label) -> None:
        """Write every field of `record` into `group`."""
        inner = label.within(self.units(record))
        for field in self.fields:
            field.codec.write(group, field.name, field.value_of(record), field.label(inner))

    def read_from(self, group: h5py.Group) -> Any:
        """The record that `write_into` stored."""
        return self.type(**{field.name: field.codec.read(group, field.name) for field in self.fields if not field.derived})


def record(schema: Schema) -> Codec:
    """One object, as a group of its own."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        schema.write_into(group.create_group(name), value, label)

    def read(group: h5py.Group, name: str) -> Any:
        return schema.read_from(group[name])

    return Codec(f"[{schema.type.__name__}](#{schema.type.__name__.lower()})", write, read)


def nested(type_: type, schema: Callable[[], Schema]) -> Codec:
    """The same for a type that has parts of its own type, whose schema is not known before it is used."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        record(schema()).write(group, name, value, label)

    def read(group: h5py.Group, name: str) -> Any:
        return record(schema()).read(group, name)

    return Codec(f"[{type_.__name__}](#{type_.__name__.lower()})", write, read)


def variant(bodies: Mapping[str, Schema]) -> Codec:
    """One object of one of several types, as a group of its own whose attribute `kind` names the type."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        word, schema = next((word, schema) for word, schema in bodies.items() if type(value) is schema.type)
        body = group.create_group(name)
        body.attrs["kind"] = word
        schema.write_into(body, value, label)

    def read(group: h5py.Group, name: str) -> Any:
        word = group[name].attrs["kind"]
        if word not in bodies:
            raise ValueError(f"{group.name}/{name} is of the unknown kind {word!r}")
        return bodies[word].read_from(group[name])

    form = ", ".join(f"`{word}`: [{schema.type.__name__}](#{schema.type.__name__.lower()})" for word, schema in bodies.items())
    return Codec(f"group with the attribute `kind`; {form}", write, read)


def rows(schema: Schema) -> Codec:
    """A tuple of objects with scalar fields as a table: a group with one 1-D dataset for every field.

    A column that files of earlier versions lack is read as the default of its field.
    """
    columns = {field: field.codec.column for field in schema.fields}

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        table = group.create_group(name)
        for field, column in columns.items():
            assert column is not None
            column.write(table, field.name, [field.value_of(row) for row in value], field.label(label))

    def read(group: h5py.Group, name: str) -> tuple[Any, ...]:
        table = group[name]
        known = {field.name: column for field, column in columns.items() if column and field.name in table}
        cells = [_plain(column.read(table, name)) for name, column in known.items()]
        return tuple(schema.type(**dict(zip(known, row, strict=True))) for row in zip(*cells, strict=True))

    return Codec(f"table of [{schema.type.__name__}](#{schema.type.__name__.lower()}), a dataset for every column", write, read)


def _plain(column: Any) -> Any:
    """A column as Python numbers or texts."""
    return column if isinstance(column, tuple) else column.tolist()
