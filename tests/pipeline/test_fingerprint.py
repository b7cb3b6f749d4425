"""Fingerprints and differences of slices."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.pipeline.staleness import fingerprint, place_in_spec, slice_differences

VALUES = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-9, 9)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=4),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=8,
)
SLICES = st.dictionaries(st.sampled_from(["fit", "fuse", "levels", "odd"]), VALUES, max_size=3)


@given(SLICES)
def test_order_of_keys_is_of_no_account(part):
    turned = dict(reversed(part.items()))
    assert fingerprint("fit", 1, part, "", {}) == fingerprint("fit", 1, turned, "", {})
    assert slice_differences("fit", part, turned) == []


@given(SLICES, SLICES)
def test_differences_are_told_exactly_when_there_are_some(old, new):
    told = slice_differences("fit", old, new)
    assert bool(told) == (old != new)
    assert all("->" in text or text.endswith("changed") for text in told)


@pytest.mark.parametrize(
    ("key", "stage", "place"),
    [
        ("fuse", "fuse", "fuse"),
        ("levels", "segment", "data.levels"),
        ("against", "validate", "validate.against"),
        ("validate", "report", "validate"),
        ("unheard_of", "fit", "fit.unheard_of"),
    ],
)
def test_places_are_those_of_the_file(key, stage, place):
    assert place_in_spec(key, stage) == place


def test_long_values_are_cut():
    (text,) = slice_differences("fit", {"fit": list(range(100))}, {"fit": [*range(99), 7]})
    assert text == "fit changed"
    (text,) = slice_differences("fit", {"fit": "x" * 100}, {"fit": "y"})
    assert text.endswith("… -> y")
    assert len(text) < 80
