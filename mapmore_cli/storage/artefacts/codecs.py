"""How values lie in an HDF5 group: one codec for each form, made to be put together.

A codec writes one value under a name, reads it back, and feeds it to a checksum. Scalars are attributes of their group; arrays are datasets
with the attributes `unit` and `description`; whatever has parts is a group. Names chosen by users never become a path by accident: parts of
a sequence are numbered (`000`), and parts of a mapping are named after their keys with `/`, `%` and a leading dot escaped.
"""

from __future__ import annotations

import math
import mmap
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

import h5py
import numpy as np
from numpy.typing import NDArray

from mapmore_cli.domain.arrays import give_back, row_blocks
from mapmore_cli.domain.errors import DataError
from mapmore_cli.domain.foreign import is_one_line
from mapmore_cli.storage.artefacts.integrity import MOST_KEYS, Digest, Invalid, stored_at, texts_of, valid_text

NO_UNIT = "-"
"""Unit of texts, identifiers and row numbers."""

LONG, HUGE = 4096, 1 << 20
"""Elements from which on an array is compressed, and from which on it is so no more. Shorter ones stay contiguous, so that any reader finds
them at once; huge ones, so that they can be mapped, and because compressing them takes longer than all else."""

WORDS = {"<f8": "float", "<i8": "int", "|u1": "flag"}
"""What the documentation calls types of numbers."""


@dataclass(frozen=True)
class Label:
    """Description and unit of a field, and the units known where it stands.

    `unit` may name quantities in square brackets: `[target]^2` is the square of the target's unit. `[*]` stands for the key or number of
    the part being written. What `scope` does not know stays in brackets, as documented in docs/file-format.md.
    """

    description: str = ""
    unit: str = "1"
    scope: Mapping[str, str] = field(default_factory=dict)

    def of_part(self, key: str) -> Label:
        """Return the label of one part of a sequence or mapping."""
        return replace(self, unit=self.unit.replace("*", key)) if "*" in self.unit else self

    def within(self, units: Mapping[str, str]) -> Label:
        """Return the label with the units that an object knows added to the scope."""
        every = {**self.scope, **units}
        return replace(self, scope={**self.scope, **{name: _resolved(unit, every) for name, unit in units.items()}})

    def put_on(self, dataset: h5py.Dataset) -> None:
        """Write the two attributes."""
        dataset.attrs["unit"] = _resolved(self.unit, self.scope)
        dataset.attrs["description"] = self.description


def _resolved(unit: str, scope: Mapping[str, str]) -> str:
    """Return the unit with every known `[name]` replaced; a compound unit gets parentheses before a power."""

    def known(match: re.Match[str]) -> str:
        name, power = match.groups()
        found = scope.get(name, f"[{name}]")
        return f"({found}){power}" if power and re.search(r"[*/ ^]", found) else f"{found}{power}"

    return re.sub(r"\[([^\]]*)\](\^?)", known, unit)


@dataclass(frozen=True)
class Codec:
    """Writes a value under a name into a group, and reads it back.

    - `form`: what docs/file-format.md calls it.
    - `write`, `read`: of a group and a name in it; `read` raises Invalid for what is not of the form.
    - `feed`: adds a value to a checksum, under the path that it stands at.
    - `column`: stores a list of such values, where they can be the cells of a table.
    - `types`: dataclasses that it is made of.
    """

    form: str
    write: Callable[[h5py.Group, str, Any, Label], None]
    read: Callable[[h5py.Group, str], Any]
    feed: Callable[[Digest, str, Any], None]
    column: Codec | None = None
    types: tuple[type, ...] = ()


def stored(group: h5py.Group, name: str, kind: str) -> Any:
    """Return what stands under a name: the `kind` is `Group` or `Dataset`."""
    where = f"{group.name}/{name}"
    with stored_at(where):
        found = group.get(name)
    if found is None:
        raise Invalid(where, "is missing")
    if not isinstance(found, getattr(h5py, kind)):
        raise Invalid(where, f"is no {kind.lower()}")
    return found


def _attribute(group: h5py.Group, name: str) -> Any:
    where = f"{group.name}/{name}"
    with stored_at(where):
        if name not in group.attrs:
            raise Invalid(where, "is missing")
        if group.attrs.get_id(name).shape != ():
            raise Invalid(where, "is not a single value")
        return group.attrs[name]


def _present(group: h5py.Group, name: str) -> bool:
    with stored_at(f"{group.name}/{name}"):
        return name in group or name in group.attrs


def numbers(dtype: str, ndim: int = 1, load_dtype: str | None = None) -> Codec:
    """Return an array of `ndim` dimensions, stored as `dtype` (little-endian) and read as `load_dtype`."""
    form = f"`{WORDS[dtype]}[{',' * (ndim - 1)}]`"
    loaded = load_dtype or np.dtype(dtype).newbyteorder("=")

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        array = value if isinstance(value, np.ndarray) else np.asarray(value, dtype=dtype)
        if array.size < HUGE:
            filters: dict[str, Any] = {"compression": "gzip", "shuffle": True} if array.size >= LONG else {}
            dataset = group.create_dataset(name, data=np.asarray(array, dtype=dtype), track_times=False, **filters)
        else:
            dataset = group.create_dataset(name, array.shape, dtype, track_times=False)
            for rows in row_blocks(len(array)):
                dataset[rows] = np.asarray(array[rows], dtype=dtype)
                give_back(array)
        label.put_on(dataset)

    def read(group: h5py.Group, name: str) -> Any:
        dataset = stored(group, name, "Dataset")
        with stored_at(dataset.name):
            shape, found = dataset.shape, dataset.dtype
        if len(shape) != ndim or not np.can_cast(found, dtype, casting="same_kind"):
            raise Invalid(dataset.name, f"is a {len(shape)}-D array of {found}, not a {form}")
        with stored_at(dataset.name):
            values = mapped(dataset) if dataset.size >= HUGE and dataset.chunks is None else dataset[()]
            values = values.astype(loaded, copy=False)
        values.setflags(write=False)  # several stages may be given the same
        return values

    return Codec(form, write, read, _fed(dtype))


def _fed(dtype: str | None) -> Callable[[Digest, str, Any], None]:
    """Return how numbers of a type, or texts (None), are fed to a checksum."""
    return lambda digest, where, value: digest.add(where, value, dtype)


_mappings: WeakValueDictionary[tuple[int, ...], mmap.mmap] = WeakValueDictionary()
"""One for each file, which all of its columns share: a mapping keeps its file open."""


def mapped(dataset: h5py.Dataset) -> NDArray[Any]:
    """Return the values of a contiguous dataset where they lie in its file, without reading them."""
    with Path(dataset.file.filename).open("rb") as file:
        now = os.fstat(file.fileno())
        key = (now.st_dev, now.st_ino, now.st_mtime_ns, now.st_size)
        content = _mappings.get(key) or mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    _mappings[key] = content
    return np.frombuffer(content, dataset.dtype, math.prod(dataset.shape), dataset.id.get_offset()).reshape(dataset.shape)


def texts() -> Codec:
    """Return a tuple of texts, as a 1-D dataset of UTF-8 strings of variable length."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        data = list(map(checked_text, value))
        dataset = group.create_dataset(name, data=data, dtype=h5py.string_dtype(), track_times=False)
        replace(label, unit=NO_UNIT).put_on(dataset)

    def read(group: h5py.Group, name: str) -> tuple[str, ...]:
        return texts_of(stored(group, name, "Dataset"), f"{group.name}/{name}")

    return Codec("`text[]`", write, read, _fed(None))


def number(kind: type[float] | type[int]) -> Codec:
    """Return a real number or an integer, as attribute of the group: it has no unit and description, which the documentation has."""
    dtype = "<f8" if kind is float else "<i8"

    def write(group: h5py.Group, name: str, value: Any, _label: Label) -> None:
        group.attrs.create(name, value, dtype=dtype)

    def read(group: h5py.Group, name: str) -> Any:
        value = np.asarray(_attribute(group, name))
        if not np.can_cast(value.dtype, dtype, casting="same_kind"):
            raise Invalid(f"{group.name}/{name}", f"is no {np.dtype(dtype).name}")
        return kind(value)

    return Codec(f"`{WORDS[dtype]}`", write, read, _fed(dtype), numbers(dtype))


def text() -> Codec:
    """Return a short text, as attribute of the group."""

    def write(group: h5py.Group, name: str, value: Any, _label: Label) -> None:
        group.attrs[name] = checked_text(value)

    def read(group: h5py.Group, name: str) -> str:
        value = _attribute(group, name)
        if not isinstance(value, str):
            raise Invalid(f"{group.name}/{name}", "is no text")
        return valid_text(value, f"{group.name}/{name}")

    return Codec("`text`", write, read, _fed(None), texts())


def plain(values: Any) -> Any:
    """Return a list of numbers or texts as Python has them."""
    return values.tolist() if isinstance(values, np.ndarray) else values


def checked_text(value: str) -> str:
    """Return the text, if it is one that `valid_text` reads again; DataError for control characters and undecodable bytes."""
    if not is_one_line(value):
        raise DataError(f"the name {value!r} cannot be stored: it is not one line of valid text", "rename the file or column that it is of")
    return value


def optional(codec: Codec) -> Codec:
    """Return the same, with None stored as nothing."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        if value is not None:
            codec.write(group, name, value, label)

    return replace(added(codec, None), form=f"{codec.form} ?", write=write, column=None)


def added(codec: Codec, default: Any) -> Codec:
    """Return the same for a field that earlier files lack: they are read as if it held the default, which no checksum counts."""

    def read(group: h5py.Group, name: str) -> Any:
        return codec.read(group, name) if _present(group, name) else default

    def feed(digest: Digest, where: str, value: Any) -> None:
        if value is not None and (default is None or value != default):
            codec.feed(digest, where, value)

    return replace(codec, read=read, feed=feed)


def adapted(codec: Codec, store: Callable[[Any], Any], load: Callable[[Any], Any]) -> Codec:
    """Return the same for a value that is changed to what `codec` stores, and back."""
    return replace(
        codec,
        write=lambda group, name, value, label: codec.write(group, name, store(value), label),
        read=lambda group, name: load(codec.read(group, name)),
        feed=lambda digest, where, value: codec.feed(digest, where, store(value)),
        column=None,
    )


def numbered(codec: Codec) -> Codec:
    """Return a tuple, as a group whose parts are called `000`, `001`, ... without a gap."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        parts = group.create_group(name)
        for place, part in enumerate(value):
            codec.write(parts, f"{place:03d}", part, label.of_part(str(place)))

    def read(group: h5py.Group, name: str) -> tuple[Any, ...]:
        parts = stored(group, name, "Group")
        return tuple(codec.read(parts, f"{place:03d}") for place in range(len(parts)))

    def feed(digest: Digest, where: str, value: Any) -> None:
        digest.add(where, len(value), "<i8")
        for place, part in enumerate(value):
            codec.feed(digest, f"{where}/{place:03d}", part)

    return Codec(f"numbered {codec.form}", write, read, feed, types=codec.types)


def named(codec: Codec) -> Codec:
    """Return a mapping, as a group whose parts are called after the keys; the attribute `order` lists the keys in their order."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        parts = group.create_group(name)
        parts.attrs.create("order", list(map(checked_text, value)), dtype=h5py.string_dtype())
        for key, part in value.items():
            codec.write(parts, escaped(key), part, label.of_part(key))

    def read(group: h5py.Group, name: str) -> dict[str, Any]:
        parts = stored(group, name, "Group")
        with stored_at(parts.name):
            if parts.attrs.get_id("order").shape != (len(parts),) or len(parts) > MOST_KEYS:
                raise Invalid(parts.name, "has not as many members as its `order` names")
            keys = [valid_text(str(key), parts.name) for key in parts.attrs["order"]]
        if len(set(keys)) < len(keys):
            raise Invalid(parts.name, "names a member twice in its `order`")
        return {key: codec.read(parts, escaped(key)) for key in keys}

    def feed(digest: Digest, where: str, value: Mapping[str, Any]) -> None:
        digest.add(where, list(value), None)
        for key, part in value.items():
            codec.feed(digest, f"{where}/{escaped(key)}", part)

    return Codec(f"named {codec.form}", write, read, feed, types=codec.types)


def pairs(codec: Codec) -> Codec:
    """Return a mapping from names to numbers or texts, as a group with the parallel datasets `names` and `values`."""

    def write(group: h5py.Group, name: str, value: Any, label: Label) -> None:
        parts = group.create_group(name)
        texts().write(parts, "names", list(value), label)
        codec.write(parts, "values", list(value.values()), label)

    def read(group: h5py.Group, name: str) -> dict[str, Any]:
        parts = stored(group, name, "Group")
        values, names = codec.read(parts, "values"), texts().read(parts, "names")
        if len(values) != len(names) or len(set(names)) < len(names):
            raise Invalid(parts.name, f"has {len(values)} values for {len(set(names))} names")
        return dict(zip(names, plain(values), strict=True))

    def feed(digest: Digest, where: str, value: Mapping[str, Any]) -> None:
        digest.add(f"{where}/names", list(value), None)
        codec.feed(digest, f"{where}/values", list(value.values()))

    return Codec(f"`names`/`values` {codec.form}", write, read, feed)


def escaped(key: str) -> str:
    """Return the key as one component of an HDF5 path: not empty, without `/`, and not `.`."""
    component = key.replace("%", "%25").replace("/", "%2F")
    return f"%2E{component[1:]}" if component.startswith(".") else component or "%"
