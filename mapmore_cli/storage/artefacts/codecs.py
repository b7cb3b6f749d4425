"""How values lie in an HDF5 group: one codec for each form, made to be put together.

A codec writes one value under a name and reads it back. Scalars are attributes of their group; arrays are datasets with the attributes
`unit` and `description`; whatever has parts is a group. Names chosen by users never become a path by accident: parts of a sequence are
numbered (`000`), and parts of a mapping are named after their keys with `/`, `%` and a leading dot escaped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmore_cli.domain.errors import DataError
from mapmore_cli.storage.artefacts.label import Label

if TYPE_CHECKING:
    import h5py

LONG = 4096
"""Elements from which on an array is compressed; shorter ones stay contiguous, so that any reader finds them at once."""


@dataclass(frozen=True)
class Codec:
    """Writes a value under a name into a group, and reads it back.

    `form` is what the documentation calls it; `column` stores a list of such values, where they can be the cells of a table.
    """

    form: str
    write: Callable[[h5py.Group, str, Any, Label], None]
    read: Callable[[h5py.Group, str], Any]
    column: Codec | None = None


def numbers(dtype: str, ndim: int = 1, load_dtype: str | None = None) -> Codec:
    """An array of `ndim` dimensions, stored as `dtype` (little-endian) and read as `load_dtype`."""
    form = f"{np.dtype(dtype).name} dataset, {ndim}-D"

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        array = np.asarray(value, dtype=dtype)
        filters: dict[str, Any] = {"compression": "gzip", "shuffle": True} if array.size >= LONG else {}
        label.put_on(group.create_dataset(name, data=array, track_times=False, **filters))

    def read(group: h5py.Group, name: str) -> Any:
        array = np.asarray(group[name][()])
        if array.ndim != ndim or not np.can_cast(array.dtype, dtype, casting="same_kind"):
            raise TypeError(f"{group.name}/{name} is a {array.ndim}-D array of {array.dtype}, not a {form}")
        return array.astype(load_dtype or np.dtype(dtype).newbyteorder("="))

    return Codec(form, write, read)


def texts() -> Codec:
    """A tuple of texts, as a 1-D dataset of UTF-8 strings of variable length."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        import h5py

        array = np.array([checked_text(text) for text in value], dtype=object)
        label.without_unit().put_on(group.create_dataset(name, data=array, dtype=h5py.string_dtype(), track_times=False))

    def read(group: h5py.Group, name: str) -> tuple[str, ...]:
        array = group[name].asstr()[()]
        if array.ndim != 1:
            raise TypeError(f"{group.name}/{name} is no list of texts")
        return tuple(str(text) for text in array)

    return Codec("string dataset, 1-D", write, read)


def number(kind: type[float] | type[int]) -> Codec:
    """A real number or an integer, as attribute of the group."""
    dtype = "<f8" if kind is float else "<i8"

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        del label  # attributes cannot carry attributes; the documentation has unit and description
        group.attrs[name] = np.asarray(value, dtype)

    def read(group: h5py.Group, name: str) -> Any:
        value = np.asarray(group.attrs[name])
        if value.ndim or not np.can_cast(value.dtype, dtype, casting="same_kind"):
            raise TypeError(f"attribute {name!r} of {group.name} is no {np.dtype(dtype).name}")
        return kind(value)

    return Codec(f"{np.dtype(dtype).name} attribute", write, read, numbers(dtype))


def text() -> Codec:
    """A short text, as attribute of the group."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        del label
        group.attrs[name] = checked_text(value)

    def read(group: h5py.Group, name: str) -> str:
        value = group.attrs[name]
        if not isinstance(value, str):
            raise TypeError(f"attribute {name!r} of {group.name} is no text")
        return value

    return Codec("string attribute", write, read, texts())


def optional(codec: Codec) -> Codec:
    """The same, with None stored as nothing."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        if value is not None:
            codec.write(group, name, value, label)

    def read(group: h5py.Group, name: str) -> Any:
        return codec.read(group, name) if name in group or name in group.attrs else None

    return Codec(f"{codec.form} (MAY be absent)", write, read)


def added(codec: Codec, default: Any) -> Codec:
    """The same for a field that files of earlier versions lack: they are read as if it held the default."""

    def read(group: h5py.Group, name: str) -> Any:
        return codec.read(group, name) if name in group or name in group.attrs else default

    return replace(codec, read=read)


def adapted(codec: Codec, store: Callable[[Any], Any], load: Callable[[Any], Any]) -> Codec:
    """The same for a value that is changed to what `codec` stores, and back."""
    return replace(
        codec,
        write=lambda group, name, value, label: codec.write(group, name, store(value), label),
        read=lambda group, name: load(codec.read(group, name)),
        column=None,
    )


def numbered(codec: Codec) -> Codec:
    """A tuple, as a group whose parts are called `000`, `001`, ... without a gap."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        parts = group.create_group(name)
        for place, part in enumerate(value):
            codec.write(parts, f"{place:03d}", part, label.of_part(str(place)))

    def read(group: h5py.Group, name: str) -> tuple[Any, ...]:
        parts = group[name]
        return tuple(codec.read(parts, f"{place:03d}") for place in range(len(parts)))

    return Codec(f"numbered group of: {codec.form}", write, read)


def named(codec: Codec) -> Codec:
    """A mapping, as a group whose parts are called after the keys; the attribute `order` lists the keys in their order."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        import h5py

        parts = group.create_group(name)
        keys = np.array([checked_text(key) for key in value], dtype=object)
        parts.attrs.create("order", keys, dtype=h5py.string_dtype())
        for key, part in value.items():
            codec.write(parts, escaped(key), part, label.of_part(key))

    def read(group: h5py.Group, name: str) -> dict[str, Any]:
        parts = group[name]
        return {str(key): codec.read(parts, escaped(str(key))) for key in parts.attrs["order"]}

    return Codec(f"named group of: {codec.form}", write, read)


def pairs(codec: Codec) -> Codec:
    """A mapping from names to numbers or texts, as a group with the parallel datasets `names` and `values`."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        parts = group.create_group(name)
        texts().write(parts, "names", list(value), label)
        codec.write(parts, "values", list(value.values()), label)

    def read(group: h5py.Group, name: str) -> dict[str, Any]:
        parts = group[name]
        values = codec.read(parts, "values")
        plain = values.tolist() if isinstance(values, np.ndarray) else values
        return dict(zip(texts().read(parts, "names"), plain, strict=True))

    return Codec(f"`names` and `values`; values: {codec.form}", write, read)


def checked_text(value: str) -> str:
    """The text, if HDF5 can hold it; DataError for NUL characters and undecodable bytes (as in odd file names)."""
    if "\0" in value or any("\ud800" <= character <= "\udfff" for character in value):
        raise DataError(f"the name {value!r} cannot be stored: it is not valid text", "rename the file or column that it comes from")
    return value


def escaped(key: str) -> str:
    """The key as one component of an HDF5 path: not empty, without `/`, and not `.`."""
    component = key.replace("%", "%25").replace("/", "%2F")
    if not component:
        return "%"
    return f"%2E{component[1:]}" if component.startswith(".") else component
