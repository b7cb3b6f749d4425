"""What a field of a stored type says of itself: its form, what it is, its unit, and the dimensions that it shares with others."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmore_cli.storage.artefacts.codecs import Codec
from mapmore_cli.storage.artefacts.integrity import Invalid
from mapmore_cli.storage.artefacts.label import Label

_DIMENSIONS = re.compile(r"\((\w+(?: or 0)?(?:, \w+)*)\) ")

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

    def value_of(self, record: Any) -> Any:
        """Return what to store for this field."""
        return self.derived(record) if self.derived else getattr(record, self.name)

    def label(self, outer: Label) -> Label:
        """Return the attributes of this field, within an object that stands where `outer` says."""
        return outer.of_field(self.description, self.unit)

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
    match = _DIMENSIONS.match(description)
    return tuple(match[1].split(", ")) if match else ()
