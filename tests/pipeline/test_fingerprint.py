"""Fingerprints and differences of slices."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmore_cli.modelling.pieces.recipe import Cuts, Fuse
from mapmore_cli.pipeline.staleness import fingerprint, place_in_spec, plain, slice_differences
from mapmore_cli.spec.experiment import Competitor

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


@dataclass(frozen=True)
class Slice:
    fuse: Fuse
    segment: dict[str, Cuts | str]
    against: list[str | Competitor]


def test_slices_become_json_under_the_names_of_the_file():
    part = Slice(
        Fuse(z_s=0.1),
        {"strain": Cuts(method="even", count=4)},
        [Competitor(model="sarosi", as_="LM")],
    )
    chosen = plain(part)
    assert chosen["fuse"] == {**asdict(Fuse()), "z_s": 0.1}
    assert chosen["segment"]["strain"]["count"] == 4
    assert chosen["against"][0]["as"] == "LM"


def test_every_ingredient_counts():
    basis = {
        "name": "fit",
        "revision": 1,
        "part": {"a": 1},
        "before": "x",
        "contents": {"p": "h"},
    }
    changes = [
        {"name": "fuse"},
        {"revision": 2},
        {"part": {"a": 2}},
        {"before": "y"},
        {"contents": {"q": "h"}},
        {"contents": {"p": "i"}},
    ]
    marks = {fingerprint(**basis), *(fingerprint(**{**basis, **change}) for change in changes)}
    assert len(marks) == 1 + len(changes)


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
