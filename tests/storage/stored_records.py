"""Random instances of every stored type, by its fields, and equality that knows arrays and NaN.

Lengths are those that the fields declare; what the values mean is left to chance.
"""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.domain.models import Body, Side
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.schema import dimensions, schema_of

NAMES = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cf", "Zl", "Zp"]), max_size=8) | st.sampled_from(
    ["strain", "pressure=150/strain:2", ".", "..", "a/b", "%2F", "ü μ", "order"]
)
SCALARS: Mapping[Any, st.SearchStrategy[Any]] = {
    str: NAMES,
    float: st.floats(width=64),
    int: st.integers(0, 2**40),
    bool: st.booleans(),
    Side: st.sampled_from(["continue", "continue_linear", "saturate", "zero"]) | st.floats(allow_nan=False, allow_infinity=False),
}
DEFINITIONS = st.sampled_from(
    ["", '{"bounds": {"a": null}, "name": "b", "reference": "", "starts": null, "text": "a*pressure", "units": {"a": "N/kPa"}}']
)
"""What a formula is defined by, unlike other texts, is read."""

DEEPEST = 1
"""Records within records of their own type."""

Lengths = dict[str, int]
"""Of the dimensions that were drawn, by their letters."""


@st.composite
def records(draw: st.DrawFn, type_: type, lengths: Lengths | None = None, above: tuple[type, ...] = ()) -> Any:
    """Instances of a stored dataclass, with the lengths of what it lies in."""
    known = {} if lengths is None else lengths
    hints, values = get_type_hints(type_, include_extras=True), {}
    for field in schema_of(type_).fields:
        if not field.derived:
            letters = dimensions(field.description)
            drawn = DEFINITIONS if field.name == "definition" else _values(hints[field.name], letters, known, (*above, type_))
            values[field.name] = draw(drawn)
    return type_(**values)


@st.composite
def _values(draw: st.DrawFn, hint: Any, letters: tuple[str, ...], known: Lengths, above: tuple[type, ...]) -> Any:
    """Values of a type, whose dimensions are called by `letters`."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return draw(_values(arguments[0], letters, known, above))
    if hint in SCALARS:
        return draw(SCALARS[hint])
    if hint in (Body, Any):
        return draw(_bodies(hint, known, above))
    if origin is Literal:
        return draw(st.sampled_from(arguments))
    if origin in (Union, types.UnionType):
        return draw(st.none() | _values(arguments[0], letters, known, above))
    if origin is np.ndarray:
        return draw(_array(get_args(arguments[1])[0], draw(_shape(letters or ("",), known)), known.get("M", 2**40)))
    if origin is tuple and arguments[1:] == (...,):
        (length,) = draw(_shape(letters or ("",), known))
        length = 0 if arguments[0] in above[:-DEEPEST] else length
        return tuple(draw(_values(arguments[0], (), dict(known), above)) for _ in range(length))
    if origin is tuple:
        return tuple(draw(_values(one, (), known, above)) for one in arguments)
    if origin in (dict, Mapping):
        keys = draw(st.lists(NAMES, max_size=2, unique=True))
        lengths = known if letters else None
        return {key: draw(_values(arguments[1], letters, dict(known) if lengths is None else lengths, above)) for key in keys}
    return draw(records(hint, known, above))


def _bodies(hint: Any, known: Lengths, above: tuple[type, ...]) -> st.SearchStrategy[Any]:
    """What models consist of, or what was fitted; sums of models only so deep."""
    found = [kind.body if hint is Body else kind.fit for kind in kinds()]
    chosen = [type_ for type_ in found if type_ is not None and (type_ not in above or len(above) < 2 * DEEPEST)]
    return st.one_of(*(records(type_, known, above) for type_ in chosen), *([] if hint is Body else [st.none()]))


@st.composite
def _shape(draw: st.DrawFn, letters: tuple[str, ...], known: Lengths) -> tuple[int, ...]:
    """Lengths of dimensions; those without a letter, and those that may be 0, are drawn each time."""
    if letters[0].endswith(" or 0") and draw(st.booleans()):
        return (0,)
    names = [letter.removesuffix(" or 0") for letter in letters]
    return tuple(known.setdefault(name, draw(st.integers(1, 3))) if name else draw(st.integers(0, 3)) for name in names)


def _array(number: Any, shape: tuple[int, ...], below: int) -> st.SearchStrategy[Any]:
    elements = {np.float64: SCALARS[float], np.int64: st.integers(0, below - 1), np.bool_: st.booleans()}[number]
    return arrays(number, shape, elements=elements)


def same(left: Any, right: Any) -> bool:
    """Equal in type and value, NaN equal to NaN, arrays by dtype and element, mappings with their order."""
    if type(left) is not type(right):
        return False
    if is_dataclass(left):
        return all(same(getattr(left, field.name), getattr(right, field.name)) for field in fields(left))
    if isinstance(left, Mapping):
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    if isinstance(left, tuple | list):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, np.ndarray):
        return left.dtype == right.dtype and np.array_equal(left, right, equal_nan=left.dtype.kind == "f")
    return bool(left == right or (left != left and right != right))
