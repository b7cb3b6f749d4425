"""Build records, for example models, from the JSON document and the arrays of a result file. Each
value is checked against its type hint.
"""

from __future__ import annotations

import math
import types
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, is_dataclass
from sys import maxsize
from typing import Any, Literal, Union

import numpy as np
from annotated_types import Interval

from mapmore_cli.domain.declared import ValueCondition
from mapmore_cli.domain.foreign import is_one_line
from mapmore_cli.storage.artefacts.schema import (
    ARRAY,
    DEEPEST,
    TYPES,
    Hint,
    Invalid,
    Letters,
    Numbers,
    bodies,
    hints_of_members,
    shared_path,
    step_to,
    stored_fields,
    taken_apart,
)

Sizes = dict[str, int]
"""The length of each dimension that has occurred so far in an object, by the letter of the
dimension.
"""

Take = Callable[[str, str, int], Numbers]
"""Function that returns the array at a path, with a type and a number of dimensions."""


@dataclass(frozen=True)
class Decoder:
    """Decoder that builds a record, for example a model, from the JSON document and the arrays of a
    file. Raises Invalid for a value whose type differs from its type hint.

    `take` returns an array of the file. If `lenient`, unknown fields are ignored.
    """

    take: Take
    lenient: bool

    def value(self, node: object, hint: object, path: str, letters: Letters, sizes: Sizes) -> Any:
        """Return the object of the type `hint` that a part of the document, `node`, describes.
        `path` is the path of this part in the document. `letters` are the names of the dimensions
        of an array. `sizes` holds the length of each dimension of other arrays in the same object;
        the dimensions of this object are added.
        """
        form = taken_apart(hint)
        letters = form.letters or letters
        if form.kind is Union:
            if node is None and types.NoneType in form.inner:
                return None
            fitting = (
                inner
                for inner in form.inner
                if (taken_apart(inner).kind in (str, Literal)) == isinstance(node, str)
                and (taken_apart(inner).kind is range) <= isinstance(node, list)
            )
            return self.value(node, next(fitting, form.inner[0]), path, letters, sizes)
        stored = self._plain(node, form, path, letters, sizes)
        for check in form.checks:
            if wrong := wrong_with(stored, check):
                raise Invalid(
                    path, wrong + (f": {stored[:60]!r}" if isinstance(stored, str) else "")
                )
        return stored

    def _plain(self, node: object, form: Hint, path: str, letters: Letters, sizes: Sizes) -> object:
        kind, many = form.kind, form.inner[1:] == (...,)
        if path.count("/") > DEEPEST:
            raise Invalid(path, f"is nested more than {DEEPEST} fields deep")
        if kind is np.ndarray and isinstance(node, dict):
            return self._array(node, path, form.inner[0], letters, sizes)
        if bodies(kind) and isinstance(node, dict):
            inner = {**node}
            word = inner.pop("kind", None)
            if word not in (*bodies(kind),):
                raise Invalid(
                    path,
                    f"is of the kind {str(word)[:60]!r}, which is none of "
                    f"{', '.join(bodies(kind))}",
                )
            return self._record(inner, bodies(kind)[word], path, sizes)
        if is_dataclass(kind) and isinstance(node, dict):
            return self._record(node, kind, path, sizes)
        if (
            kind is range
            and isinstance(node, list)
            and [*map(type, node)] == [int, int]
            and 0 <= node[0] <= node[1] <= maxsize
        ):
            return range(*node)
        if kind is tuple and isinstance(node, list) and (many or len(node) == len(form.inner)):
            if many:
                _compare_lengths(path, (len(node),), letters, sizes)
            parts, hints = enumerate(node), hints_of_members(form, len(node))
            return tuple(
                self.value(member, hints[i], f"{path}/{i:03d}", (), {**sizes})
                for i, member in parts
            )
        if kind is Mapping and isinstance(node, dict):
            parts = enumerate(node.items())
            return {
                self.value(key, form.inner[0], path, (), {}): self.value(
                    member,
                    form.inner[1],
                    f"{path}/{step_to(key, i)}",
                    letters,
                    sizes if letters else {},
                )
                for i, (key, member) in parts
            }
        return _plain_value(node, form, path)

    def _record(self, node: dict[str, Any], type_: Any, path: str, sizes: Sizes) -> object:
        known = stored_fields(type_)
        needed = {name for name, (_, default) in known.items() if default is MISSING}
        for name in (needed - node.keys()) | (
            set() if self.lenient else node.keys() - known.keys()
        ):
            raise Invalid(
                f"{path}/{name}",
                "is missing" if name in known else "is not known in this format",
            )
        # the checksum depends on the order of the arrays, which is the order in the document
        return type_(
            **{
                name: self.value(field, known[name][0], f"{path}/{name}", (), sizes)
                for name, field in node.items()
                if name in known
            }
        )

    def _array(
        self,
        node: dict[str, Any],
        path: str,
        number: type[np.generic],
        letters: Letters,
        sizes: Sizes,
    ) -> Numbers:
        dimensions = max(1, len(letters))
        match node:
            case {"array": name} if node == {ARRAY: path}:
                stored = self.take(name, TYPES[number], dimensions)
            case {"array": name, "from": int(start), "shape": [*shape]} if (
                name == shared_path(path)
                and len(node) == 3
                and len(shape) == dimensions
                and all(type(length) is int and length >= 0 for length in [start, *shape])
            ):
                stored = self.take(name, TYPES[number], 1)[start : start + math.prod(shape)]
                if stored.size != math.prod(shape):
                    raise Invalid(path, f"lies beyond the end of {name}")
                stored = stored.reshape(shape)
            case _:
                raise Invalid(path, "is not a reference to its array")
        values = stored.astype(number, copy=False)
        _compare_lengths(path, values.shape, letters, sizes)
        # several stages may get the same array, so the array is made read-only
        values.setflags(write=False)
        return values


def _plain_value(node: object, form: Hint, path: str) -> object:
    if form.kind is Literal and node not in form.inner:
        raise Invalid(path, f"is not one of {', '.join(form.inner)}")
    if form.kind is float and (type(node) is int or node in ("nan", "inf", "-inf")):
        return float(node)
    expected = str if form.kind is Literal else form.kind
    if type(node) is not expected:
        raise Invalid(path, f"is not of the type {expected.__name__}")
    if expected is str and not is_one_line(node):
        raise Invalid(path, f"has control characters or line breaks: {node[:60]!r}")
    return node


def _compare_lengths(path: str, shape: tuple[int, ...], letters: Letters, sizes: Sizes) -> None:
    """Raise Invalid if a dimension of an array has another length than the dimension with the same
    letter of an earlier array. `sizes` holds the lengths so far, by letter; new letters are added
    to it.
    """
    for length, letter in zip(shape, letters, strict=False):
        name = letter.removesuffix(" or 0")
        if (length or name == letter) and sizes.setdefault(name, length) != length:
            raise Invalid(
                path,
                f"has {length} values, but other arrays with the dimension ({name}) "
                f"have {sizes[name]}",
            )


def wrong_with(value: object, check: object) -> str:
    """Test a value by an annotation of its type hint, for example an interval. Return a description
    of the fault; an empty text if the value passes.
    """
    if isinstance(check, Interval):
        low, high = (
            -math.inf if check.ge is None else check.ge,
            math.inf if check.le is None else check.le,
        )
        check = ValueCondition(
            f"is not between {low} and {high}", lambda value: low <= value <= high
        )
    return "" if not isinstance(check, ValueCondition) or check.holds(value) else check.words
