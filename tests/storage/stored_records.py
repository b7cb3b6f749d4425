"""Random instances of every stored type, by its fields, and equality that knows arrays and NaN.

Lengths are those that the fields declare; what the values mean is left to chance.
"""

import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Literal, Union

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mapmore_cli.domain.arrays import ASCENDING, FINITE
from mapmore_cli.domain.declared import Label, QuantityName, TermName
from mapmore_cli.domain.fits import Fit
from mapmore_cli.domain.models import Body
from mapmore_cli.modelling.kinds import kinds
from mapmore_cli.storage.artefacts.decoding import wrong_with
from mapmore_cli.storage.artefacts.schema import stored_fields, taken_apart

NAMES = st.text(
    st.characters(exclude_categories=["Cs", "Cc", "Cf", "Zl", "Zp"]), max_size=8
) | st.sampled_from(["strain", "pressure=150/strain:2", ".", "..", "a/b", "%2F", "ü μ", "order"])
QUANTITIES = st.sampled_from(["strain", "pressure", "force", "_x", "array", "kind", "A1"])
TERMS = st.sampled_from(
    ["1", "strain", "strain^2", "slow(play(pressure, 0.16), 0.3)", "force[k-1]"]
)
WORDS = st.sampled_from(
    [
        *("continue", "continue_linear", "saturate", "zero", "converged", "at_bound", "failed"),
        *("measured", "steady", "identified", "rate", "direction", "all", "rise", "fall"),
        *("hard", "carried", "bumpless", "rest"),
    ]
)
TEXTS = {
    taken_apart(hint).checks: texts
    for hint, texts in ((Label, NAMES), (QuantityName, QUANTITIES), (TermName, TERMS))
}
DEFINITIONS = st.sampled_from(
    [
        "",
        '{"bounds": {"a": null}, "name": "b", "reference": "", "starts": null, "text": '
        '"a*pressure", "units": {"a": "N/kPa"}}',
    ]
)
"""What a formula is defined by, unlike other texts, is read."""

DEEPEST = 1
"""Records within records of their own type."""

Lengths = dict[str, int]
"""Of the dimensions that were drawn, by their letters."""


@st.composite
def records(draw, type_, lengths=None, above=()):
    """Instances of a stored dataclass, with the lengths of what it lies in."""
    known = {} if lengths is None else lengths
    values = {}
    for name, (hint, _) in stored_fields(type_).items():
        drawn = DEFINITIONS if name == "definition" else _values(hint, (), known, (*above, type_))
        values[name] = draw(drawn)
    return type_(**values)


@st.composite
def _values(draw, hint, outer, known, above):
    """Values of a type, whose dimensions are called by the letters of the description, or of the
    one outside.
    """
    own = taken_apart(hint)
    letters = tuple(own.letters) or outer
    if own.kind is Union:
        return draw(_values(draw(st.sampled_from(own.inner)), letters, known, above))
    base = _plain(own, letters, known, above)
    if ASCENDING in own.checks:
        base = base.map(
            lambda one: np.sort(one) if isinstance(one, np.ndarray) else tuple(sorted(one))
        )
    return draw(base.filter(lambda one: not any(wrong_with(one, check) for check in own.checks)))


def _plain(own, letters, known, above):
    kind, finite = own.kind, FINITE in own.checks
    if kind in (Body, Fit):
        return _bodies(kind, known, above)
    if kind is types.NoneType:
        return st.none()
    if kind is Literal:
        return st.sampled_from(own.inner)
    if kind is str:
        return TEXTS.get(own.checks, WORDS if own.checks else NAMES)
    if kind is float:
        return (
            st.floats(-1e9, 1e9) | st.sampled_from([0.25, 1.0])
            if finite or own.checks
            else st.floats(width=64)
        )
    if kind is int:
        return st.integers(0, 2**40)
    if kind is bool:
        return st.booleans()
    if kind is range:
        return st.tuples(*[st.integers(0, 2**40)] * 2).map(lambda ends: range(*sorted(ends)))
    return _compound(own, finite, letters, known, above)


@st.composite
def _compound(
    draw,
    own,
    finite,
    letters,
    known,
    above,
):
    origin, arguments = own.kind, own.inner
    if origin is np.ndarray:
        return draw(
            _array(
                arguments[0], draw(_shape(letters or ("",), known)), known.get("M", 2**40), finite
            )
        )
    if origin is tuple and arguments[1:] == (...,):
        (length,) = draw(_shape(letters or ("",), known))
        length = 0 if arguments[0] in above[:-DEEPEST] else length
        return tuple(draw(_values(arguments[0], (), dict(known), above)) for _ in range(length))
    if origin is tuple:
        return tuple(draw(_values(one, (), known, above)) for one in arguments)
    if origin is Mapping:
        keys = draw(st.lists(_values(arguments[0], (), known, above), max_size=2, unique=True))
        lengths = known if letters else None
        return {
            key: draw(_values(arguments[1], letters, {} if lengths is None else lengths, above))
            for key in keys
        }
    return draw(records(own.kind, known, above))


def _bodies(hint, known, above):
    """What models consist of, or what was fitted; sums of models only so deep."""
    found = [kind.body if hint is Body else kind.fit for kind in kinds()]
    chosen = [
        type_
        for type_ in found
        if type_ is not None and (type_ not in above or len(above) < 2 * DEEPEST)
    ]
    return st.one_of(*(records(type_, known, above) for type_ in chosen))


@st.composite
def _shape(draw, letters, known):
    """Lengths of dimensions; those without a letter, and those that may be 0, are drawn each
    time.
    """
    if letters[0].endswith(" or 0") and draw(st.booleans()):
        return (0,)
    names = [letter.removesuffix(" or 0") for letter in letters]
    return tuple(
        known.setdefault(name, draw(st.integers(1, 3))) if name else draw(st.integers(0, 3))
        for name in names
    )


def _array(number, shape, below, finite):
    real = st.floats(-1e9, 1e9) if finite else st.floats(width=64)
    elements = {np.float64: real, np.int64: st.integers(0, below - 1), np.bool_: st.booleans()}[
        number
    ]
    return arrays(number, shape, elements=elements)


def same(left, right):
    """Equal in type and value, NaN equal to NaN, arrays by dtype and element, mappings with their
    order.
    """
    if type(left) is not type(right):
        return False
    if is_dataclass(left):
        return all(
            same(getattr(left, field.name), getattr(right, field.name)) for field in fields(left)
        )
    if isinstance(left, Mapping):
        return list(left) == list(right) and all(same(left[key], right[key]) for key in left)
    if isinstance(left, tuple | list):
        return len(left) == len(right) and all(map(same, left, right))
    if isinstance(left, np.ndarray):
        return left.dtype == right.dtype and np.array_equal(
            left, right, equal_nan=left.dtype.kind == "f"
        )
    return bool(left == right or (left != left and right != right))
